# SPDX-License-Identifier: GPL-3.0-or-later
"""Keypoints that are added to a body, against vertices and joints of the same body."""

import numpy as np
from scope.scope_addon.kinematics.contact_points import with_keypoints, with_points_on_parts
from scope.solver import load_body
from scope.solver.rotations import exp

BODY = load_body("scope")
BETAS = np.linspace(-1.0, 1.0, BODY.P)
OMEGA = exp(np.random.default_rng(0).normal(0.0, 0.3, (BODY.K + 1, 3)))


def test_points_that_keep_their_offset_move_with_their_part_and_others_stay():
    parts = np.array([20, 4])
    offsets = np.array([[0.1, 0.0, 0.0], [0.0, -0.2, 0.05]])
    body = with_points_on_parts(BODY, ("one", "two"), parts, offsets)
    assert body.keypoint_names == (*BODY.keypoint_names, "one", "two")
    R, t = body.forward_kinematics(OMEGA, np.zeros(3), BETAS)
    points = body.keypoints(R, t, BETAS)
    np.testing.assert_allclose(
        points[-2:], t[parts] + np.einsum("nij,nj->ni", R[parts], offsets), atol=1e-6
    )
    np.testing.assert_array_equal(points[:-2], BODY.keypoints(R, t, BETAS))


def test_points_with_shape_directions_follow_the_shape():
    vertices = np.array([100, 2000, 9000])
    parts = BODY.skin_joints[vertices, BODY.skin_weights[vertices].argmax(1)]
    body = with_keypoints(
        BODY, map(str, vertices), parts, BODY.v_template[vertices], BODY.shapedirs[vertices]
    )
    straight = np.tile(np.eye(3), (BODY.K + 1, 1, 1))
    R, t = body.forward_kinematics(straight, np.zeros(3), BETAS)
    np.testing.assert_allclose(
        body.keypoints(R, t, BETAS)[-3:], BODY.rest_vertices(BETAS)[vertices], atol=1e-5
    )
