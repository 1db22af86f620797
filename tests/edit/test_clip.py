# SPDX-License-Identifier: GPL-3.0-or-later
"""Sample a clip between its keys and resample it to another rate.

Separate the root trajectory from a motion and combine them again.
"""

import numpy as np
import pytest
from scope.scope_addon.edit.clip import (
    floor_trajectory,
    relative_to_trajectory,
    resample,
    sample,
    with_trajectory,
)
from scope.scope_addon.errors import UsageError
from scope.scope_addon.kinematics.smoothing import interpolate_rotations
from scope.solver.rotations import exp

from .walking import angle, walk


def test_sampling_meets_the_keys_and_goes_along_the_arc_between_them():
    clip = walk(1.0)
    same = sample(clip, clip.times)
    np.testing.assert_allclose(same.rotations, clip.rotations, atol=1e-12)
    a = exp([0, 0, 0.2])
    b = exp([0, 0, 1.0])
    np.testing.assert_allclose(interpolate_rotations(a, b, 0.25), exp([0, 0, 0.4]), atol=1e-12)
    beyond = sample(clip, np.array([-5.0, 99.0]))
    np.testing.assert_allclose(beyond.root, clip.root[[0, -1]])


def test_baking_to_another_rate_keeps_the_motion_and_drops_what_the_rate_cannot_show():
    clip = walk(4.0, rate=60.0)
    baked = resample(clip, 24.0)
    np.testing.assert_allclose(np.diff(baked.times), 1 / 24)
    truth = walk(4.0, rate=24.0)
    assert angle(baked.rotations, truth.rotations[: len(baked)]).max() < np.radians(1.5)
    shaking = walk(4.0, rate=60.0)
    shaking.rotations[:, 3] = exp(
        0.3 * np.cos(2 * np.pi * 29.0 * shaking.times)[:, None] * [1.0, 0, 0]
    )
    assert angle(resample(shaking, 24.0).rotations[2:-2, 3], np.eye(3)).max() < 0.06  # of 0.3
    with pytest.raises(UsageError, match="above zero"):
        resample(clip, 0.0)


def test_the_path_and_what_is_left_make_the_motion_again():
    clip = walk(3.0)
    turn = np.linspace(0, 7.0, len(clip))  # more than a whole turn
    clip.rotations[:, 0] = exp(turn[:, None] * [0, 0, 1.0]) @ clip.rotations[:, 0]
    positions, angles = floor_trajectory(clip)
    assert np.abs(angles[30:-30] - turn[30:-30]).max() < 0.02
    np.testing.assert_array_equal(positions[:, 2], 0.0)
    local = relative_to_trajectory(clip, positions, angles)
    assert np.abs(local.root[:, :2]).max() < 1e-12
    assert np.abs(np.diff(angles)).max() < 0.1
    facing = local.rotations[30:-30, 0] @ [0.0, 0.0, 1.0]
    np.testing.assert_allclose(facing, np.broadcast_to([0.0, -1.0, 0.0], facing.shape), atol=0.03)
    again = with_trajectory(local, positions, angles)
    np.testing.assert_allclose(again.rotations, clip.rotations, atol=1e-12)
    np.testing.assert_allclose(again.root, clip.root, atol=1e-12)
    assert not floor_trajectory(clip, heading=False)[1].any()
