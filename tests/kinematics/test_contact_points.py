# SPDX-License-Identifier: GPL-3.0-or-later
"""Soles and palms lie where the mesh ends, and move with their parts."""

import numpy as np
import pytest
from scope.scope_addon.kinematics.contact_points import (
    CONTACT_POINTS,
    contact_point_positions,
    with_contact_points,
)
from scope.solver import rotations
from scope.solver.body_file import load_body


@pytest.mark.parametrize(("which", "size"), [("scope", 1.5), ("scope_h", -1.5)])
def test_contact_points_are_keypoints_at_the_end_of_the_mesh(which, size):
    body = load_body(which)
    betas = np.full(body.P, 0.0)
    betas[0] = size
    supported = with_contact_points(body, betas)
    assert supported.keypoint_names == (*body.keypoint_names, *CONTACT_POINTS)
    pose = np.tile(np.eye(3), (body.K + 1, 1, 1))
    R, t = body.forward_kinematics(pose, np.zeros(3), betas)
    points = contact_point_positions(supported, R, t)
    vertices = body.skin(R, t, betas)
    floor = vertices[:, 1].min()
    assert np.abs(points[:4, 1] - floor).max() < 0.01  # the model frame's y is up
    assert (points[[1, 3], 2] > points[[0, 2], 2] + 0.05).all()  # toes lie in front of heels
    assert (points[[0, 1, 4], 0] > 0).all()  # the left side
    assert (points[[2, 3, 5], 0] < 0).all()
    for palm in points[4:]:
        assert np.linalg.norm(vertices - palm, axis=1).min() < 0.03


def test_contact_points_follow_their_parts():
    body = load_body("scope")
    supported = with_contact_points(body, np.zeros(body.P))
    pose = np.tile(np.eye(3), (body.K + 1, 1, 1))
    bent = pose.copy()
    bent[body.joint_names.index("left_hip")] = rotations.exp(np.array([-0.8, 0.0, 0.0]))
    still, moved = (
        contact_point_positions(supported, *body.forward_kinematics(p, np.zeros(3)))
        for p in (pose, bent)
    )
    np.testing.assert_allclose(moved[2:], still[2:], atol=1e-12)
    hip = body.forward_kinematics(pose, np.zeros(3))[1][body.joint_names.index("left_hip")]
    np.testing.assert_allclose(
        np.linalg.norm(moved[:2] - hip, axis=1), np.linalg.norm(still[:2] - hip, axis=1), atol=1e-9
    )
    assert (moved[:2, 1] > still[:2, 1] + 0.1).all()
