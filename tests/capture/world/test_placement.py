# SPDX-License-Identifier: GPL-3.0-or-later
"""Contacts of a standing body.

The raw motion as it is kept: the fit's rotations, in a third of their memory.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.world.placement import RawMotion
from scope.solver.rotations import exp

from .clip.waving_person import FRAMES, moving_path, person
from .placed_people import UP, stands_at


def contact_at(times):
    """Contacts (T, 6) of the body in rest pose, 4 m in front of a static camera."""
    stands = stands_at(np.array([0.0, 0.0, 4.0]), len(times))
    return replace(stands, times=times).contact(UP)


@pytest.mark.parametrize("step_s", [1 / 240, 1 / 30, 1.0, 30.03 / 30, 5.0])
def test_a_standing_body_is_in_contact_at_any_frame_rate(step_s):
    contact = contact_at(np.arange(8) * step_s)
    assert contact[:, :4].min() > 0.9
    assert contact[:, 4:].max() < 0.01  # hands


@pytest.mark.parametrize("frames", [1, 4])
def test_contacts_end_at_scene_cuts(frames):
    times = np.arange(2 * frames) / 30 + np.repeat([0.0, 10.0], frames)
    contact = contact_at(times)
    assert contact[frames].max() == 0.0
    assert np.delete(contact, frames, axis=0)[:, :4].min() > 0.9


def test_it_has_the_rotations_of_the_fit_in_the_first_frames_axes_without_gaps():
    path = moving_path()
    track, true = person(path=path)
    seen = path.to_frames(true)
    lost = replace(seen, valid=np.arange(FRAMES) != 7, rotations=seen.rotations.copy())
    lost.rotations[7] = lost.rotations[6]
    raw = RawMotion.of(track, lost, path)
    found = np.concatenate([raw.R_first_root[:, None], exp(raw.joints)], axis=1)
    np.testing.assert_allclose(found, true.rotations, atol=0.02)  # the gap is filled along an arc
    np.testing.assert_allclose(raw.t_first_root, true.t_camera_root, atol=1e-3)
