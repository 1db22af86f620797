# SPDX-License-Identifier: GPL-3.0-or-later
"""The raw motion as it is kept: the fit's rotations, in a third of their memory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scope.scope_addon.capture.world.camera_path import CameraPath
from scope.scope_addon.capture.world.placement import RawMotion
from scope.solver.rotations import exp

from .clip.waving_person import BODY, FRAMES, person


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


def test_an_hour_of_it_takes_a_third_of_the_memory_of_rotation_matrices():
    track, true = person()
    single = replace(true, rotations=true.rotations.astype(np.float32))
    raw = RawMotion.of(track, single, CameraPath.static(FRAMES))
    kept = raw.R_first_root.nbytes + raw.joints.nbytes
    assert kept < 0.4 * single.rotations.nbytes
    assert not np.shares_memory(raw.R_first_root, single.rotations)
    assert raw.joints.shape == (FRAMES, BODY.K, 3)
