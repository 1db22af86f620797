# SPDX-License-Identifier: GPL-3.0-or-later
"""What is kept of a face in one frame, as one row of numbers: an hour of 30 frames a second takes
260 MB.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Float64Array, FloatArray
from ...kinematics.face import EXPRESSIONS
from .face_landmarks import EXPRESSION_POINTS, FACE_POINTS, FaceEstimate

# Landmarks that are kept: the outline of the face, brows, eyes, irises, nose and lips.
CONTOURS = (
    10, 338, 297, 332, 284, 251, 389, 356, 454, 323, 361, 288, 397, 365, 379, 378, 400, 377, 152,
    148, 176, 149, 150,
    136, 172, 58, 132, 93, 234, 127, 162, 21, 54, 103, 67, 109,
    70, 63, 105, 66, 107, 336, 296, 334, 293, 300,
    33, 160, 159, 158, 133, 153, 145, 144, 362, 385, 386, 387, 263, 373, 374, 380, 468, 473,
    168, 6, 195, 4, 98, 2, 327,
    61, 40, 37, 0, 267, 270, 291, 321, 314, 17, 84, 91, 78, 81, 13, 311, 308, 402, 14, 178,
)  # fmt: skip
_WEIGHTS = slice(2, 2 + len(EXPRESSIONS))
_GAZE = slice(_WEIGHTS.stop, _WEIGHTS.stop + 6)
# Landmarks in a row, each with its depth: those, and the ones that expressions are fitted to.
_KEPT = np.unique(CONTOURS + EXPRESSION_POINTS)
_AT_CONTOURS = np.searchsorted(_KEPT, CONTOURS)
_POINTS = slice(_GAZE.stop, _GAZE.stop + 3 * len(_KEPT))
_LIGHT = _POINTS.stop
RECORD = _LIGHT + 1  # numbers in a row
# A face of 16 pixels shows nothing, one of 64 everything; one that is seen from the side shows only
# half.
_FACE_PX = (16.0, 64.0)
_FACING = (0.2, 0.6)  # cosine of the angle between the face's direction and the one to the camera
_SURE_PX = 64.0  # size of a face from which it is large
MAX_NOISE = 8.0  # of a small face, over that of a large one
_SCALE = 1.5  # side of a region over the face's
# Indices of landmarks.
_FOREHEAD = 10
_CHIN = 152
# Inner corner, outer corner and iris of the left and of the right eye.
_EYES = ((362, 263, 473), (133, 33, 468))
_RADIUS = 0.4  # of the eyeball, 12 mm, over the distance of the eye's corners, 30 mm
_LARGEST_SINE = 0.9


def record(estimate: FaceEstimate | None) -> Float64Array:
    """Return the row (RECORD,) of a face; zeros if there is none.

    Its numbers: confidence, size in pixels, weights, gaze, landmarks, and the light around the
    eyes. Weights and gaze stay 0, for `with_expressions` to find.
    """
    row = np.zeros(RECORD)
    if estimate is None:
        return row
    size = estimate.next_region.side_px / _SCALE
    facing = -float(head_axes(estimate.landmarks)[2, 2])
    confidence = estimate.presence * _ramp(size, *_FACE_PX) * _ramp(facing, *_FACING)
    row[0] = max(confidence, 1e-3)
    row[1] = size
    row[_POINTS] = estimate.landmarks[_KEPT].ravel()
    row[_LIGHT] = estimate.eye_light
    return row


def parts(rows: FloatArray) -> tuple[FloatArray, ...]:
    """Split rows (T, RECORD) into confidence (T,), size (T,), weights (T, 52), gaze (T, 2, 3),
    contours (T, n, 2).
    """
    T = len(rows)
    return (
        rows[:, 0],
        rows[:, 1],
        rows[:, _WEIGHTS],
        rows[:, _GAZE].reshape(T, 2, 3),
        rows[:, _POINTS].reshape(T, len(_KEPT), 3)[:, _AT_CONTOURS, :2],
    )


def landmarks_of(rows: FloatArray, numbers: NDArray[np.int64]) -> FloatArray:
    """Return landmarks (T, n, 3) of rows, in pixels, and depth in pixels.

    :param numbers: (n,) of the contours, or of those that the expression network takes.
    """
    return rows[:, _POINTS].reshape(len(rows), len(_KEPT), 3)[:, np.searchsorted(_KEPT, numbers)]


def kept_landmarks(row: FloatArray) -> Float64Array:
    """Return the landmarks (478, 3) of a row (RECORD,), in pixels, and depth in pixels; 0 those
    that are not kept.
    """
    landmarks = np.zeros((FACE_POINTS, 3))
    landmarks[_KEPT] = row[_POINTS].reshape(len(_KEPT), 3)
    return landmarks


def eye_light_of(rows: FloatArray) -> FloatArray:
    """Return the light around the eyes (T,) of rows, see `eye_light`."""
    return rows[:, _LIGHT]


def presence_of(rows: FloatArray) -> FloatArray:
    """Return (T,) the presence of the faces of rows, less where they are seen from the side, but
    not where small.
    """
    of_size = np.maximum(_ramp(rows[:, 1], *_FACE_PX), 1e-3)
    return np.minimum(rows[:, 0] / of_size, 1.0)


def with_expression(
    rows: FloatArray, weights: Float64Array, directions: Float64Array
) -> FloatArray:
    """Return rows (T, RECORD) with other weights (T, 52) and directions of the eyes (T, 2, 3)."""
    out = rows.copy()
    out[:, _WEIGHTS] = weights
    out[:, _GAZE] = directions.reshape(len(rows), -1)
    return out


def with_landmarks_of(rows: FloatArray, others: FloatArray) -> FloatArray:
    """Return rows (T, RECORD) with the landmarks of other rows (T, RECORD)."""
    out = rows.copy()
    out[:, _POINTS] = others[:, _POINTS]
    return out


def noise_of_size(size: FloatArray) -> FloatArray:
    """Return by how much errors of landmarks exceed those of a large face (T,), of faces of a size
    (T,) in pixels: by the inverse of the area.
    """
    return np.clip((_SURE_PX / np.maximum(size, 1.0)) ** 2, 1.0, MAX_NOISE)


def _ramp(value: Any, low: float, high: float) -> Any:
    return np.clip((value - low) / (high - low), 0.0, 1.0)


def head_axes(landmarks: Float64Array) -> Float64Array:
    """Calculate R_camera_head (3, 3), up to the camera's perspective, from landmarks (478, 3) in
    pixels.

    The head's frame: x to the person's left, y up, z out of the face.
    """
    left = landmarks[_EYES[0][1]] - landmarks[_EYES[1][1]]
    up = landmarks[_FOREHEAD] - landmarks[_CHIN]
    x = left / np.linalg.norm(left)
    z = np.cross(x, up)
    z /= np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z], axis=1)


def gaze(landmarks: Float64Array) -> Float64Array:
    """Estimate the unit directions (2, 3) in which the left and the right eye look, in the head's
    frame.

    With the iris at offset (u, v) from the middle of the eye's corners, along the head's x and y
    axes, and the eyeball's radius r: sin(azimuth) = u / r, sin(elevation) = v / r.

    :param landmarks: (478, 3) pixels, and depth in pixels.
    """
    R_camera_head = head_axes(landmarks)
    out = np.empty((2, 3))
    for direction, (inner, outer, iris) in zip(out, _EYES, strict=True):
        corners = landmarks[[inner, outer]]
        radius = _RADIUS * float(np.linalg.norm(corners[0] - corners[1]))
        offset = (landmarks[iris] - corners.mean(axis=0)) @ R_camera_head[:, :2] / max(radius, 1e-9)
        direction[:2] = np.clip(offset, -_LARGEST_SINE, _LARGEST_SINE)
        direction[2] = np.sqrt(max(1.0 - float(direction[:2] @ direction[:2]), 0.05))
        direction /= np.linalg.norm(direction)
    return out
