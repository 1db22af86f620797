# SPDX-License-Identifier: GPL-3.0-or-later
"""Separate the root trajectory from a motion and combine them again."""

import numpy as np
from scope.scope_addon.edit import root_motion
from scope.solver.rotations import exp

from .walking import walk


def test_the_path_and_what_is_left_make_the_motion_again():
    clip = walk(3.0)
    turn = np.linspace(0, 7.0, len(clip))  # more than a whole turn
    clip.rotations[:, 0] = exp(turn[:, None] * [0, 0, 1.0]) @ clip.rotations[:, 0]
    positions, angles = root_motion.floor_trajectory(clip)
    assert np.abs(angles[30:-30] - turn[30:-30]).max() < 0.02
    np.testing.assert_array_equal(positions[:, 2], 0.0)
    local = root_motion.relative_to_trajectory(clip, positions, angles)
    assert np.abs(local.root[:, :2]).max() < 1e-12
    assert np.abs(np.diff(angles)).max() < 0.1
    facing = local.rotations[30:-30, 0] @ [0.0, 0.0, 1.0]
    np.testing.assert_allclose(facing, np.broadcast_to([0.0, -1.0, 0.0], facing.shape), atol=0.03)
    again = root_motion.with_trajectory(local, positions, angles)
    np.testing.assert_allclose(again.rotations, clip.rotations, atol=1e-12)
    np.testing.assert_allclose(again.root, clip.root, atol=1e-12)
    assert not root_motion.floor_trajectory(clip, heading=False)[1].any()
