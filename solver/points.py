# SPDX-License-Identifier: Apache-2.0
"""Points of a body by name, and clips as arrays: both become what fits take, numbers and one
`Measurements` for each frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .arrays import has_axis
from .body import number_of, numbers_of
from .errors import InvalidValueError, ShapeError
from .measurements import Measurements
from .part import Array
from .validation import check_list, check_type

# Of each kind of measurement, what holds numbers of points, as messages call it.
_NUMBERED = {
    "keypoints2d": {"indices": "Indices of 2D keypoints"},
    "keypoints3d": {"indices": "Indices of 3D keypoints"},
    "orientation_field": {
        "starts": "Starts of the orientation field",
        "ends": "Ends of the orientation field",
    },
    "foot_contacts": {"indices": "Indices of foot contacts"},
    "floor": {"indices": "Indices of the floor's points"},
}
# Of each kind that may be given for a whole clip, the axes of one frame's arrays.
_OF_A_FRAME = {
    "keypoints2d": {"pixels": 2, "confidence": 1, "sigma_px": 1},
    "keypoints3d": {"points": 2, "confidence": 1, "sigma_m": 1},
    "orientation_field": {"directions": 2, "confidence": 1},
}


def numbered(body: object, measurements: Measurements) -> Measurements:
    """Return measurements in which all points are numbers; the same ones if they are already.

    :raises InvalidValueError: the body has no point or part of a name.
    """
    changed = {}
    for field, words in _NUMBERED.items():
        kind = getattr(measurements, field)
        named = () if kind is None else [key for key in words if has_names(getattr(kind, key))]
        if named:
            numbers = numbers_of(body)
            found = {key: with_numbers(numbers, getattr(kind, key), words[key]) for key in named}
            changed[field] = replace(kind, **found)
    priors = measurements.pose_priors
    if priors is not None and has_names(priors.parts):
        parts = {name: i for i, name in enumerate(getattr(body, "joint_names", ()))}
        own = with_numbers(parts, priors.parts, "Parts of pose priors")
        changed["pose_priors"] = replace(priors, parts=own)
    return replace(measurements, **changed) if changed else measurements


def has_names(points: Any) -> bool:
    """Return whether one of a list of points is a name."""
    if isinstance(points, np.ndarray) and points.dtype.kind not in "UO":
        return False
    return isinstance(points, (list, tuple, np.ndarray)) and any(
        isinstance(point, str) for point in points
    )


def with_numbers(numbers: Mapping[str, int], points: Any, what: str) -> Array:
    """Return the numbers (n,) of points of which some are names.

    :param what: what the points are, as a message begins.
    :raises InvalidValueError: there is no point of a name.
    """
    try:
        found = [number_of(numbers, point) if isinstance(point, str) else point for point in points]
    except InvalidValueError as error:
        raise InvalidValueError(f"{what}: {error}") from None
    return np.array(found)


def frames_of(
    body: object,
    measurements: Measurements | Sequence[Measurements],
    name: str = "measurements",
) -> Sequence[Measurements]:
    """Return the measurements of each frame, with points as numbers.

    :param measurements: a list with an entry for each frame; or those of a clip, whose pixels
        (T, n, 2), points (T, n, 3) or directions (T, n, 3) have an axis for the frames. Confidences
        and deviations may have one too, (T, n). What has none holds in every frame.
    :param name: of the argument, for messages.
    :raises ShapeError: the arrays of a clip have different numbers of frames.
    :raises InvalidValueError: the body has no point of a name, or the measurements are of one
        frame.
    """
    if not isinstance(measurements, Measurements):
        check_list(measurements, name, "frame")
        for k, m in enumerate(measurements):
            check_type(m, Measurements, f"{name}[{k}]")
        return [numbered(body, m) for m in measurements]
    clip = numbered(body, measurements)
    lengths = {
        f"{key} of {field}": len(value)
        for field, axes in _OF_A_FRAME.items()
        for key, value in _by_frame(getattr(clip, field), axes).items()
    }
    if not lengths:
        raise InvalidValueError(
            f"{name} must be a list with an entry for each frame, but is a Measurements of one "
            "frame; those of a clip have pixels (T, n, 2) or points (T, n, 3)."
        )
    if len(set(lengths.values())) > 1:
        found = ", ".join(f"{name} have {count}" for name, count in lengths.items())
        raise ShapeError(f"A clip's arrays must have the same number of frames, but {found}.")
    frames = []
    for f in range(next(iter(lengths.values()))):
        changed = {}
        for field, axes in _OF_A_FRAME.items():
            kind = getattr(clip, field)
            rows = {key: value[f] for key, value in _by_frame(kind, axes).items()}
            if rows:
                changed[field] = replace(kind, **rows)
        frames.append(replace(clip, **changed))
    return frames


def _by_frame(kind: Any, axes: Mapping[str, int]) -> dict[str, Array]:
    """Return the arrays of a kind of measurement that have an axis for the frames."""
    found = {}
    for key, count in axes.items():
        value = getattr(kind, key, None)
        if value is not None and has_axis(value, count) and not has_axis(value, count + 1):
            found[key] = value if isinstance(value, np.ma.MaskedArray) else np.asarray(value)
    return found
