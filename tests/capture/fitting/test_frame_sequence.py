# SPDX-License-Identifier: GPL-3.0-or-later
"""Initial states of a refit; the sequence itself is tested with the fit of a whole track."""

from __future__ import annotations

import numpy as np
from scope.scope_addon.capture.fitting.frame_sequence import with_same_rotations
from scope.solver import State, load_body
from scope.solver.rotations import exp


def test_a_state_gets_the_rotations_of_the_previous_frame():
    rng = np.random.default_rng(0)
    body = load_body("scope")

    def state() -> State:
        return State(
            exp(rng.standard_normal(3)), rng.standard_normal(3), exp(rng.standard_normal((body.K, 3))), np.zeros(body.P)
        )

    before, now, after = state(), state(), state()
    same = with_same_rotations(now, before, before)
    np.testing.assert_allclose(same.Omega, now.Omega, atol=1e-12)
    there = with_same_rotations(before, before, after)
    np.testing.assert_allclose(there.Omega, after.Omega, atol=1e-12)
    np.testing.assert_allclose(there.R_camera_root, after.R_camera_root, atol=1e-12)
    np.testing.assert_array_equal(there.t_camera_root, before.t_camera_root)
    turned = with_same_rotations(now, before, after)  # by the same rotation, in the parent's axes
    by = turned.Omega @ np.swapaxes(now.Omega, 1, 2)
    np.testing.assert_allclose(by, after.Omega @ np.swapaxes(before.Omega, 1, 2), atol=1e-12)
