# SPDX-License-Identifier: Apache-2.0
"""Likely mistakes that only a fit shows: told with `ScopeWarning` after one that fits badly.

Mirrored coordinates are as good as any, but no rotation takes a body to its mirror image. So what
was measured is mirrored back and fitted once more; where that costs far less, the warning says
which axis was probably meant. Flipped pixels alone are an exception: but for perspective, they are
those of the body mirrored in depth, which bends as a body can in most poses. Alone, pixels are
therefore judged only where the person would lie or stand on the head, or where the fit is costly.
"""

import math
import threading
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import as_array, as_numbers
from ..errors import warn_caller
from ..measurements import LARGEST, SIGMA_2D, Keypoints2D, Keypoints3D, Measurements
from ..options import Priors
from ..part import Array
from ..state import Fit, Status
from ..tree import Tree
from ..validation import LARGEST_STEP

_FEWEST_POINTS = 4  # that are no coincidence
_MANY_ITERATIONS = 40  # after which a fit that has not converged is judged as well
# Metres in the median: of 3D keypoints in the wrong order 0.09 to 0.26, in the right one 0.04.
# Those that are in the right order are off by 1.8 times their stated deviation, most often 1.5.
_FAR_M = 0.13
_FAR_M_IF_STATED = 0.05
_FAR_SIGMAS = 5.0
# Of the extent of 2D keypoints, in the median: of those with the intrinsics of another image size
# 0.36 and more beside 3D keypoints, of the numbers of other points 0.04, of right ones up to 0.012.
_FAR_IN_IMAGE = 0.02
# Cost for each measured point, above which something is wrong. With true standard deviations, it is
# at most 2 of 3D keypoints and 4 of 2D and 3D ones; of mirrored ones it is at least 3 and 7.
_COSTLY_IN_SPACE = 3.0
_COSTLY_TOGETHER = 6.0
COSTLY_IN_IMAGE = 1.2  # of 2D keypoints alone; 8 % of 1,000 right fits cost more
_UPRIGHT = 0.5  # cosine of the angle between the root's vertical axis and the image's
# by which the fit to what was given costs more than the other
_FACTOR = 1.5
_FACTOR_IN_IMAGE = 1.4
# Of people who stand, from 2D keypoints alone: it holds for none of 1,000 who were seen rightly,
# and for a third in flipped images.
_FACTOR_FLIPPED = 1.7
_FRAMES = 3  # of a clip that are fitted once more
# Deviations of all shape coefficients together, beyond their expected norm: with true standard
# deviations at most 2.3, of feet for metres and of COCO's numbers for the body's 5 and more.
_UNLIKELY = 4.5

_SILENCE = threading.Lock()  # of warnings, which are silenced for all threads

Change = Callable[[Measurements], Measurements]


def _mirrored(axis: int, in_place: bool) -> Change:
    """Return what negates an axis of all that was measured in space, about the camera or about the
    points' mean.
    """
    signs = np.ones(3)
    signs[axis] = -1.0

    def change(measurements: Measurements) -> Measurements:
        seen = measurements.keypoints3d
        if seen is not None:
            points = as_array(seen.points, (None, 3), "Points of 3D keypoints")
            pivot = np.nan_to_num(np.nanmean(points, axis=0)) if in_place else np.zeros(3)
            seen = replace(seen, points=pivot + (points - pivot) * signs)
        field = measurements.orientation_field
        if field is not None:
            directions = as_array(field.directions, (None, 3), "Directions of the field")
            field = replace(field, directions=directions * signs)
        return replace(measurements, keypoints3d=seen, orientation_field=field)

    return change


def _with_pixels(change: Callable[[Array, Array], Array]) -> Change:
    """Return what changes pixels (n, 2) of a camera (3, 3). The principal point stands for the
    image's centre.
    """

    def changed(measurements: Measurements) -> Measurements:
        seen = measurements.keypoints2d
        if seen is None or measurements.intrinsics is None:
            return measurements
        K = as_array(measurements.intrinsics, (3, 3), "Intrinsics")
        pixels = as_array(seen.pixels, (None, 2), "Pixels of 2D keypoints")
        return replace(measurements, keypoints2d=replace(seen, pixels=change(K, pixels)))

    return changed


_NAMES = "or exchange left and right in the names of points"
_FROM_THE_LEFT = (
    f"measure x of pixels from the image's left, as where it is not flipped, {_NAMES}",
    _with_pixels(lambda K, p: p * [-1.0, 1.0] + [2.0 * K[0, 2], 0.0]),
)
_FROM_THE_TOP = (
    "measure y of pixels from the image's top: subtract it from the height",
    _with_pixels(lambda K, p: p * [1.0, -1.0] + [0.0, 2.0 * K[1, 2]]),
)
_X_BEFORE_Y = (
    "give pixels as (x, y) instead of (row, column)",
    _with_pixels(lambda K, p: p[:, ::-1]),
)
_FLIPPED = (
    f"flip back the image, {_NAMES}",
    lambda m: _mirrored(0, False)(_FROM_THE_LEFT[1](m)),
)
# What to do where measurements fit far better once they are changed.
IMAGE_REMEDIES: list[tuple[str, Change]] = [_FROM_THE_LEFT, _FROM_THE_TOP, _X_BEFORE_Y]
_SPACE_REMEDIES: list[tuple[str, Change]] = [
    (
        f"negate one axis, because x is right, y down and z forward, {_NAMES}, or starts and ends "
        "of directions, or, in views, give R^T and -R^T t of poses R, t from the camera to the "
        "world",
        _mirrored(axis, in_place),
    )
    for axis in (0, 1)
    for in_place in (False, True)
]


def some_of(frames: Sequence[Any]) -> Array:
    """Return the numbers of a few frames of a clip, which show what holds for all."""
    return np.arange(0, len(frames), max(1, math.ceil(len(frames) / _FRAMES)))


def warn_of_wrong_points(tree: Tree, measurements: Measurements, found: Fit) -> bool:
    """Warn of 3D keypoints most of which the fitted body is far away from; return whether it is."""
    seen = measurements.keypoints3d
    if seen is None or not _is_done(found):
        return False
    points, fitted = _seen_and_fitted(tree, seen, seen.points, found)
    if len(points) < _FEWEST_POINTS:
        return False
    off = float(np.median(np.linalg.norm(fitted - points, axis=1)))
    most = _FAR_M
    if seen.sigma_m is not None:
        stated = float(np.median(np.asarray(seen.sigma_m, dtype=float)))
        most = min(_FAR_M, max(_FAR_M_IF_STATED, _FAR_SIGMAS * stated))
    # beyond, another warning tells of the unit of points, but none of that of one's own residuals
    is_far = most < off < (math.inf if measurements.tables else LARGEST_STEP)
    if is_far:
        warn_caller(
            f"The body fits the 3D keypoints badly, by {off:.2f} m in the median; check "
            "that each has its own point, by name or by number (joint i is M + i), that the "
            "intrinsics belong to pixels of this size, and residuals of your own are in metres."
        )
    return is_far


def warn_of_wrong_pixels(tree: Tree, measurements: Measurements, found: Fit) -> bool:
    """Warn of 2D keypoints most of which the fitted body is far away from; return whether it is."""
    seen = measurements.keypoints2d
    intrinsics = measurements.intrinsics
    if seen is None or intrinsics is None or not _is_done(found):
        return False
    K = as_array(intrinsics, (3, 3), "Intrinsics")
    pixels, fitted = _seen_and_fitted(tree, seen, seen.pixels, found)
    if len(pixels) < _FEWEST_POINTS:
        return False
    projected = fitted @ K.T
    with np.errstate(all="ignore"):  # a point may be in the camera's own plane
        image = projected[:, :2] / projected[:, 2:]
    off = float(np.median(np.linalg.norm(image - pixels, axis=1)))
    stated = SIGMA_2D * K[0, 0] if seen.sigma_px is None else np.median(np.asarray(seen.sigma_px))
    extent = np.ptp(pixels, axis=0).max()
    is_far = off > max(_FAR_SIGMAS * float(stated), _FAR_IN_IMAGE * float(extent))
    if is_far:
        warn_caller(
            f"The body fits the 2D keypoints badly, by {off:.0f} pixels in the median; check that "
            "each has its own point, by name or by number, that the intrinsics belong to pixels of "
            "this size, and that other measurements are of the same person and time, and residuals "
            "of your own in metres."
        )
    return is_far


def _is_done(found: Fit) -> bool:
    return found.status is Status.CONVERGED or found.iterations >= _MANY_ITERATIONS


def _seen_and_fitted(
    tree: Tree, seen: Keypoints2D | Keypoints3D, values: ArrayLike, found: Fit
) -> tuple[Array, Array]:
    """Return the usable points or pixels (n, 3 or 2) of keypoints, and where the fitted body has
    them (n, 3), camera frame.

    :param values: what `seen` has of each.
    """
    measured = as_numbers(values, "Measured keypoints")
    confidence = as_numbers(seen.confidence, "Confidence of keypoints")
    usable = (np.abs(measured) < LARGEST).all(axis=1) & (confidence > 0.0)
    indices = np.asarray(seen.indices)[usable]
    part = tree.point_part[indices]
    levers = tree.v_bar[indices] + tree.V[indices][:, :, : tree.shape_count] @ found.state.beta
    turned = np.einsum("nij,nj->ni", found.R_camera_part[part], levers)
    return measured[usable], found.t_camera_part[part] + turned


def warn_of_unlikely_shape(betas: Sequence[Array], priors: Priors) -> None:
    """Warn of fitted shapes (P,) that nobody has, found with the default priors: most mistakes that
    a person can be bent to at all need such a one.
    """
    if priors.flow is None or not len(betas):
        return
    deviations = sorted(float(np.linalg.norm(beta)) for beta in betas)[len(betas) // 2]
    if deviations > math.sqrt(len(betas[0])) + _UNLIKELY:
        warn_caller(
            f"The fitted shape is {deviations:.0f} standard deviations from the mean of people, "
            "farther than anyone's; check that lengths are in metres, that each point has its own "
            "name or number (joint i is M + i), that the intrinsics belong to pixels of this size, "
            "that init, if given, is near, and that deviations are not stated too small."
        )


def warn_of_mirrored_clip(
    frames: Sequence[Measurements],
    fits: Sequence[Fit],
    priors: Priors,
    refit: Callable[[Measurements], Fit],
) -> bool:
    """Warn as `warn_of_mirroring` of frames of which each has its own fit."""
    chosen = some_of(frames)
    return warn_of_mirroring(
        [frames[k] for k in chosen],
        [fits[k].state.R_camera_root for k in chosen],
        sum(fit.cost for fit in fits),
        sum(fit.measurements for fit in fits),
        priors,
        refit,
    )


def warn_of_mirroring(
    frames: Sequence[Measurements],
    R_camera_root: Sequence[Array],
    cost: float,
    count: int,
    priors: Priors,
    refit: Callable[[Measurements], Fit],
) -> bool:
    """Warn of frames without any usable measurement, or that a body fits far better once an axis is
    flipped or two are exchanged; return whether there was something to tell.

    :param R_camera_root: (3, 3) of each frame, found from a cold start with the default priors.
    :param cost: of `count` measured points.
    :param refit: fits a frame from a cold start with the same priors.
    """
    if frames and not count:
        warn_caller(
            "Nothing that was measured is usable, so that no pose is known; check that numbers are "
            "not NaN, and confidences above 0."
        )
        return True
    cost /= max(1, count)
    is_person = priors.flow is not None  # any other body may lie as well as stand
    in_image = any(frame.keypoints2d is not None for frame in frames)
    in_space = any(_in_space(frame) for frame in frames)
    if in_space:
        is_bad = cost > (_COSTLY_TOGETHER if in_image else _COSTLY_IN_SPACE)
        remedies = _SPACE_REMEDIES[:1]
        if in_image:
            remedies = [*IMAGE_REMEDIES, *_SPACE_REMEDIES, _FLIPPED]
        factor = _FACTOR
    elif not (in_image and is_person):
        return False
    elif _are_upright(R_camera_root):
        is_bad = cost > COSTLY_IN_IMAGE
        remedies = [_FROM_THE_LEFT]
        factor = _FACTOR_FLIPPED
    else:
        is_bad = True
        remedies = [_FROM_THE_TOP, _X_BEFORE_Y]
        factor = _FACTOR_IN_IMAGE
    if not is_bad:
        return False

    def cost_of(change: Change) -> tuple[float, bool]:
        fits = [refit(change(frame)) for frame in frames]
        roots = [fit.state.R_camera_root for fit in fits]
        return sum(fit.cost for fit in fits), _are_upright(roots)

    best = ""
    unflipped: Change = replace  # that is, as it was given
    with _SILENCE, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # each was told of what was given
        least = cost_of(unflipped)[0] / factor
        for remedy, change in remedies:
            changed, are_upright = cost_of(change)
            if changed < least and (in_space or are_upright):
                least = changed
                best = remedy
                unflipped = change
        # A person lying down fits better after turning the image, though nothing is wrong.
        if best and not in_space:
            turned = cost_of(lambda m: _FROM_THE_LEFT[1](unflipped(m)))[0]
            if least > turned / factor:
                best = ""
    if not best:
        return False
    warn_caller(f"A body fits what was measured far better in other axes; {best}.")
    return True


def _in_space(measurements: Measurements) -> bool:
    return measurements.keypoints3d is not None or measurements.orientation_field is not None


def _are_upright(R_camera_root: Sequence[Array]) -> bool:
    """Return whether most people stand upright in the image, whose y is down."""
    return float(np.median([R[1, 1] for R in R_camera_root])) < -_UPRIGHT
