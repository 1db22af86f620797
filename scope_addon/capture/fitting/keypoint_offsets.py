# SPDX-License-Identifier: GPL-3.0-or-later
"""Keypoint offsets: where the landmark network places each keypoint, relative to where our body
model has it.

    p_placed = R_i (v̄_j + V_j β + d_j) + t_i

On everybody, BlazePose's hips lie 1 cm below and beside the default body's hip joints, and its
ankles 1 cm above the ankle joints. The offsets of other networks are unknown. The d_j minimize the
remaining reprojection errors of fits without offsets, with left and right as mirror images:

    min Σ_people mean_t Σ_j c_jt |Π (R_i(t) d_j) − r_jt|² + 0.3 |d|²

where Π takes the camera's x and y, and r_jt is the distance between keypoint and body in metres.
Estimated from seven people in five clips, none of which accuracy is measured on (`python -m
scope.tools.train_lifter.place_keypoints`), with hip joints 4 cm farther back. That of the hips is
between the place on the body that it had, (7, -16, -39) from today's joints, and the mean over four
clips of three people whose anatomical joints are known, (8, 0, 11): with 0 instead of -12 upwards,
these people are better by 1.2 mm, and Pose2Sim's, whose true hips are keypoints, worse by 1.7 mm.
That of the knees is 7 mm farther forward than estimated: several cameras, which tell how much a
knee is bent, had Pose2Sim's man 6.0° and a man who squats 3.7° too bent, and have them 1.5° and
0.8° straighter. One camera is as before.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....solver import Body
from ...arrays import Float64Array
from ..perception.landmark_network import KEYPOINT_NAMES

# Millimetres in the axes of the rest pose: to the person's left, up, forwards. The right side is
# mirrored.
OFFSETS_MM = {
    "nose": (0, 3, -9),
    "left_eye_inner": (1, -2, -2),
    "left_eye": (-2, -4, -7),
    "left_eye_outer": (-9, -7, -4),
    "left_ear": (-15, -2, 16),
    "mouth_left": (-5, 2, -5),
    "left_shoulder": (-6, 5, 0),
    "left_elbow": (3, 1, 3),
    "left_wrist": (6, -3, 5),
    "left_pinky": (-12, -7, 24),
    "left_index": (-18, -5, -9),
    "left_thumb": (-11, 27, -29),
    "left_hip": (7, -12, 0),
    "left_knee": (1, -5, 0),
    "left_ankle": (0, 11, 7),
    "left_heel": (-7, -1, 4),
    "left_foot_index": (3, 1, -14),
}


def with_keypoint_offsets(body: Body) -> Body:
    """Move BlazePose's keypoints of a body to where the landmark networks place them; joints do not
    move.
    """
    template = body.keypoint_template.copy()
    at = body.keypoint_set("blazepose")
    for name in KEYPOINT_NAMES:
        template[at[name]] += offset(name)
    return replace(body, keypoint_template=template)


def offset(name: str) -> Float64Array:
    """Return the (3,) offset d of a keypoint, metres."""
    if name in OFFSETS_MM:
        return np.array(OFFSETS_MM[name]) / 1000
    return np.array(OFFSETS_MM[name.replace("right", "left")]) * [-1, 1, 1] / 1000
