# SPDX-License-Identifier: GPL-3.0-or-later
"""Arms near trunk and thighs, against full skinning and the distance to all of its triangles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.kinematics.body_surface import AHEAD_M, BodySurface, with_arm_points
from scope.scope_addon.kinematics.contact_points import with_contact_points
from scope.solver import load_body
from scope.solver.rotations import exp

BODY = load_body("scope")
BETAS = np.linspace(-1.0, 1.0, BODY.P)
PLANES_M = 0.01  # error of the tangent planes of vertices 5 cm apart


def posed(**joints: list[float]) -> tuple[np.ndarray, np.ndarray]:
    """The part poses (1, K+1, 3, 3) and (1, K+1, 3) of a body with some joints turned."""
    omega = np.tile(np.eye(3), (BODY.K + 1, 1, 1))
    for name, vector in joints.items():
        omega[BODY.joint_names.index(name)] = exp(np.array(vector))
    R, t = BODY.forward_kinematics(omega, np.zeros(3), BETAS)
    return R[None], t[None]


POSES = {
    "arms through the hips": posed(left_shoulder=[0, 0, -1.65], right_shoulder=[0, 0, 1.65]),
    "a forearm through the belly": posed(left_shoulder=[0, 0, -1.45], left_elbow=[0, 0, -1.2]),
    "seated, a hand in the thigh": posed(
        left_hip=[-1.5, 0, 0],
        right_hip=[-1.5, 0, 0],
        left_shoulder=[0, 0, -1.7],
        left_elbow=[0, -0.7, 0],
    ),
}


WITH_POINTS = with_contact_points(with_arm_points(BODY), BETAS)


@pytest.fixture(scope="module")
def surface() -> BodySurface:
    return BodySurface(WITH_POINTS, BETAS)


def distances_outside(points: np.ndarray, R: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Signed distances (C,) from trunk, legs and head: by samples of all their triangles, inside by
    the winding number.

    The arms' own triangles are left out, and so are the holes that they leave: the shoulders are
    far from all points.
    """
    v = BODY.skin(R[0], t[0], BETAS)
    triangles = BODY.triangles()
    part = BODY.strongest_joints
    arms = [
        k
        for k, name in enumerate(BODY.joint_names)
        if name.endswith(("shoulder", "elbow", "wrist", "hand"))
    ]
    corners = v[triangles[~np.isin(part[triangles], arms).any(axis=1)]]
    a, b, c = (corners[None, :, k] - points[:, None] for k in range(3))
    lengths = [np.linalg.norm(each, axis=-1) for each in (a, b, c)]
    volume = np.einsum("pti,pti->pt", a, np.cross(b, c))
    angle = 2 * np.arctan2(
        volume,
        np.prod(lengths, axis=0) + (a * b).sum(-1) * lengths[2] + (b * c).sum(-1) * lengths[0]
        + (c * a).sum(-1) * lengths[1],
    )  # fmt: skip
    inside = np.abs(angle.sum(axis=1)) > 2 * np.pi
    nearest = np.linalg.norm((a + b + c) / 3.0, axis=-1).min(axis=1)
    for each in lengths:
        nearest = np.minimum(nearest, each.min(axis=1))
    return np.where(inside, -nearest, nearest)


@pytest.mark.parametrize("pose", POSES)
def test_heights_are_the_distances_from_the_skin_less_the_room_that_the_arm_needs(
    pose: str, surface: BodySurface
) -> None:
    (R, t) = POSES[pose]
    planes = surface.planes(R, t)
    points = WITH_POINTS.keypoints(R, t, BETAS)[0, surface.indices]
    true = distances_outside(points, R, t)
    at_rest = WITH_POINTS.keypoint_template + WITH_POINTS.keypoint_shapedirs @ BETAS
    at_rest = at_rest[surface.indices]
    rest = np.linalg.norm(at_rest[:, None] - BODY.rest_vertices(BETAS), axis=-1).min(axis=1)
    near = planes.near[0]
    np.testing.assert_allclose((planes.height[0] + rest)[near], true[near], atol=PLANES_M)
    assert (true - rest)[~near].min(initial=1.0) > AHEAD_M - PLANES_M


def test_planes_move_with_the_body(surface: BodySurface) -> None:
    R, t = POSES["seated, a hand in the thigh"]
    turn = exp(np.array([0.3, -1.2, 0.5]))
    shift = np.array([0.4, -2.0, 5.0])
    here = surface.planes(R, t)
    there = surface.planes(turn @ R, t @ turn.T + shift)
    np.testing.assert_allclose(there.height, here.height, atol=1e-6)
    np.testing.assert_allclose(there.normal, here.normal @ turn.T, atol=1e-6)
    np.testing.assert_array_equal(there.near, here.near)


def test_points_are_where_the_shape_has_them() -> None:
    """Of a child, whose arms are much shorter than those of the body without coefficients."""
    child = load_body("scope_child")
    betas = np.zeros(child.P)
    betas[-1] = -1.0
    body = with_contact_points(with_arm_points(child), betas)
    own = BodySurface(body, betas)
    omega = np.tile(np.eye(3), (child.K + 1, 1, 1))
    for side, angle in (("left", -1.65), ("right", 1.65)):
        omega[child.joint_names.index(f"{side}_shoulder")] = exp(np.array([0.0, 0.0, angle]))
    R, t = child.forward_kinematics(omega, np.zeros(3), betas)
    planes = own.planes(R[None], t[None])
    skin = child.skin(R, t, betas)
    points = body.keypoints(R, t, betas)[own.indices]
    is_trunk = [name.startswith(("spine", "pelvis")) or "hip" in name for name in child.joint_names]
    trunk = skin[np.array(is_trunk)[child.strongest_joints]]
    nearest = np.linalg.norm(points[:, None] - trunk, axis=-1).min(axis=1)
    assert planes.near.all()
    np.testing.assert_allclose(np.abs(planes.height[0] + own._room), nearest, atol=0.02)


@pytest.mark.parametrize("only", ["pelvis", "left_elbow"])
def test_a_body_without_skin_on_arms_or_trunk_has_no_planes(only: str) -> None:
    joints = np.full_like(BODY.skin_joints, BODY.joint_names.index(only))
    R, t = POSES["arms through the hips"]
    body = replace(WITH_POINTS, skin_joints=joints)
    planes = BodySurface(body, BETAS).planes(np.repeat(R, 3, axis=0), np.repeat(t, 3, axis=0))
    assert planes.near.shape == (3, 0)
    assert planes.normal.shape == (3, 0, 3)
