# SPDX-License-Identifier: GPL-3.0-or-later
"""The body without fingers, against forward kinematics of the whole body."""

from __future__ import annotations

import numpy as np
from scope.scope_addon.capture.fitting.hand_measurements import without_fingers
from scope.solver.body_file import load_body
from scope.solver.rotations import exp


def test_everything_is_where_it_is_with_fingers_at_rest():
    body = load_body("scope_h")
    rng = np.random.default_rng(0)
    palms = without_fingers(body)
    assert palms.K == body.K - 30
    root = rng.standard_normal(3)
    betas = rng.standard_normal(body.P)
    at = [body.joint_names.index(name) for name in palms.joint_names]
    rotations = np.tile(np.eye(3), (body.K + 1, 1, 1))
    rotations[at] = exp(0.4 * rng.standard_normal((len(at), 3)))
    R, t = body.forward_kinematics(rotations, root, betas)
    R_palms, t_palms = palms.forward_kinematics(rotations[at], root, betas)
    np.testing.assert_allclose(t_palms, t[at], atol=1e-12)
    np.testing.assert_allclose(
        palms.keypoints(R_palms, t_palms, betas), body.keypoints(R, t, betas), atol=1e-12
    )
    np.testing.assert_allclose(
        palms.skin(R_palms, t_palms, betas), body.skin(R, t, betas), atol=1e-12
    )
    assert palms.keypoint_names == body.keypoint_names


def test_a_body_that_has_no_fingers_stays_as_it_is():
    body = load_body("scope")
    assert without_fingers(body) is body
