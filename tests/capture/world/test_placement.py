# SPDX-License-Identifier: GPL-3.0-or-later
"""Contacts of a standing body.

The raw motion as it is kept: the fit's rotations, in a third of their memory.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.world.camera_path import CameraPath
from scope.scope_addon.capture.world.placement import PlacedTrack, RawMotion
from scope.scope_addon.kinematics.contact_points import contact_point_positions, with_contact_points
from scope.solver.body_file import load_body
from scope.solver.rotations import exp

from .clip.waving_person import FRAMES, person

UP = np.array([0.0, -1.0, 0.0])  # OpenCV's axes, a level camera


def stands(times):
    """The body in rest pose, 4 m in front of a static camera."""
    body = load_body("scope")
    T = len(times)
    supported = with_contact_points(body, np.zeros(body.P))
    rotations = np.tile(np.eye(3), (T, body.K + 1, 1, 1))
    rotations[:, 0] = exp([np.pi, 0.0, 0.0])
    R, joints = supported.forward_kinematics(rotations, np.tile([0.0, 0.0, 4.0], (T, 1)))
    contact_points = contact_point_positions(supported, R, joints)
    every = np.ones(T, bool)
    return PlacedTrack(
        supported,
        np.zeros(body.P),
        times,
        every,
        rotations,
        joints[:, 0],
        joints,
        contact_points,
        np.ones((T, 6)),
        np.zeros((T, 3)),
    )


@pytest.mark.parametrize("step_s", [1 / 240, 1 / 30, 1.0, 30.03 / 30, 5.0])
def test_a_standing_body_is_in_contact_at_any_frame_rate(step_s):
    contact = stands(np.arange(8) * step_s).contact(UP)
    assert contact[:, :4].min() > 0.9
    assert contact[:, 4:].max() < 0.01  # hands


@pytest.mark.parametrize("frames", [1, 4])
def test_contacts_end_at_scene_cuts(frames):
    times = np.arange(2 * frames) / 30 + np.repeat([0.0, 10.0], frames)
    contact = stands(times).contact(UP)
    assert contact[frames].max() == 0.0
    assert np.delete(contact, frames, axis=0)[:, :4].min() > 0.9


def test_it_has_the_rotations_of_the_fit_in_the_first_frames_axes_without_gaps():
    angle = 0.1 * np.sin(np.arange(FRAMES) / 5.0)
    path = CameraPath(
        exp(angle[:, None] * [0.0, 1.0, 0.0]), np.outer(np.arange(FRAMES), [0.02, 0.0, 0.01])
    )
    track, true = person(path=path)
    seen = path.to_frames(true)
    lost = replace(seen, valid=np.arange(FRAMES) != 7, rotations=seen.rotations.copy())
    lost.rotations[7] = lost.rotations[6]
    raw = RawMotion.of(track, lost, path)
    found = np.concatenate([raw.R_first_root[:, None], exp(raw.joints)], axis=1)
    np.testing.assert_allclose(found, true.rotations, atol=0.02)  # the gap is filled along an arc
    np.testing.assert_allclose(raw.t_first_root, true.t_camera_root, atol=1e-3)
