# SPDX-License-Identifier: GPL-3.0-or-later
"""Regions of hands, from known geometry."""

import math

import numpy as np
import pytest
from scope.scope_addon.capture.perception.hand_landmarks import (
    HAND_LENGTH_M,
    HAND_NAMES,
    PALM_INPUT_SIZE,
    _in_image,
    region_from_body,
    region_from_landmarks,
    region_from_palm,
)
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.region import Region


def turned(points, angle, center=(0.0, 0.0), size=1.0):
    """Rotate points (n, 2) clockwise on screen, scale and shift them."""
    c = math.cos(angle)
    s = math.sin(angle)
    return size * np.asarray(points, float) @ np.array([[c, s], [-s, c]]) + center


def flat_hand():
    """Create an upright open hand (21, 2) of length 1, the wrist at 0, y down."""
    hand = np.zeros((len(HAND_NAMES), 2))
    for finger, x in enumerate((-0.3, -0.15, 0.0, 0.12, 0.24)):
        for k, y in enumerate((-0.5, -0.7, -0.85, -1.0)):
            hand[1 + 4 * finger + k] = x, y
    return hand


def arm(elbow, wrist, index, pinky):
    body = np.zeros((len(KEYPOINT_NAMES), 2))
    for name, place in (("elbow", elbow), ("wrist", wrist), ("index", index), ("pinky", pinky)):
        body[KEYPOINT_NAMES.index(f"left_{name}")] = place
    return body


@pytest.mark.parametrize("angle", [0.7, math.pi])
def test_the_body_predicts_the_hand_beyond_the_wrist_in_any_direction_of_the_arm(angle):
    scale = 500.0
    length = HAND_LENGTH_M * scale
    along = turned(
        [[0.0, 3 * length], [0, 0], [-10, -length / 2], [10, -length / 2]], angle, (400, 300)
    )
    region = region_from_body(arm(*along), scale, 0)
    assert region.side_px == pytest.approx(1.5 * length)
    assert math.remainder(region.rotation - angle, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert region.center_px == pytest.approx(
        tuple(turned([[0, -0.45 * length]], angle, (400, 300))[0])
    )
    tips = turned([[0, -length]], angle, (400, 300))
    inside = region.crop_from_image(np.concatenate([tips, along[1:2]]))
    assert ((inside > 0) & (inside < 1)).all()


def test_a_hand_that_points_at_the_camera_is_predicted_at_the_wrist_along_the_forearm():
    region = region_from_body(arm((100, 100), (200, 100), (200, 100), (200, 100)), 500.0, 0)
    assert region.center_px == pytest.approx((200, 100))
    assert region.rotation == pytest.approx(math.pi / 2)


@pytest.mark.parametrize("angle", [1.1, -2.5])
def test_keypoints_predict_the_next_region(angle):
    upright = region_from_landmarks(flat_hand() * 100)
    hand = turned(flat_hand(), angle, (320, 240), 100)
    region = region_from_landmarks(hand)
    assert region.side_px == pytest.approx(upright.side_px)
    assert math.remainder(region.rotation - upright.rotation - angle, 2 * math.pi) == pytest.approx(
        0.0, abs=1e-9
    )
    seen = region.crop_from_image(hand)
    assert np.allclose(seen, upright.crop_from_image(flat_hand() * 100))
    assert (seen > 0).all()
    assert (seen < 1).all()
    assert seen[12, 1] < 0.35 < 0.65 < seen[0, 1]  # the middle finger's tip above, the wrist below


def test_a_palm_gives_the_region_also_in_a_rotated_square():
    points = np.zeros((7, 2))
    points[0] = (96, 120)
    points[2] = (96, 72)
    upright = region_from_palm(np.array([72.0, 72, 120, 120]), points)
    assert upright.side_px == pytest.approx(2.6 * 48)
    assert upright.center_px == pytest.approx((96, 96 - 24))
    where = Region((500.0, 300.0), 384.0, 0.6)
    found = _in_image(np.concatenate([[72, 72, 120, 120], points.ravel()]).astype(float), where)
    assert found.rotation == pytest.approx(0.6)
    assert found.side_px == pytest.approx(upright.side_px * 384 / PALM_INPUT_SIZE)
    assert found.center_px == pytest.approx(
        tuple(where.image_from_crop(np.array([96, 72]) / PALM_INPUT_SIZE))
    )
