# SPDX-License-Identifier: GPL-3.0-or-later
"""Regions of the face: the same face, however the body's head and the landmarks are turned and
scaled.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.perception.face_landmarks import (
    FACE_POINTS,
    region_from_body,
    region_from_landmarks,
)
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES

# A frontal head, metres from the middle of the eyes, y down; the person's left is to the right.
HEAD = {
    "nose": (0, 0.035), "left_eye": (0.0315, 0), "right_eye": (-0.0315, 0),
    "left_ear": (0.075, 0.02),
    "right_ear": (-0.075, 0.02), "mouth_left": (0.025, 0.068), "mouth_right": (-0.025, 0.068),
}  # fmt: skip


def keypoints(scale: float, angle: float) -> np.ndarray:
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    out = np.zeros((33, 2))
    for name, point in HEAD.items():
        out[KEYPOINT_NAMES.index(name)] = scale * R @ point + [300, 200]
    return out


@pytest.mark.parametrize("angle", [0.0, 0.6, -1.2, 3.0])
def test_the_body_predicts_a_face_whichever_way_up_it_is(angle):
    region = region_from_body(keypoints(500.0, angle))
    assert region.side_px == pytest.approx(1.5 * 0.185 * 500, rel=0.02)
    assert np.angle(np.exp(1j * (region.rotation - angle))) == pytest.approx(0, abs=0.02)
    x, y = region.crop_from_image(np.array([300.0, 200.0]))
    assert x == pytest.approx(0.5)
    assert 0.3 < y < 0.5  # the eyes are above the middle


def test_a_head_in_profile_keeps_its_size():
    frontal = keypoints(500.0, 0.0)
    profile = keypoints(500.0, 0.0)
    profile[:11, 0] = 300  # turned by 90°, eyes and ears fall together
    assert region_from_body(profile).side_px == pytest.approx(
        region_from_body(frontal).side_px, rel=0.02
    )


def test_the_landmarks_box_fills_two_thirds_along_the_line_of_the_eyes():
    points = np.random.default_rng(1).uniform(-1, 1, (FACE_POINTS, 2)) * [30, 40]
    points[[33, 263]] = [[-20, -10], [20, -10]]
    points[:2] = [[-30, -40], [30, 40]]
    c = np.cos(0.5)
    s = np.sin(0.5)
    region = region_from_landmarks(points @ np.array([[c, s], [-s, c]]) + [100, 50])
    assert region.center_px == pytest.approx((100, 50))
    assert region.side_px == pytest.approx(1.5 * 80)
    assert region.rotation == pytest.approx(0.5)
