# SPDX-License-Identifier: GPL-3.0-or-later
"""Every residual through one derivative helper, and every kernel against its residual's JᵀJ and
Jᵀr.
"""

import inspect

import numpy as np
import pytest
from scope.solver import Options, Priors, State, make_tree, rotations
from scope.solver.gauss_newton.linearize import linearize, make_blocks, place_parts
from scope.solver.gauss_newton.recursion import make_workspace
from scope.solver.gauss_newton.terms import make_terms
from scope.solver.measurements import Keypoints2D, Keypoints3D, Measurements, OrientationField
from scope.solver.options import Stage, Weights
from scope.solver.part import GRADIENT, SHAPE, Part
from scope.solver.residuals import (
    accumulation,
    floor,
    foot_contact,
    joint_flow,
    joint_limits,
    joint_prior,
    outline,
    pose_prior,
    registry,
)

from ..synthetic import INTRINSICS, random_body, random_flow, random_state
from . import references as ref

P = 6
AXIS = np.array([0.6, 0.0, 0.8])
CONTOUR = np.array([0.3, -0.2])
NORMAL = np.array([0.6, -0.8])


def random_part(rng, scale=1.0):
    """A part in front of the camera; `scale` times the angle of a random joint state."""
    R_parent = rotations.exp(rng.standard_normal(3))
    Omega = rotations.exp(scale * rng.standard_normal(3))
    t = np.array([0.2, -0.1, 3.0]) + 0.3 * rng.standard_normal(3)
    D = 0.1 * rng.standard_normal((3, P))
    return Part(
        R_parent @ Omega,
        t,
        D,
        Omega,
        R_parent,
        t + 0.4 * rng.standard_normal(3),
        rng.standard_normal(P),
    )


def moved(part, x, u, dbeta):
    """The part moved by a twist about its origin of twists, with its joint and the shape, by their
    definition.
    """
    w = x[:3]
    nu = x[3:]
    E = rotations.exp(w)
    return Part(
        E @ part.R,
        part.t + np.cross(w, part.t - part.origin) + nu + part.D @ dbeta,
        part.D,
        part.R_parent.T @ rotations.exp(u) @ part.R_parent @ part.Omega,
        part.R_parent,
        part.origin,
        part.beta + dbeta,
    )


def check_derivatives(evaluate, part, atol=2e-7, h=1e-6):
    """Compare a residual's three Jacobians with central differences; return the linearization."""
    found = evaluate(part)
    for name, size, place in (("J_x", 6, 0), ("J_u", 3, 1), ("J_beta", P, 2)):
        numeric = np.zeros((len(found.r), size))
        for k in range(size):
            d = [np.zeros(6), np.zeros(3), np.zeros(P)]
            d[place][k] = h
            numeric[:, k] = (
                evaluate(moved(part, *d)).r - evaluate(moved(part, *(-v for v in d))).r
            ) / (2 * h)
        scale = max(1.0, np.abs(numeric).max())
        np.testing.assert_allclose(getattr(found, name), numeric, atol=atol * scale, err_msg=name)
    return found


V_BAR = 0.2 * np.random.default_rng(8).standard_normal(3)
V = 0.05 * np.random.default_rng(9).standard_normal((3, P))
L = np.random.default_rng(10).standard_normal((P, P))
HAT = rotations.exp([0.2, -0.5, 0.3])
FLOW = random_flow(np.random.default_rng(11), HAT)

CASES = {
    "keypoint2d": lambda part, w: ref.keypoint2d(part, V_BAR, V, np.array([0.1, 0.2]), w, 1.2),
    "keypoint3d": lambda part, w: ref.keypoint3d(part, V_BAR, V, np.array([0.1, 0.2, 3.1]), w),
    "orientation_field": lambda part, w: ref.orientation_field(part, V_BAR, V, AXIS, w),
    "foot_contact": lambda part, w: ref.keypoint3d(part, V_BAR, V, np.array([0.1, 0.2, 3.1]), w),
    "floor": lambda part, w: ref.floor(part, V_BAR, V, AXIS, 9.0, 2.0, 0.0, w),
    "floor_above": lambda part, w: ref.floor(part, V_BAR, V, AXIS, -9.0, 2.0, 3.0, w),
    "outline": lambda part, w: ref.outline(part, V_BAR, V, CONTOUR, NORMAL, w),
    "pose_prior": lambda part, w: ref.pose_prior(part, HAT, np.array([0.1, 0.1, 2.5]), 2.0, 3.0, w),
    "joint_prior": lambda part, w: ref.joint_prior(part, HAT, w),
    "joint_flow": lambda part, w: ref.joint_flow(part, FLOW, w),
    "joint_limits": lambda part, w: ref.joint_limits(part, AXIS, -0.1, 0.1, 0.05, 2.0, 3.0, w),
    "shape_prior": lambda part, w: ref.shape_prior(part, np.ones(P), L @ L.T, w),
}


@pytest.mark.parametrize("name", CASES)
def test_derivatives_and_weights_at_a_random_state(name):
    """The cost is linear in a weight."""
    part = random_part(np.random.default_rng(0))
    one = check_derivatives(lambda part: CASES[name](part, 1.0), part)
    for a, b in zip(one, CASES[name](part, 4.0), strict=True):
        np.testing.assert_allclose(b, 2.0 * a, rtol=1e-14)


@pytest.mark.parametrize("name", ["joint_prior", "joint_flow", "pose_prior", "joint_limits"])
@pytest.mark.parametrize("angle", [0.0, 1e-5, np.pi - 1e-3])
def test_derivatives_near_identity_and_near_pi(name, angle):
    rng = np.random.default_rng(3)
    part = random_part(rng)
    axis = rng.standard_normal(3)
    turn = rotations.exp(angle * axis / np.linalg.norm(axis))
    if name == "pose_prior":
        part.R = HAT @ turn
    else:
        part.Omega = (np.eye(3) if name == "joint_limits" else HAT) @ turn
    if name == "joint_limits":  # the swing's kink is not at zero angle
        check_derivatives(
            lambda p: ref.joint_limits(p, AXIS, -2.9, 0.4, 0.3, 2.0, 3.0), part, atol=2e-5
        )
    else:
        check_derivatives(lambda p: CASES[name](p, 1.0), part, atol=2e-5)


def test_derivatives_behind_the_camera():
    part = random_part(np.random.default_rng(0))
    for depth in (-2.0, 0.02):
        part.t[2] = depth - (part.R @ (V @ part.beta + V_BAR))[2]
        found = check_derivatives(lambda p: CASES["keypoint2d"](p, 1.0), part)
        assert found.r[2] > 0


def test_every_registered_residual_is_in_these_tests():
    others = {
        "keypoint2d",
        "keypoint3d",
        "orientation_field",
        "shape_prior",
        "floor_above",
    }
    assert set(registry.RESIDUALS) | others == set(CASES)
    for module in registry.RESIDUALS.values():
        assert module.INDEXES in ("points", "parts", "joints")
        assert list(inspect.signature(module.accumulate.py_func).parameters) == [
            "tree", "ints", "floats", "weight", "pose", "blocks",
        ]  # fmt: skip


def chain(seed=0):
    """A body, its tree and a pose for the kernels."""
    rng = np.random.default_rng(seed)
    body = random_body(rng, 4, P, 10)
    tree = make_tree(body)
    return rng, body, tree, State(*random_state(rng, 4, P, angle=1.0)).pose(tree)


def part_of(tree, pose, i):
    j = max(tree.parents[i], 0)
    return Part(
        pose.R[i], pose.t[i], pose.D[i, :, :P], pose.Omega[i], pose.R[j], pose.t[0], pose.beta[:P]
    )


def check_blocks(tree, blocks, cost, i, found):
    """The blocks of part i hold JᵀJ and Jᵀr of one residual, and nothing else does."""
    r, J_x, J_u, J_b = found
    assert cost == pytest.approx(0.5 * r @ r, rel=1e-10)
    for expected, got in (
        (J_x.T @ J_x, blocks.A[i, :, :6]), (J_x.T @ r, blocks.A[i, :, GRADIENT]),
        (J_x.T @ J_b, blocks.A[i, :, SHAPE : SHAPE + P]), (J_u.T @ J_u, blocks.H_uu[i]),
        (J_u.T @ r, blocks.H_u[i, :, GRADIENT]), (np.triu(J_b.T @ J_b), np.triu(blocks.C[:P, :P])),
        (J_b.T @ r, blocks.c[:P]),
    ):  # fmt: skip
        np.testing.assert_allclose(got, expected, atol=1e-9 * max(1.0, np.abs(expected).max()))
    others = np.arange(len(tree.parents)) != i
    assert not blocks.A[others].any()
    assert not blocks.H_uu[others].any()


def outline_of_a_side(part, v_bar, shape, normal, w):
    """The residual with the weight 2 w outside of the mask, 3 w inside."""
    r = ref.outline(part, v_bar, shape, CONTOUR, normal).r[0]
    return ref.outline(part, v_bar, shape, CONTOUR, normal, (2.0 if r > 0.0 else 3.0) * w)


def rows_and_residuals(i, k, part, v_bar, shape, w):
    """One row of each kernel, of part i and its keypoint k, and the residual that it stands for."""
    place = np.array([0.1, 0.2, 3.1])
    delta = np.array([0.02, -0.01, 0.03])
    sides = ([2.0], [3.0]), ([np.inf], [np.inf])
    cases = {
        "pose_prior": (
            pose_prior.pack([i], HAT[None], place[None], [2.0], [3.0]),
            ref.pose_prior(part, HAT, place, 2.0, 3.0, w),
        ),
        "joint_prior": (
            joint_prior.pack([i], HAT[None], [2.0]),
            ref.joint_prior(part, HAT, 2.0 * w),
        ),
        "joint_flow": (
            joint_flow.pack([i], FLOW[None], [2.0]),
            ref.joint_flow(part, FLOW, 2.0 * w),
        ),
        "joint_limits": (
            joint_limits.pack([i], AXIS[None], [-0.1], [0.1], [0.05], [2.0], [3.0]),
            ref.joint_limits(part, AXIS, -0.1, 0.1, 0.05, 2.0, 3.0, w),
        ),
        "foot_contact": (
            foot_contact.pack([k], place[None], [2.0]),
            ref.keypoint3d(part, v_bar, shape, place, 2.0 * w),
        ),
        "foot_contact of a joint": (
            foot_contact.pack([10 + i], place[None], [2.0]),
            ref.keypoint3d(part, np.zeros(3), np.zeros((3, P)), place, 2.0 * w),
        ),
    }
    for side, offset in (("below", 9.0), ("above", -9.0)):
        cases[f"floor {side}"] = (
            floor.pack([k], AXIS, offset, [2.0], [3.0]),
            ref.floor(part, v_bar, shape, AXIS, offset, 2.0, 3.0, w),
        )
    for side, normal in (("on one side", NORMAL), ("on the other", -NORMAL)):
        cases[f"outline {side}"] = (
            outline.pack([k], delta[None], CONTOUR[None], normal[None], *sides),
            outline_of_a_side(part, v_bar + delta, shape, normal, w),
        )
    return cases


def test_table_kernels_accumulate_their_residual():
    _, body, tree, pose = chain()
    i = 3
    w = 1.9
    k = int(np.flatnonzero(body.keypoint_part == i)[0])
    cases = rows_and_residuals(i, k, part_of(tree, pose, i), body.v_bar[k], body.V[k], w)
    assert {name.split()[0] for name in cases} == set(registry.RESIDUALS)
    for name, (rows, found) in cases.items():
        accumulate = registry.RESIDUALS[name.split()[0]].accumulate
        blocks = make_blocks(tree)
        check_blocks(tree, blocks, accumulate(tree, *rows, w, pose, blocks), i, found)


MEASURED = {
    "image": lambda j, i: {"keypoints2d": Keypoints2D([j], [[700.0, 300.0]], [0.5])},
    "space": lambda j, i: {"keypoints3d": Keypoints3D([j], [[0.2, 0.1, 4.2]], [0.5])},
    "direction": lambda j, i: {"orientation_field": OrientationField([10 + i], [j], [AXIS], [0.5])},
}


@pytest.mark.parametrize(
    ("way", "behind"), [("image", False), ("image", True), ("space", False), ("direction", False)]
)
def test_measurement_kernel_accumulates_its_residual(way, behind):
    _, body, tree, pose = chain(2)
    if behind:
        pose.t[0, 2] -= 5.0
        place_parts(tree, pose)
    j = 7
    i = int(body.keypoint_part[j])
    measurements = Measurements(INTRINSICS, **MEASURED[way](j, i))
    weights = Weights(30.0, 40.0, 50.0, joint_prior=0.0, joint_limits=0.0, shape=0.0)
    table, _, _ = Options(None, np.inf, np.inf, np.inf).stage_table([Stage(weights)])
    blocks = make_blocks(tree)
    cost = linearize(
        tree,
        make_terms(tree, measurements, Priors()),
        table[0],
        pose,
        blocks,
        make_workspace(tree).scratch,
    )
    part = part_of(tree, pose, i)
    uv = np.array([(700.0 - 640.0) / 1100.0, (300.0 - 360.0) / 1080.0])
    found = {
        "image": lambda: ref.keypoint2d(part, body.v_bar[j], body.V[j], uv, 15.0),
        "space": lambda: ref.keypoint3d(
            part, body.v_bar[j], body.V[j], np.array([0.2, 0.1, 4.2]), 20.0
        ),
        "direction": lambda: ref.orientation_field(part, body.v_bar[j], body.V[j], AXIS, 25.0),
    }[way]()
    check_blocks(tree, blocks, cost, i, found)


def test_direction_between_two_joints_and_between_two_keypoints_of_one_part():
    rng = np.random.default_rng(4)
    body = random_body(rng, 4, P, 10)
    body.parents = np.array([-1, 0, 0, 1, 2])
    tree = make_tree(body)
    pose = State(*random_state(rng, 4, P)).pose(tree)
    points = np.einsum(
        "mij,mj->mi", pose.R[tree.point_part], tree.V[:, :, :P] @ pose.beta[:P] + tree.v_bar
    )
    points += pose.t[tree.point_part]
    table, _, _ = Options().stage_table([Stage(Weights(shape=0.0, joint_prior=0.0))])
    for start, end in ((11, 12), (10, 11), (11, 13), (6, 7), (13, 6), (6, 13)):
        field = OrientationField([start], [end], [points[end] - points[start]], [1.0])
        terms = make_terms(tree, Measurements(orientation_field=field), Priors())
        cost = linearize(
            tree, terms, table[0], pose, make_blocks(tree), make_workspace(tree).scratch
        )
        assert cost == pytest.approx(0.0, abs=1e-20), (start, end)


def test_geman_mcclure_and_its_derivative():
    for s in (0.0, 1e-4, 0.02, 3.0):
        rho, slope = accumulation.geman_mcclure(s, 1 / 0.02)
        assert rho == pytest.approx(0.02 * s / (0.02 + s))
        h = 1e-7
        numeric = (
            accumulation.geman_mcclure(s + h, 50.0)[0] - accumulation.geman_mcclure(s - h, 50.0)[0]
        ) / (2 * h)
        assert slope == pytest.approx(numeric, rel=1e-6)
    assert accumulation.geman_mcclure(5.0, 0.0) == (5.0, 1.0)
