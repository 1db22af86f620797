# SPDX-License-Identifier: Apache-2.0
"""What was measured in one frame. Camera frame: OpenCV's (x right, y down, z forward), metres;
image in pixels.

Points are numbered as in the body's keypoints, 0..M-1, followed by the joints: M + i is the origin
of part i. Instead of its number, a point may have its name on the body: "coco/nose" or
"left_wrist". Parts of pose priors may have the names of their joints. A confidence multiplies the
squared residual; zero, or a value that is not finite or beyond `LARGEST`, leaves the measurement
out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from .arrays import as_array, as_numbers, described, has_axis
from .errors import InvalidValueError, ShapeError
from .kernel import kernel
from .part import Array
from .residuals import floor, foot_contact, pose_prior
from .validation import (
    as_indices,
    as_number,
    check_intrinsics,
    check_not_negative,
    check_robust,
    check_rotations,
    check_type,
    warn_of_deviations,
    warn_of_distance,
    warn_of_floor,
    warn_of_one_confidence,
    warn_of_percentages,
    warn_of_pixels,
    warn_of_points,
    warn_of_repeated,
)

# No length, coordinate or confidence is as large. What the solver multiplies of smaller ones stays
# finite; one pixel whose square does not would else make the cost of a whole clip infinite.
LARGEST = 1e30
# Standard deviations that the default weights stand for: of 2D keypoints in normalized image
# coordinates, a pixel at a focal length of 1000, and of 3D keypoints in metres.
SIGMA_2D = 1e-3
SIGMA_3D = 1e-2
# in normalized image coordinates, of any detector or marker: a hundredth of a pixel, and 300
_LEAST_SIGMA_2D = 1e-5
_MOST_SIGMA_2D = 0.3


@kernel
def _normalize(K: Array, pixels: Array, confidence: Array, out: Array) -> None:
    """Write normalized image coordinates and confidence."""
    for k in range(out.shape[0]):
        v = (pixels[k, 1] - K[1, 2]) / K[1, 1]
        out[k, 0] = (pixels[k, 0] - K[0, 2] - K[0, 1] * v) / K[0, 0]
        out[k, 1] = v
        out[k, 2] = confidence[k]


@dataclass
class Keypoints2D:
    """Points in the image: indices (n,), pixels (n, 2) without lens distortion, confidence (n,) or
    one for all.

    sigma_px: standard deviation of a point of confidence 1 in pixels, one for all or (n,); without
    one, a pixel at a focal length of 1000 pixels, where most detectors are off by some 4. Its
    weight is then 1/sigma^2, times `Weights.keypoints2d` over its default. A row with NaN, or
    without a positive confidence, is left out, as of 3D keypoints and directions.

    Cameras have no distortion coefficients: undistort pixels first, for instance with OpenCV's
    undistortPoints(pixels, K, dist, P=K).
    """

    indices: ArrayLike
    pixels: ArrayLike
    confidence: ArrayLike = 1.0
    sigma_px: ArrayLike | None = None


@dataclass
class Keypoints3D:
    """Points in space: indices (n,), points (n, 3) in metres in the camera frame, confidence (n,)
    or one for all.

    sigma_m: standard deviation of each coordinate of a point of confidence 1 in metres, one for all
    or (n,). Its weight is then 1/sigma^2, times `Weights.keypoints3d` over its default.
    """

    indices: ArrayLike
    points: ArrayLike
    confidence: ArrayLike = 1.0
    sigma_m: ArrayLike | None = None


@dataclass
class OrientationField:
    """Directions between points of one part: starts (n,), ends (n,), directions (n, 3), confidence
    (n,).

    A bone is the direction from a joint M + par(i) to its child M + i. Directions are in the camera
    frame and need not be normalized. The confidence is (n,) or one for all.
    """

    starts: ArrayLike
    ends: ArrayLike
    directions: ArrayLike
    confidence: ArrayLike = 1.0


@dataclass
class PosePriors:
    """Known estimates of part poses in the camera frame: parts (n,), R (n, 3, 3), t (n, 3) in
    metres, weights (n,) per radian^2 and per metre^2.

    A row without a positive weight is left out.
    """

    parts: ArrayLike
    R_camera_part: ArrayLike
    t_camera_part: ArrayLike
    weight_rotation: ArrayLike
    weight_translation: ArrayLike


@dataclass
class FootContacts:
    """Points that stand still: indices (n,), where (n, 3), in metres in this frame's camera, and
    probability (n,).
    """

    indices: ArrayLike
    points: ArrayLike
    probability: ArrayLike


@dataclass
class Floor:
    """The plane normal^T p = offset in this frame's camera, and points that touch it or may not be
    below it.

    indices (n,), normal (3,), a unit vector pointing up, offset in metres, contact (n,): the
    probability of touching the floor, 0 where a point is free to be above; below (n,): the weight
    of a point that is below, one for all if None, 0 where a point is free to be there, as on a
    stair. With normal (n, 3) and offset (n,), each point has a plane of its own, such as the
    tangent plane of a surface that it may not enter.
    """

    indices: ArrayLike
    normal: ArrayLike
    offset: ArrayLike
    contact: ArrayLike
    below: ArrayLike | None = None


@dataclass
class Measurements:
    """Everything measured in one frame. `intrinsics` (3, 3) is needed with 2D keypoints.

    `tables` holds (ints, floats), int64 (n, columns) and float64 (n, columns), of further
    registered residuals by name; see residuals/registry.py. Residuals that have a field of their
    own are given there alone.
    """

    intrinsics: ArrayLike | None = None
    keypoints2d: Keypoints2D | None = None
    keypoints3d: Keypoints3D | None = None
    orientation_field: OrientationField | None = None
    pose_priors: PosePriors | None = None
    foot_contacts: FootContacts | None = None
    floor: Floor | None = None
    tables: Mapping[str, tuple[Array, Array]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check what kinds of measurements the fields hold; their arrays are checked against the
        body by a fit.

        :raises InvalidValueError: a field holds another type, or `tables` holds a residual that has
            its own field.
        """
        for name, kind in _KINDS.items():
            value = getattr(self, name)
            if value is not None and not isinstance(value, kind):
                check_type(value, (kind, type(None)), f"Measurements.{name}")
        if isinstance(self.intrinsics, tuple(_KINDS.values())):
            raise InvalidValueError(
                "Measurements.intrinsics must be a camera matrix (3, 3), but is "
                f"{described(self.intrinsics)}; name the other fields, as in keypoints3d=seen."
            )
        for name in self.tables or ():
            if name in _FIELDS:
                raise InvalidValueError(
                    f"Measurements.tables must not hold {name!r}, which has a field of its own; "
                    f"give it as Measurements.{_FIELDS[name]}."
                )

    def packed2d(self, points: int) -> tuple[Array, Array]:
        """Return indices (n,) and (n, 3) of normalized image coordinates and confidence.

        :param points: how many points the body has, joints included.
        :raises ShapeError: an array has another shape, or an index lies outside.
        :raises InvalidValueError: the intrinsics are not a camera matrix.
        """
        m = self.keypoints2d
        if m is None:
            return np.zeros(0, np.int64), np.zeros((0, 3))
        indices = as_indices(m.indices, points, "Indices of 2D keypoints")
        n = len(indices)
        pixels = as_array(m.pixels, (n, 2), "Pixels of 2D keypoints, without confidence,")
        if self.intrinsics is None:
            raise ShapeError(
                "2D keypoints need the camera's intrinsics, shape (3, 3), but got None."
            )
        K = as_array(self.intrinsics, (3, 3), "Intrinsics")
        check_intrinsics(K)
        confidence = as_confidence(m.confidence, n, "2D keypoints")
        out = np.empty((n, 3))
        _normalize(K, pixels, confidence, out)
        warn_of_pixels(K, pixels, out)
        warn_of_repeated(indices, out, "2D keypoints")
        if m.sigma_px is None:
            warn_of_one_confidence(m.confidence, out, "Confidence of 2D keypoints", "sigma_px")
        else:
            sigma_px = _sigmas(m.sigma_px, n, "sigma_px of 2D keypoints")
            least = _LEAST_SIGMA_2D * K[0, 0]
            most = _MOST_SIGMA_2D * K[0, 0]
            warn_of_deviations(sigma_px, least, most, "sigma_px of 2D keypoints", "pixels")
            out[:, 2] *= SIGMA_2D**2 * K[0, 0] * K[1, 1] / sigma_px**2
        return indices, out

    def packed3d(self, points: int) -> tuple[Array, Array]:
        """Return indices (n,) and (n, 4) of positions and confidence.

        :param points: how many points the body has, joints included.
        :raises ShapeError: an array has another shape, or an index lies outside.
        :raises InvalidValueError: a confidence or standard deviation cannot be used.
        """
        m = self.keypoints3d
        if m is None:
            return np.zeros(0, np.int64), np.zeros((0, 4))
        indices = as_indices(m.indices, points, "Indices of 3D keypoints")
        name = "Points of 3D keypoints, without confidence,"
        points_3d = as_array(m.points, (len(indices), 3), name)
        out = np.empty((len(indices), 4))
        out[:, :3] = points_3d
        out[:, 3] = as_confidence(m.confidence, len(indices), "3D keypoints")
        warn_of_points(
            out, has_camera=self.intrinsics is not None, are_weights=m.sigma_m is not None
        )
        warn_of_repeated(indices, out, "3D keypoints")
        if m.sigma_m is None:
            warn_of_one_confidence(m.confidence, out, "Confidence of 3D keypoints", "sigma_m")
        else:
            sigma_m = _sigmas(m.sigma_m, len(indices), "sigma_m of 3D keypoints")
            warn_of_deviations(sigma_m, 0.0, 1.0, "sigma_m of 3D keypoints", "metres")
            out[:, 3] *= (SIGMA_3D / sigma_m) ** 2
        return indices, out

    def packed_directions(self, points: int) -> tuple[Array, Array, Array]:
        """Return starts (n,), ends (n,) and (n, 4) of directions and confidence.

        :param points: how many points the body has, joints included.
        :raises ShapeError: an array has another shape, or an index lies outside.
        :raises InvalidValueError: a confidence or standard deviation cannot be used.
        """
        m = self.orientation_field
        if m is None:
            return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 4))
        starts = as_indices(m.starts, points, "Starts of the orientation field")
        n = len(starts)
        ends = as_indices(m.ends, points, "Ends of the orientation field")
        if len(ends) != n:
            raise ShapeError(
                f"Ends of the orientation field must have shape ({n},), but got shape {ends.shape}."
            )
        out = np.empty((n, 4))
        out[:, :3] = as_array(m.directions, (n, 3), "Directions of the orientation field")
        out[:, 3] = as_confidence(m.confidence, n, "the orientation field")
        return starts, ends, out

    def packed_tables(self, K: int, points: int) -> dict[str, tuple[Array, Array]]:
        """Return the tables of the residuals that have their own field; rows that are not usable
        are left out.

        :param K: how many joints the body has without the root.
        :param points: how many points it has, joints included.
        :raises ShapeError: an array has another shape, or an index lies outside.
        :raises InvalidValueError: a weight is negative, a matrix is not a rotation, or the floor is
            not a plane.
        """
        tables = {}
        if self.pose_priors is not None:
            tables["pose_prior"] = _pose_prior_rows(self.pose_priors, K)
        if self.foot_contacts is not None:
            tables["foot_contact"] = _foot_contact_rows(self.foot_contacts, points)
        if self.floor is not None:
            tables["floor"] = _floor_rows(self.floor, points)
            if not has_axis(self.floor.normal, 1):
                seen = np.zeros((0, 3))
                if self.keypoints3d is not None:
                    seen = np.asarray(self.keypoints3d.points, dtype=float)
                    confidence = self.keypoints3d.confidence
                    seen = seen[as_confidence(confidence, len(seen), "3D keypoints") > 0.0]
                normal = np.asarray(self.floor.normal, dtype=float)
                offset = as_number(self.floor.offset, "Offset of the floor")
                has_camera = self.intrinsics is not None
                warn_of_floor(normal, offset, seen, has_camera)
        return tables


_KINDS = {
    "keypoints2d": Keypoints2D,
    "keypoints3d": Keypoints3D,
    "orientation_field": OrientationField,
    "pose_priors": PosePriors,
    "foot_contacts": FootContacts,
    "floor": Floor,
    "tables": Mapping,
}


def as_confidence(value: ArrayLike, n: int, of: str) -> Array:
    """Return confidences (n,).

    :param of: what they belong to, for messages.
    :raises ShapeError: they are neither one number nor (n,).
    """
    if isinstance(value, (int, float)):
        return np.full(n, as_number(value, f"Confidence of {of}"))
    if isinstance(value, (np.ndarray, np.number)) and value.ndim == 0:
        return np.full(n, as_numbers(value, f"Confidence of {of}"))
    return as_array(value, (n,), f"Confidence of {of}")


def _sigmas(value: ArrayLike, n: int, name: str) -> Array:
    """Return standard deviations (n,).

    :raises ShapeError: they are neither one number nor (n,).
    :raises InvalidValueError: one is not positive.
    """
    if not has_axis(value):
        check_robust(value, name)
        return np.full(n, float(np.asarray(value)))
    sigmas = as_array(value, (n,), name)
    if not (sigmas > 0.0).all():
        raise InvalidValueError(f"{name} must be positive, but hold {sigmas.min():g}.")
    return sigmas


# Residuals that have a field of their own.
_FIELDS = {"pose_prior": "pose_priors", "foot_contact": "foot_contacts", "floor": "floor"}


def _pose_prior_rows(m: PosePriors, K: int) -> tuple[Array, Array]:
    parts = as_indices(m.parts, K + 1, "Parts of pose priors")
    n = len(parts)
    R = as_array(m.R_camera_part, (n, 3, 3), "Rotations of pose priors")
    t = as_array(m.t_camera_part, (n, 3), "Positions of pose priors")
    w_R = as_array(m.weight_rotation, (n,), "Rotation weights of pose priors")
    w_t = as_array(m.weight_translation, (n,), "Translation weights of pose priors")
    check_not_negative(w_R, "Rotation weights of pose priors")
    check_not_negative(w_t, "Translation weights of pose priors")
    check_rotations(R, "Rotations of pose priors", w_R)
    warn_of_distance(t[w_t > 0.0], "Positions of pose priors lie")
    ints, floats = pose_prior.pack(parts, R, t, w_R, w_t)
    weigh = (w_R > 0.0) | (w_t > 0.0)
    return _usable_rows((ints[weigh], floats[weigh]))


def _foot_contact_rows(m: FootContacts, points: int) -> tuple[Array, Array]:
    indices = as_indices(m.indices, points, "Indices of foot contacts")
    n = len(indices)
    stand = as_array(m.points, (n, 3), "Points of foot contacts")
    warn_of_distance(stand, "Points of foot contacts lie")
    weight = as_array(m.probability, (n,), "Probability of foot contacts")
    check_not_negative(weight, "Probability of foot contacts")
    warn_of_percentages(weight, "Probability of foot contacts")
    return _usable_rows(foot_contact.pack(indices, stand, weight))


def _floor_rows(m: Floor, points: int) -> tuple[Array, Array]:
    indices = as_indices(m.indices, points, "Indices of the floor's points")
    planes = (len(indices),) if has_axis(m.normal, 1) else ()
    normal = as_array(m.normal, (*planes, 3), "Normal of the floor")
    contact = as_array(m.contact, (len(indices),), "Contact with the floor")
    below = np.ones(len(indices)) if m.below is None else m.below
    below = as_array(below, (len(indices),), "Weights below the floor")
    check_not_negative(below, "Weights below the floor")
    check_not_negative(contact, "Contact with the floor")
    warn_of_percentages(contact, "Contact with the floor")
    name = "Offset of the floor"
    offset = as_array(m.offset, planes, name) if planes else np.asarray(as_number(m.offset, name))
    lengths = np.linalg.norm(normal, axis=-1)
    wrong = ~(np.isfinite(offset) & (np.abs(lengths - 1.0) < 1e-6))
    if wrong.any():
        first = np.flatnonzero(wrong)[0]
        raise InvalidValueError(
            "The floor needs a finite offset and a normal of length 1, but got offset "
            f"{offset.flat[first]} and a "
            f"normal of length {lengths.flat[first]:.6g}; divide both by that length."
        )
    return _usable_rows(floor.pack(indices, normal, offset, below, contact))


def _usable_rows(table: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the rows of a residual's table in which everything is a number below `LARGEST`."""
    ints, floats = table
    keep = (np.abs(floats) < LARGEST).all(axis=1)
    return ints[keep], floats[keep]
