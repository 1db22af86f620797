# SPDX-License-Identifier: Apache-2.0
"""Checks of what comes in from outside, one for each kind of value; every message names the field.

Two errors: ShapeError for what is no array of numbers of the expected shape, InvalidValueError for
the right shape with values that no fit can use. The checks of arrays that come with every frame are
compiled: numpy takes ten times as long for so few numbers.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from numbers import Integral
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .arrays import as_array, as_integers, described, has_axis
from .errors import InvalidValueError, ScopeWarning, ShapeError, UnitsWarning, warn_caller
from .kernel import kernel
from .matrices import MINUS_EYE, add9, determinant, entries, product, transposed
from .part import Array

# of the entries of R Rᵀ - I: rotations rounded to two decimals pass, scaled ones do not
ROTATION_TOLERANCE = 0.01
# metres between two points or joints of one person, one after the other in a list
LARGEST_STEP = 10.0
_FEWEST_TIMES = 5  # whole numbers that are no coincidence
_LONGEST_INTERVAL = 2.0  # seconds from one frame of a motion to the next
_NO_WEIGHTS = np.zeros(0)
_UNITS = "Scope's unit is the metre; divide centimetres by 100, millimetres by 1000"
_FEWEST_POINTS = 4  # that are no coincidence
_WIDEST = 4.0  # tangent of half a pinhole camera's field of view, 76 degrees
_LEAST_CONFIDENT = 0.2  # if there is one for all: metres are smaller, of pixels more than 1
# Of the extent of all keypoints: a person's head is a sixth, what two detectors disagree by less.
_FAR_APART = 0.15
_MOST_CONFIDENT = 10.0  # on average: confidences are shares of one, or a few times that
# Coordinates of a normalized image are in 0..1 or -1..1, of points beside it a bit larger.
_NORMALIZED = 2.0
_FARTHEST_NEIGHBOUR_M = 1.0  # from a person's pelvis to the nearest other point
_STEEPEST = 0.5  # y of a floor's normal, of at most 1: more only if the camera is upside down
_AHEAD = 0.9  # z of a floor's normal: more only if the camera looks up by 64 degrees
_BELOW_M = 0.3
_SHORTEST_PX = 10.0  # of a focal length in pixels: shorter ones belong to normalized coordinates
_FARTHEST = 300.0  # metres from the origin to what a person touches, or to a camera
_FARTHEST_MM = 1000.0 * _FARTHEST


def as_indices(value: ArrayLike, limit: int, name: str) -> Array:
    """Return `value` as int64 indices (n,) in 0..limit-1.

    :raises ShapeError: it is not a list of whole numbers, or one of them lies outside.
    """
    array = as_integers(value, name)
    if not all_within(array, 0, limit):
        raise ShapeError(
            f"{name} must lie in 0..{limit - 1}, but go from {array.min()} to {array.max()}."
        )
    return array


def as_number(value: Any, name: str) -> float:
    """Return a single number, which may be NaN.

    :raises InvalidValueError: it is none.
    """
    try:
        # of a ragged list: ValueError
        if isinstance(value, (str, bytes)) or value is None or np.ndim(value) != 0:
            raise TypeError
        return float(value)
    except OverflowError:
        raise InvalidValueError(
            f"{name} must be a number that fits in 64 bits, but is too large."
        ) from None
    except (TypeError, ValueError):
        raise InvalidValueError(f"{name} must be a number, but is {described(value)}.") from None


def check_weight(value: Any, name: str) -> None:
    """Check a weight, a single number.

    :raises InvalidValueError: it is negative, infinite or no number.
    """
    if not 0.0 <= as_number(value, name) < math.inf:
        raise InvalidValueError(f"{name} must be finite and not negative, but is {value}.")


def check_count(value: Any, name: str, least: int = 1) -> None:
    """Check how many there are of something.

    :raises InvalidValueError: it is not a whole number, is less than `least`, or is too large for
        an index.
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
        raise InvalidValueError(
            f"{name} must be a whole number of at least {least}, but is {value!r}."
        )
    if int(value) > sys.maxsize:
        raise InvalidValueError(
            f"{name} must be a whole number of at most {sys.maxsize}, but is larger."
        )


def check_switch(value: Any, name: str) -> None:
    """Check whether to do something.

    :raises InvalidValueError: it is neither True nor False.
    """
    if not isinstance(value, (bool, np.bool_)):
        raise InvalidValueError(f"{name} must be True or False, but is {described(value)}.")


def check_robust(value: Any, name: str) -> None:
    """Check the scale of a robust kernel, a single number.

    :raises InvalidValueError: it is not positive, or no number.
    """
    if not as_number(value, name) > 0.0:
        raise InvalidValueError(f"{name} must be positive, or infinite for none, but is {value}.")


def check_not_negative(values: Array, name: str) -> None:
    """Check weights (n,); NaN passes, because it leaves a measurement out.

    :raises InvalidValueError: one is negative.
    """
    for k in np.flatnonzero(values < 0.0):
        raise InvalidValueError(f"{name} must not be negative, but number {k} is {values[k]:.6g}.")


def check_finite(values: Array, name: str) -> None:
    """Check an array (...) of any shape.

    :raises InvalidValueError: a value is NaN or infinite.
    """
    if not np.isfinite(values).all():
        raise InvalidValueError(f"{name} must be finite, but hold NaN or infinity.")


def as_finite(value: ArrayLike, shape: tuple[int | None, ...], name: str) -> Array:
    """Return `value` as contiguous float64 of a shape that can be written to, as `as_array`.

    :raises ShapeError: it has another shape, or is not an array of numbers.
    :raises InvalidValueError: a value is NaN or infinite.
    """
    array = as_array(value, shape, name)
    check_finite(array, name)
    return array


def check_rotations(R: Array, name: str, weights: Array | None = None) -> None:
    """Check matrices (n, 3, 3).

    :param weights: (n,), of measurements: a matrix whose weight is not positive may be anything,
        and one that is not finite leaves the measurement out. None checks all.
    :raises InvalidValueError: one is not a rotation.
    """
    k = _first_not_rotation(R, _NO_WEIGHTS if weights is None else weights, weights is None)
    if k >= 0:
        raise InvalidValueError(
            f"{name} must be rotation matrices, orthonormal and of determinant 1, but number {k} "
            f"is {R[k].tolist()}."
        )


def check_information(information: Array, name: str) -> None:
    """Check an information matrix (P, P).

    :raises InvalidValueError: it is not symmetric, or has a negative eigenvalue.
    """
    rounding = 1e-6 * np.abs(information).max(initial=0.0)
    if (np.abs(information - information.T) > rounding).any():
        raise InvalidValueError(f"{name} must be symmetric, but differs from its transpose.")
    least = np.linalg.eigvalsh(information).min(initial=0.0)
    if least < -rounding:
        raise InvalidValueError(
            f"{name} must be positive semidefinite, as an inverse covariance is, but has the "
            f"eigenvalue {least:.6g}."
        )


def check_intrinsics(intrinsics: Array) -> None:
    """Check a camera matrix (3, 3), [[fx, s, cx], [0, fy, cy], [0, 0, 1]] in pixels.

    :raises InvalidValueError: it is not finite, or none of that form.
    """
    fault = _fault_of_intrinsics(intrinsics)
    if fault == 0:
        return
    K = intrinsics.tolist()
    if fault == 1:
        raise InvalidValueError(
            f"Intrinsics must be finite with positive focal lengths, but got {K}."
        )
    hint = ""
    if _fault_of_intrinsics(np.ascontiguousarray(intrinsics.T)) == 0:
        hint = "; transpose it"
    elif intrinsics[2, 2] and _fault_of_intrinsics(intrinsics / intrinsics[2, 2]) == 0:
        hint = f"; divide it by its last entry, {intrinsics[2, 2]:.6g}"
    raise InvalidValueError(
        "Intrinsics must be a camera matrix [[fx, s, cx], [0, fy, cy], [0, 0, 1]] in pixels, but "
        f"got {K}{hint}."
    )


def check_type(value: Any, wanted: type | tuple[type, ...], name: str) -> None:
    """Check what kind of object a field holds.

    :raises InvalidValueError: it is an instance of none of `wanted`.
    """
    if not isinstance(value, wanted):
        kinds = wanted if isinstance(wanted, tuple) else (wanted,)
        allowed = " or ".join("None" if kind is type(None) else kind.__name__ for kind in kinds)
        raise InvalidValueError(f"{name} must be {allowed}, but is {described(value)}.")


def check_list(value: Any, name: str, what: str) -> None:
    """Check that there is an entry for each of something, whatever the entries are.

    :param what: what each entry is of, for the message: "frame", "clip".
    :raises InvalidValueError: it is a single entry, or a generator, which can be read only once.
    """
    is_single = isinstance(value, (str, bytes, Mapping, type)) or (
        isinstance(value, np.ndarray) and value.ndim == 0
    )
    if is_single or not (hasattr(value, "__len__") and hasattr(value, "__getitem__")):
        raise InvalidValueError(
            f"{name} must be a list with an entry for each {what}, but is {described(value)}."
        )


def warn_of_units(points: Array, name: str) -> bool:
    """Warn of points (n, 3) of one person that lie too far apart to be in metres, with
    `UnitsWarning`; return whether they do.
    """
    are_apart = far_apart(points)
    if are_apart:
        warn_caller(
            f"{name} lie more than {LARGEST_STEP:g} m apart from one to the next, too far for a "
            f"person; {_UNITS}.",
            UnitsWarning,
        )
    return are_apart


def warn_of_pixels(K: Array, pixels: Array, normalized: Array) -> None:
    """Warn of 2D keypoints that are probably not what they were meant to be.

    :param K: (3, 3) intrinsics. :param pixels: (n, 2).
    :param normalized: (n, 3) of normalized image coordinates and confidence.
    """
    fault = _fault_of_pixels(K, pixels, normalized)
    if fault:
        kind, message = _OF_PIXELS[fault]
        warn_caller(message.format(fx=K[0, 0], fy=K[1, 1], cx=K[0, 2], cy=K[1, 2]), kind)


def warn_of_points(points: Array, has_camera: bool, are_weights: bool) -> None:
    """Warn of 3D keypoints (n, 4), positions and confidence, that are probably not in metres in
    camera axes.

    :param has_camera: without one, points may lie anywhere.
    :param are_weights: whether the confidences are relative to given deviations, and so may be
        large.
    """
    warn_of_units(points, "Points of 3D keypoints")
    fault = _fault_of_points(points)
    if fault and (has_camera or fault not in _OF_CAMERA) and not (fault == 2 and are_weights):
        warn_caller(_OF_POINTS[fault])


_TOO_CONFIDENT = (
    "is far above 1 on average; divide percentages by 100, or give standard deviations as sigma_px "
    "or sigma_m."
)


# What to tell of the faults that `_fault_of_pixels` finds, and `_fault_of_points`.
_OF_PIXELS = {
    1: (
        UnitsWarning,
        "Pixels of 2D keypoints all lie within 2 of (0, 0), as those of a normalized image; "
        "convert them to pixels by its size.",
    ),
    2: (
        ScopeWarning,
        "Pixels of 2D keypoints are (0, 0) or (-1, -1), as of keypoints that are missing; give "
        "these a confidence of 0.",
    ),
    3: (
        UnitsWarning,
        "Focal lengths of {fx:.6g} and {fy:.6g} pixels are too short for these pixels; multiply "
        "millimetres by the image's width in pixels over the sensor's in millimetres.",
    ),
    4: (ScopeWarning, f"Confidence of 2D keypoints {_TOO_CONFIDENT}"),
    5: (
        ScopeWarning,
        "Pixels of 2D keypoints lie beyond the image whose centre is the principal point, "
        "({cx:.6g}, {cy:.6g}); check that the intrinsics belong to pixels of this size, unless the "
        "image is cropped.",
    ),
    6: (
        ScopeWarning,
        "The principal point of the intrinsics is (0, 0), the image's corner; it is mostly half "
        "of the image's size.",
    ),
}
_OF_POINTS = {
    1: "Points of 3D keypoints all lie behind the camera, z < 0; camera axes are x right, y down, "
    "z forward: negate y and z of points whose y is up.",
    2: f"Confidence of 3D keypoints {_TOO_CONFIDENT}",
    3: "Points of 3D keypoints are (0, 0, 0), as of keypoints that are missing; give these a "
    "confidence of 0.",
    4: "Points of 3D keypoints lie partly behind the camera, as those that are relative to the "
    "pelvis; add its position in the camera frame, or leave out intrinsics and 2D keypoints.",
}
_OF_CAMERA = (1, 4)  # without one, points may lie anywhere


def warn_of_repeated(indices: Array, rows: Array, name: str) -> None:
    """Warn of keypoints of which one point lies at two places.

    :param rows: (n, 3 or 4) of where each is, and its confidence.
    """
    k = _first_elsewhere(indices, rows)
    if k >= 0:
        warn_caller(
            f"{name} have point {indices[k]} twice, at places that are far apart; give each point "
            "its own name or number (joint i is M + i)."
        )


def warn_of_one_confidence(given: ArrayLike, rows: Array, name: str, sigma: str) -> None:
    """Warn of one confidence for all that is probably meant as their standard deviation.

    :param rows: (n, 3 or 4), of which the last column are the confidences.
    :param sigma: the field of deviations.
    """
    if has_axis(given) or not len(rows):
        return
    value = rows[0, -1]
    if 0.0 < value < _LEAST_CONFIDENT or value > 1.0:
        warn_caller(
            f"{name} is {value:g} for all of them, which makes all their weights {value:g} times "
            f"what they are without; if it is a standard deviation, give it as {sigma}."
        )


def warn_of_distance(points: Array, name: str) -> bool:
    """Warn of points (n, 3) that are too far away to be in metres, with `UnitsWarning`; return
    whether they are.

    :param name: with a verb, as a message begins: "Points of foot contacts lie".
    """
    distances = np.abs(points).max(axis=-1, initial=0.0)
    # beyond, they are no millimetres either
    known = distances[distances < _FARTHEST_MM]
    is_far = len(known) > 0 and known.min() > _FARTHEST
    if is_far:
        warn_caller(f"{name} more than {_FARTHEST:g} m away; {_UNITS}.", UnitsWarning)
    return is_far


def warn_of_deviations(sigmas: Array, least: float, most: float, name: str, unit: str) -> None:
    """Warn of standard deviations (n,) all of which are too small or large, with `UnitsWarning`."""
    if len(sigmas) and (sigmas.max() < least or sigmas.min() > most):
        warn_caller(
            f"{name} is {sigmas[0]:g} {unit}, which no measurement has; it must be in {unit}.",
            UnitsWarning,
        )


def warn_of_floor(normal: Array, offset: float, points: Array, has_camera: bool) -> None:
    """Warn of a floor that is probably upside down, has the wrong sign, or is not in metres.

    :param normal: (3,). :param points: (n, 3) 3D keypoints.
    :param has_camera: without one, the axes may be any.
    """
    if has_camera and (normal[1] > _STEEPEST or normal[2] > _AHEAD):
        warn_caller(
            "The floor's normal points down or away from the camera, but must point up, about "
            "(0, -1, 0) in camera axes; negate normal and offset, or turn them to these axes."
        )
        return
    warn_of_distance(np.array([[0.0, 0.0, offset]]), "The floor lies")
    below = offset - points @ normal
    below = below[np.isfinite(below)]
    if len(below) >= _FEWEST_POINTS and _BELOW_M < np.median(below) < LARGEST_STEP:
        warn_caller(
            f"Most 3D keypoints lie more than {_BELOW_M:g} m below the floor; its normal must "
            "point up, and its offset is normal^T p of a point p of it, which is negative where "
            "the floor is below the camera."
        )


def warn_of_start(t_camera_root: Array, in_image: bool) -> None:
    """Warn of an initial position (3,) that is not in metres, or from which nothing is seen.

    :param in_image: whether there are 2D keypoints.
    """
    warn_of_distance(t_camera_root[None], "t_camera_root of init lies")
    if in_image and t_camera_root[2] <= 0.0:
        warn_caller(
            "t_camera_root of init lies behind the camera, z < 0; camera axes are x right, y down, "
            "z forward."
        )


def warn_of_percentages(probabilities: Array, name: str) -> None:
    """Warn of probabilities (n,) far above 1."""
    if probabilities.max(initial=0.0) > _MOST_CONFIDENT:
        warn_caller(f"{name} is far above 1; divide percentages by 100.")


def warn_of_kernel(sigma: float, most: float, name: str) -> None:
    """Warn of a robust kernel's sigma that is probably no squared residual, with `UnitsWarning`."""
    if most < sigma < math.inf:
        warn_caller(
            f"{name} is {sigma:g}, but is a squared residual, in normalized image coordinates or "
            "metres; infinity turns the kernel off.",
            UnitsWarning,
        )


def warn_of_weight(weight: float, least: float, name: str) -> None:
    """Warn of a weight that is probably a standard deviation, with `UnitsWarning`."""
    if 0.0 < weight < least:
        warn_caller(
            f"{name} is {weight:g}, but weights are 1/sigma^2, in squared metres or normalized "
            "image coordinates; give deviations as sigma_px or sigma_m.",
            UnitsWarning,
        )


def warn_of_frame_numbers(times: Array) -> None:
    """Warn of times (T,) of a motion's frames that are probably no seconds, with `UnitsWarning`.

    Frame numbers are whole; milliseconds are whole or far apart. Of frames that are seconds apart,
    few are captured.
    """
    if len(times) < _FEWEST_TIMES:
        return
    are_whole = not (times % 1.0).any()
    if are_whole or np.median(np.diff(times)) > _LONGEST_INTERVAL:
        kind = "whole numbers" if are_whole else "far apart"
        warn_caller(
            f"times are {kind}, {times[0]:g}, {times[1]:g}, {times[2]:g}, …, probably frame "
            "numbers or milliseconds instead of seconds; divide frame numbers by the frame rate, "
            "milliseconds by 1000. For frames that are seconds apart, give smaller weights of "
            "acceleration than MotionPrior's.",
            UnitsWarning,
        )


@kernel
def all_within(indices: Array, least: int, limit: int) -> bool:
    """Whether all of (n,) lie in least..limit-1."""
    for k in range(indices.shape[0]):
        if not least <= indices[k] < limit:
            return False
    return True


@kernel
def _first_not_rotation(R: Array, weights: Array, every: bool) -> int:
    """Return the index of the first of (n, 3, 3) that is no rotation, or -1; unless `every`, as
    `check_rotations`.
    """
    for k in range(R.shape[0]):
        if not every and not weights[k] > 0.0:
            continue
        M = entries(R[k])
        off = 0.0
        for e in add9(product(M, transposed(M)), MINUS_EYE):
            off = max(off, abs(e))
        det = determinant(M)
        if 0.0 * det != 0.0:
            if every:
                return k
        elif off > ROTATION_TOLERANCE or det < 0.0:
            return k
    return -1


@kernel
def _fault_of_intrinsics(K: Array) -> int:
    """Return 0 for a camera matrix, 1 if not finite or a focal length is not positive, 2 if of
    another form.
    """
    total = 0.0
    for r in range(3):
        for c in range(3):
            total += 0.0 * K[r, c]
    if total != 0.0:
        return 1
    if (
        abs(K[2, 0]) > 1e-9
        or abs(K[2, 1]) > 1e-9
        or abs(K[2, 2] - 1.0) > 1e-9
        or abs(K[1, 0]) > 1e-9 * abs(K[0, 0])
    ):
        return 2
    return 0 if K[0, 0] > 0.0 and K[1, 1] > 0.0 else 1


@kernel
def _fault_of_pixels(K: Array, pixels: Array, normalized: Array) -> int:
    """Return 0, or what is wrong: 1 pixels of a normalized image, 2 missing, 3 focal length, 4
    confidence, 5 beyond the image's lower right corner, 6 principal point.
    """
    count = 0
    positive = 0
    small = 0
    missing = 0
    wide = 0
    right = 0
    below = 0
    confidence = 0.0
    for k in range(pixels.shape[0]):
        x = pixels[k, 0]
        y = pixels[k, 1]
        if not normalized[k, 2] > 0.0 or 0.0 * (x + y) != 0.0:
            continue
        count += 1
        confidence += normalized[k, 2]
        if abs(x) <= _NORMALIZED and abs(y) <= _NORMALIZED:
            small += 1
        if x == y and (x == 0.0 or x == -1.0):
            missing += 1
        if x > 0.0 and y > 0.0:
            positive += 1
        if abs(normalized[k, 0]) > _WIDEST or abs(normalized[k, 1]) > _WIDEST:
            wide += 1
        if x > 2.0 * K[0, 2] > 0.0:
            right += 1
        if y > 2.0 * K[1, 2] > 0.0:
            below += 1
    if count < _FEWEST_POINTS:
        return 0
    if small == count and K[0, 2] > _NORMALIZED:
        return 1
    if 0 < missing < count:
        return 2
    if 2 * wide > count or K[0, 2] > _WIDEST * K[0, 0] or K[1, 2] > _WIDEST * K[1, 1]:
        return 3
    if confidence > _MOST_CONFIDENT * count:
        return 4
    if 4 * min(right, below) > count:
        return 5
    in_image = K[0, 0] > _SHORTEST_PX and K[0, 2] == 0.0 and K[1, 2] == 0.0
    return 6 if in_image and positive == count else 0


@kernel
def _fault_of_points(points: Array) -> int:
    """Return 0, or what is wrong with (n, 4): 1 all behind the camera, 2 confidence, 3 missing at
    the origin, where one point among others may be the pelvis, 4 some behind.
    """
    count = 0
    zero = 0
    nearest = np.inf
    behind = 0
    confidence = 0.0
    for k in range(points.shape[0]):
        total = 0.0 * points[k, 0] + 0.0 * points[k, 1] + 0.0 * points[k, 2]
        if total != 0.0 or not points[k, 3] > 0.0:
            continue
        count += 1
        confidence += points[k, 3]
        if points[k, 2] < 0.0:
            behind += 1
        distance = math.sqrt(points[k, 0] ** 2 + points[k, 1] ** 2 + points[k, 2] ** 2)
        if distance == 0.0:
            zero += 1
        else:
            nearest = min(nearest, distance)
    if count < _FEWEST_POINTS:
        return 0
    if behind == count:
        return 1
    if 1 < zero < count or (zero == 1 and nearest > _FARTHEST_NEIGHBOUR_M):
        return 3
    if confidence > _MOST_CONFIDENT * count:
        return 2
    return 4 if 4 * behind > count else 0


@kernel
def far_apart(points: Array) -> bool:
    """Whether more than half of the steps from one finite point of (n, 3) to the next are longer
    than `LARGEST_STEP`.
    """
    steps = 0
    far = 0
    before = -1
    for k in range(points.shape[0]):
        total = 0.0 * points[k, 0] + 0.0 * points[k, 1] + 0.0 * points[k, 2]
        if total != 0.0:
            continue
        if before >= 0:
            square = 0.0
            for r in range(3):
                square += (points[k, r] - points[before, r]) ** 2
            steps += 1
            if square > LARGEST_STEP**2:
                far += 1
        before = k
    return 2 * far > steps


@kernel
def _first_elsewhere(indices: Array, rows: Array) -> int:
    """Return the number of the first row that has the point of a row before it, far away from
    there, or -1.

    :param rows: (n, C) coordinates and confidence; rows without a positive confidence do not count.
    """
    n = rows.shape[0]
    last = rows.shape[1] - 1
    is_rising = True
    for k in range(1, n):
        is_rising = is_rising and indices[k] > indices[k - 1]
    if is_rising:  # then none is repeated
        return -1
    extent = 0.0
    for c in range(last):
        least = np.inf
        most = -np.inf
        for k in range(n):
            if rows[k, last] > 0.0 and abs(rows[k, c]) < np.inf:
                least = min(least, rows[k, c])
                most = max(most, rows[k, c])
        extent = max(extent, most - least)
    for k in range(1, n):
        for j in range(k):
            if indices[j] == indices[k] and rows[j, last] > 0.0 and rows[k, last] > 0.0:
                square = 0.0
                for c in range(last):
                    square += (rows[k, c] - rows[j, c]) ** 2
                if square > (_FAR_APART * extent) ** 2:
                    return k
    return -1
