# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose feet stand, on a body that does."""

import numpy as np
import pytest
from scope.scope_addon.capture.placement import PlacedTrack
from scope.scope_addon.capture.soles import sole_points, with_soles
from scope.solver.body import load_body
from scope.solver.rotations import exp

UP = np.array([0.0, -1.0, 0.0])  # OpenCV's axes, a level camera


def stands(times):
    """The body at rest, 4 m before a camera on a stand."""
    body, T = load_body("scope"), len(times)
    soled = with_soles(body, np.zeros(body.P))
    rotations = np.tile(np.eye(3), (T, body.K + 1, 1, 1))
    rotations[:, 0] = exp([np.pi, 0.0, 0.0])
    R, joints = soled.forward_kinematics(rotations, np.tile([0.0, 0.0, 4.0], (T, 1)))
    soles, every = sole_points(soled, R, joints), np.ones(T, bool)
    return PlacedTrack(
        soled, np.zeros(body.P), times, every, rotations, joints[:, 0], joints, soles, np.ones((T, 4)),
        np.zeros((T, 3)),
    )  # fmt: skip


@pytest.mark.parametrize("step_s", [1 / 240, 1 / 30, 1.0, 30.03 / 30, 5.0])
def test_who_stands_does_so_at_any_frame_rate(step_s):
    assert stands(np.arange(8) * step_s).contact(UP).min() > 0.9


@pytest.mark.parametrize("frames", [1, 4])
def test_nothing_stands_from_one_scene_into_the_next(frames):
    times = np.arange(2 * frames) / 30 + np.repeat([0.0, 10.0], frames)
    contact = stands(times).contact(UP)
    assert contact[frames].max() == 0.0
    assert np.delete(contact, frames, axis=0).min() > 0.9
