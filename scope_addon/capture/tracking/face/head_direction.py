# SPDX-License-Identifier: GPL-3.0-or-later
"""The direction across the head, from the face's landmarks: they show how it turns and leans to the
side best.

With the rotation vector v of the landmarks against the reference face (`aligned`), in the axes of a
camera that looks at the face, and Y from y up to y down, the direction from the right to the left
ear is

    d = R_camera_virtual Y exp(v) exp(c) (1, 0, 0)

c: from the reference's axes to the head's. How far the head nods stays with the body's keypoints:
of somebody whom the network has not seen before, it is off by 4 degrees, and by more where the
focal length is wrong.
"""

from __future__ import annotations

import numpy as np

from .....solver.rotations import exp
from ....arrays import Float64Array, FloatArray
from ...camera.intrinsics import Camera
from ...perception.face_record import landmarks_of, parts, presence_of
from ...perception.lifter import camera_towards
from .expression_fit import aligned, load_response

# Mean rotation vector from the reference's axes to the default body's head, over the hundred people
# of the set `poses`.
_HEAD_FROM_REFERENCE = np.radians([5.3, -0.4, 0.7])
_Y_DOWN = np.diag([1.0, -1.0, -1.0])
# Cosine of the angle between face and ears from which a face counts for nothing, and to which it
# counts in full: at the back of a head, the network may see a face that looks the other way.
_CONTRADICTED = np.cos(np.radians(60.0))
_AGREED = np.cos(np.radians(30.0))


def across_head(face: FloatArray, camera: Camera) -> Float64Array:
    """Return the unit vectors d (T, 3) of the module's equation, in camera axes; zeros where no
    face was seen.

    :param face: (T, RECORD) see `face_record`.
    :raises ModelFileError: the response of the landmarks, which has the reference face, is missing
        or damaged.
    """
    directions = np.zeros((len(face), 3))
    seen = face[:, 0] > 0
    if not seen.any():
        return directions
    response = load_response()
    landmarks = landmarks_of(face[seen], response.landmarks).astype(float)
    landmarks[..., :2] = camera.undistort(landmarks[..., :2])
    turns = aligned(landmarks, response.reference, response.shares).turns
    z = np.concatenate([landmarks[..., :2].mean(axis=1), np.ones((len(turns), 1))], axis=1)
    z = z @ np.linalg.inv(camera.intrinsics).T
    R_camera_virtual = np.swapaxes(camera_towards(z[:, :2]), 1, 2)
    directions[seen] = (R_camera_virtual @ _Y_DOWN @ exp(turns) @ exp(_HEAD_FROM_REFERENCE))[..., 0]
    return directions


def certainty(face: FloatArray, directions: Float64Array, ears: FloatArray) -> Float64Array:
    """Return how much each direction counts (T,), 1 of a large face that is surely there, 0 where
    there is none.

    A face counts by its size, and by the cube of its presence, since landmarks of blurred and
    hidden faces jump.

    :param face: (T, RECORD) see `face_record`.
    :param directions: (T, 3) of `across_head`.
    :param ears: (T, 3) from the right to the left ear by the body's keypoints, camera axes.
    """
    cosine = (ears * directions).sum(axis=1) / np.maximum(np.linalg.norm(ears, axis=1), 1e-9)
    agreed = np.clip((cosine - _CONTRADICTED) / (_AGREED - _CONTRADICTED), 0.0, 1.0)
    out: Float64Array = agreed * parts(face)[0] * presence_of(face) ** 2
    return out
