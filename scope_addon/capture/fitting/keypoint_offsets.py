# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the landmark network sees each keypoint on a body part, beside where our body has it.

    p_seen = R_i (v̄_j + V_j β + d_j) + t_i

What BlazePose calls a hip lies 2 cm below the default body's hip joint, what it calls an ankle 1 cm above, on everybody
alike; other networks are not known to. d_j is what the picture left over, on average, of fits without it, symmetric, by
the least squares

    min Σ_people mean_t Σ_j c_jt |Π (R_i(t) d_j) − r_jt|² + 0.3 |d|²

with Π the camera's x and y, and r_jt the distance in metres between keypoint and body there; seven people of five
clips, none of those that accuracy is measured on (`python -m scope.tools.train_lifter.place_keypoints`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....solver import Body
from ..perception.landmark_network import KEYPOINT_NAMES

# Millimetres in the axes of the rest pose: to the person's left, up, forwards. The right side is the mirror image.
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
    "left_hip": (-2, -20, 4),
    "left_knee": (1, -5, -7),
    "left_ankle": (0, 11, 7),
    "left_heel": (-7, -1, 4),
    "left_foot_index": (3, 1, -14),
}


def with_keypoint_offsets(body: Body) -> Body:
    """The body with BlazePose's keypoints where the landmark networks see them; all else, its joints too, stays."""
    template = body.keypoint_template.copy()
    at = body.keypoint_set("blazepose")
    for name in KEYPOINT_NAMES:
        template[at[name]] += offset(name)
    return replace(body, keypoint_template=template)


def offset(name: str) -> np.ndarray:
    """(3,) d of a keypoint, metres."""
    if name in OFFSETS_MM:
        return np.array(OFFSETS_MM[name]) / 1000
    return np.array(OFFSETS_MM[name.replace("right", "left")]) * [-1, 1, 1] / 1000
