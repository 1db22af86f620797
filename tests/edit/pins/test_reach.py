# SPDX-License-Identifier: GPL-3.0-or-later
"""Pins that a limb cannot reach are met on the way to them, and others where they are."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.edit.pins.pose_refit import PoseRefit
from scope.scope_addon.edit.pins.rays import pixel_of
from scope.scope_addon.edit.pins.reach import SLACK_M, within_reach

from ...made_motion import level_camera
from ..walking import BETAS, BODY, NAMES, walk

WALK = walk(0.2)
AT = WALK.joints(BODY, BETAS)[0]  # (K+1, 3) world
CAMERA = level_camera(1)[0], np.array([[900.0, 0, 320], [0, 900.0, 240], [0, 0, 1]])


@pytest.fixture(scope="module")
def refit() -> PoseRefit:
    return PoseRefit(BODY, BETAS)


def at(name: str) -> np.ndarray:
    return AT[NAMES.index(name)]


def length(*names: str) -> float:
    """Length of the bones between joints of the body at rest, metres."""
    rest = BODY.rest_joints(BETAS)
    ends = [rest[NAMES.index(name)] for name in names]
    return float(sum(np.linalg.norm(b - a) for a, b in zip(ends, ends[1:], strict=False)))


def test_a_pin_within_reach_stays(refit: PoseRefit) -> None:
    target = at("left_wrist") + [0.0, 0.0, 0.02]
    assert within_reach(refit, "left_wrist", target, (AT, {}), None) is target
    pixel = pixel_of(CAMERA, target)
    assert within_reach(refit, "left_wrist", pixel, (AT, {}), CAMERA) is pixel


@pytest.mark.parametrize(
    ("limb", "slack"),
    [
        (("left_shoulder", "left_elbow", "left_wrist"), SLACK_M),
        (("right_hip", "right_knee", "right_ankle"), SLACK_M),
        (("right_hip", "right_knee", "right_ankle"), 0.2),
    ],
)
def test_a_pin_far_away_is_met_by_the_stretched_limb(
    refit: PoseRefit, limb: tuple[str, ...], slack: float
) -> None:
    origin = at(limb[0])
    direction = np.array([0.6, 0.0, -0.8])
    place = within_reach(refit, limb[-1], origin + 3.0 * direction, (AT, {}), None, slack)
    np.testing.assert_allclose(place, origin + (length(*limb) + slack) * direction, atol=1e-9)
    nearly = origin + (length(*limb) + 0.5 * slack) * direction
    assert within_reach(refit, limb[-1], nearly, (AT, {}), None, slack) is nearly


def test_another_pin_of_the_limb_is_where_the_rest_of_it_turns_about(refit: PoseRefit) -> None:
    elbow = at("left_elbow") + [0.1, 0.0, 0.3]
    direction = np.array([0.0, 1.0, 0.0])
    place = within_reach(refit, "left_wrist", elbow + direction, (AT, {"left_elbow": elbow}), None)
    np.testing.assert_allclose(
        place, elbow + (length("left_elbow", "left_wrist") + SLACK_M) * direction, atol=1e-9
    )


def test_a_pixel_is_moved_to_where_the_stretched_limb_is_seen(refit: PoseRefit) -> None:
    origin = at("left_shoulder")
    far = origin + [0.0, 0.0, 2.0]
    pixel = within_reach(refit, "left_wrist", pixel_of(CAMERA, far), (AT, {}), CAMERA)
    eye = CAMERA[0][:3, 3]
    # all that is seen in the pixel
    seen_at = eye + np.linspace(0.5, 1.5, 100_001)[:, None] * (far - eye)
    nearest = seen_at[np.linalg.norm(seen_at - origin, axis=1).argmin()]
    reach = length("left_shoulder", "left_elbow", "left_wrist") + SLACK_M
    met = origin + reach * (nearest - origin) / np.linalg.norm(nearest - origin)
    np.testing.assert_allclose(pixel, pixel_of(CAMERA, met), atol=0.05)


def test_pins_that_move_the_body_are_not_limited(refit: PoseRefit) -> None:
    target = at("pelvis") + [3.0, 0.0, 0.0]
    for joint in ("pelvis", "left_hip"):
        assert within_reach(refit, joint, target, (AT, {}), None) is target


def test_a_pin_of_the_pelvis_in_the_image_keeps_its_depth(refit: PoseRefit) -> None:
    pixel = pixel_of(CAMERA, at("pelvis")) + [0.0, 60.0]
    place = within_reach(refit, "pelvis", pixel, (AT, {}), CAMERA)
    assert place.shape == (3,)
    np.testing.assert_allclose(pixel_of(CAMERA, place), pixel, atol=1e-6)
    axis = CAMERA[0][:3, 2]
    assert (place - at("pelvis")) @ axis == pytest.approx(0.0, abs=1e-9)
    assert place[2] < at("pelvis")[2]
