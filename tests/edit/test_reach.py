# SPDX-License-Identifier: GPL-3.0-or-later
"""Pins that a limb cannot reach are met on the way to them, and others where they are.

Points that project to a pixel, as far away as another point is.

Interpolating what is known at a few keys, and fading it out.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.edit.pose_refit import (
    SLACK_M,
    PoseRefit,
    nearest_on_ray,
    pixel_of,
    point_at_depth,
    within_reach,
)
from scope.scope_addon.edit.spans import faded

from ..made_motion import level_camera
from .walking import BETAS, BODY, NAMES, walk

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


def test_a_ray_that_does_not_meet_the_plane_has_its_nearest_point():
    pitch = np.radians(44.0)
    c = np.cos(pitch)
    s = np.sin(pitch)
    T = np.eye(4)
    T[:3, :3] = np.stack([[1.0, 0, 0], [0, -s, -c], [0, c, -s]], axis=1)
    camera = T, CAMERA[1]
    # more than 90 degrees from level
    below = np.array([320.0, 240.0 + 900.0 * np.tan(np.radians(50.0))])
    point = np.array([0.2, 3.0, -0.1])
    place = point_at_depth(camera, below, point)
    np.testing.assert_allclose(place, nearest_on_ray(camera, below, point))
    assert np.isfinite(place).all()


TIMES = np.arange(0, 4, 0.001)


@pytest.mark.parametrize("known", [[1.0], [1.0, 2.0, 2.4]])
def test_it_meets_what_is_known_and_starts_and_ends_at_rest(known):
    known = np.array(known)
    values = np.array([[1.0, -2.0], [3.0, 0.5], [2.0, 2.0]])[: len(known)]
    reach = np.full(len(known), 0.4)
    curve = faded(TIMES, known, values, reach)
    np.testing.assert_allclose(faded(known, known, values, reach), values, atol=1e-12)
    outside = (TIMES < known[0] - 0.4) | (TIMES > known[-1] + 0.4)
    assert (curve[outside] == 0).all()
    speed = np.diff(curve, axis=0) / 0.001
    # no jump: a broken line would have one of 5 per second
    assert np.abs(np.diff(speed, axis=0)).max() < 0.2
    assert curve.max() <= values.max() + 1e-12
    assert curve.min() >= min(values.min(), 0) - 1e-12


def test_far_apart_it_fades_out_in_between():
    curve = faded(TIMES, np.array([1.0, 3.0]), np.array([1.0, 1.0]), np.array([0.4, 0.4]))
    assert (curve[(TIMES > 1.4) & (TIMES < 2.6)] == 0).all()
