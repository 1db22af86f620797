# SPDX-License-Identifier: GPL-3.0-or-later
"""Every kernel against its residual, written once more in numpy, and differences of that."""

import inspect

import numpy as np
import pytest
from scope.solver import Options, Priors, State, make_tree, rotations
from scope.solver.gauss_newton.linearize import linearize, make_blocks, make_scratch, place_parts
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
M = 10
I = 3  # the part of a residual
WEIGHT = 1.9
AXIS = np.array([0.6, 0.0, 0.8])
PLACE = np.array([0.1, 0.2, 3.1])
DELTA = np.array([0.02, -0.01, 0.03])
CONTOUR = np.array([0.3, -0.2])
NORMAL = np.array([0.6, -0.8])
HAT = rotations.exp([0.2, -0.5, 0.3])
FLOW = random_flow(np.random.default_rng(11), HAT)
SIDES = ([2.0], [3.0]), ([np.inf], [np.inf])


def cases():
    """Of each kernel one row, of part I or a point k of it, and the residual that it stands for."""
    return {
        "pose_prior": (
            lambda k: pose_prior.pack([I], HAT[None], PLACE[None], [2.0], [3.0]),
            lambda part, v_bar, V: ref.pose_prior(part, HAT, PLACE, 2.0, 3.0),
        ),
        "joint_prior": (
            lambda k: joint_prior.pack([I], HAT[None], [1.0]),
            lambda part, v_bar, V: ref.joint_prior(part, HAT),
        ),
        "joint_flow": (
            lambda k: joint_flow.pack([I], FLOW[None], [1.0]),
            lambda part, v_bar, V: ref.joint_flow(part, FLOW),
        ),
        "joint_limits": (
            lambda k: joint_limits.pack([I], AXIS[None], [-0.1], [0.1], [0.05], [2.0], [3.0]),
            lambda part, v_bar, V: ref.joint_limits(part, AXIS, -0.1, 0.1, 0.05, 2.0, 3.0),
        ),
        "joint_limits whose kink is elsewhere": (
            lambda k: joint_limits.pack([I], AXIS[None], [0.2], [0.4], [0.3], [2.0], [3.0]),
            lambda part, v_bar, V: ref.joint_limits(part, AXIS, 0.2, 0.4, 0.3, 2.0, 3.0),
        ),
        "foot_contact": (
            lambda k: foot_contact.pack([k], PLACE[None], [1.0]),
            lambda part, v_bar, V: ref.keypoint3d(part, v_bar, V, PLACE),
        ),
        "foot_contact of a joint": (
            lambda k: foot_contact.pack([M + I], PLACE[None], [1.0]),
            lambda part, v_bar, V: ref.keypoint3d(part, 0.0 * v_bar, 0.0 * V, PLACE),
        ),
        "floor": (
            lambda k: floor.pack([k], AXIS, 9.0, [2.0], [3.0]),
            lambda part, v_bar, V: ref.floor(part, v_bar, V, AXIS, 9.0, 2.0, 3.0),
        ),
        "floor from above": (
            lambda k: floor.pack([k], AXIS, -9.0, [2.0], [3.0]),
            lambda part, v_bar, V: ref.floor(part, v_bar, V, AXIS, -9.0, 2.0, 3.0),
        ),
        "outline": (
            lambda k: outline.pack([k], DELTA[None], CONTOUR[None], NORMAL[None], *SIDES),
            lambda part, v_bar, V: ref.outline(part, v_bar + DELTA, V, CONTOUR, NORMAL, 2.0, 3.0),
        ),
        "outline from the other side": (
            lambda k: outline.pack([k], DELTA[None], CONTOUR[None], -NORMAL[None], *SIDES),
            lambda part, v_bar, V: ref.outline(part, v_bar + DELTA, V, CONTOUR, -NORMAL, 2.0, 3.0),
        ),
    }


CASES = cases()
MEASURED = {
    "image": (
        lambda k: {"keypoints2d": Keypoints2D([k], [[700.0, 300.0]], [0.5])},
        lambda part, v_bar, V: ref.keypoint2d(part, v_bar, V, np.array([60 / 1100, -60 / 1080])),
    ),
    "space": (
        lambda k: {"keypoints3d": Keypoints3D([k], PLACE[None], [0.5])},
        lambda part, v_bar, V: ref.keypoint3d(part, v_bar, V, PLACE),
    ),
    "direction": (
        lambda k: {"orientation_field": OrientationField([M + I], [k], [AXIS], [0.5])},
        lambda part, v_bar, V: ref.orientation_field(part, v_bar, V, AXIS),
    ),
}


def chain():
    """A body, its tree and a pose for the kernels."""
    rng = np.random.default_rng(0)
    body = random_body(rng, 4, P, M)
    tree = make_tree(body)
    return body, tree, State(*random_state(rng, 4, P, angle=1.0)).pose(tree)


def moved(part, x, u, dbeta):
    """The part moved by a twist about its origin of twists, with its joint and the shape, by their
    definition.
    """
    w = x[:3]
    nu = x[3:]
    return Part(
        rotations.exp(w) @ part.R,
        part.t + np.cross(w, part.t - part.origin) + nu + part.D @ dbeta,
        part.D,
        part.R_parent.T @ rotations.exp(u) @ part.R_parent @ part.Omega,
        part.R_parent,
        part.origin,
        part.beta + dbeta,
    )


def differences(residual, part, h=1e-6):
    """J_x (n, 6), J_u (n, 3) and J_beta (n, P) by central differences."""
    J = []
    for step in h * np.eye(9 + P):
        d = step[:6], step[6:9], step[9:]
        J.append((residual(moved(part, *d)) - residual(moved(part, *(-v for v in d)))) / (2 * h))
    return np.split(np.array(J).T, [6, 9], axis=1)


def check_blocks(body, tree, pose, residual, weight, cost, blocks, tolerance=1e-7, sigma=np.inf):
    """The blocks of part I hold JᵀJ and Jᵀr of one residual of its keypoint, with the weight of a
    robust kernel, and nothing else does.
    """
    k = keypoint_of(body)
    parent = pose.R[tree.parents[I]]
    D = pose.D[I, :, :P]
    part = Part(pose.R[I], pose.t[I], D, pose.Omega[I], parent, pose.t[0], pose.beta[:P])

    r = residual(part, body.v_bar[k], body.V[k])
    rho, slope = accumulation.geman_mcclure(r @ r, 1.0 / sigma)

    def weighted(part):
        return np.sqrt(weight * slope) * residual(part, body.v_bar[k], body.V[k])

    assert r.any()
    assert cost == pytest.approx(0.5 * weight * rho, rel=1e-9)
    r = weighted(part)
    J_x, J_u, J_b = differences(weighted, part)
    for expected, got in (
        (J_x.T @ J_x, blocks.A[I, :, :6]), (J_x.T @ r, blocks.A[I, :, GRADIENT]),
        (J_x.T @ J_b, blocks.A[I, :, SHAPE : SHAPE + P]), (J_u.T @ J_u, blocks.H_uu[I]),
        (J_u.T @ r, blocks.H_u[I, :, GRADIENT]), (np.triu(J_b.T @ J_b), np.triu(blocks.C[:P, :P])),
        (J_b.T @ r, blocks.c[:P]),
    ):  # fmt: skip
        np.testing.assert_allclose(got, expected, atol=tolerance * max(1.0, np.abs(expected).max()))
    others = np.arange(len(tree.parents)) != I
    assert not blocks.A[others].any()
    assert not blocks.H_uu[others].any()


def keypoint_of(body):
    return int(np.flatnonzero(body.keypoint_part == I)[0])


def check_kernel(name, body, tree, pose, tolerance=1e-7):
    rows, residual = CASES[name]
    blocks = make_blocks(tree)
    accumulate = registry.RESIDUALS[name.split()[0]].accumulate
    cost = accumulate(tree, *rows(keypoint_of(body)), WEIGHT, pose, blocks)
    check_blocks(body, tree, pose, residual, WEIGHT, cost, blocks, tolerance)


@pytest.mark.parametrize("name", CASES)
def test_a_kernel_adds_its_residual_to_the_blocks(name):
    check_kernel(name, *chain())


@pytest.mark.parametrize(
    "name", ["joint_prior", "joint_flow", "pose_prior", "joint_limits whose kink is elsewhere"]
)
@pytest.mark.parametrize("angle", [1e-5, np.pi - 1e-3])
def test_near_the_identity_and_near_pi(name, angle):
    body, tree, pose = chain()
    turn = rotations.exp(angle * AXIS[[1, 0, 2]])
    if name == "pose_prior":
        pose.R[I] = HAT @ turn
    else:
        pose.Omega[I] = (np.eye(3) if name.startswith("joint_limits") else HAT) @ turn
    check_kernel(name, body, tree, pose, tolerance=1e-4)


def test_every_registered_residual_is_in_these_tests():
    assert {name.split()[0] for name in CASES} == set(registry.RESIDUALS)
    for module in registry.RESIDUALS.values():
        assert module.INDEXES in ("points", "parts", "joints")
        assert list(inspect.signature(module.accumulate.py_func).parameters) == [
            "tree", "ints", "floats", "weight", "pose", "blocks",
        ]  # fmt: skip


@pytest.mark.parametrize(
    ("way", "behind_m", "sigma"),
    [("image", 0.0, 0.1), ("image", 6.0, np.inf), ("space", 0.0, 1.0), ("direction", 0.0, 1.0)],
)
def test_a_measurement_adds_its_residual_to_the_blocks(way, behind_m, sigma):
    body, tree, pose = chain()
    pose.t[0, 2] -= behind_m
    place_parts(tree, pose)
    measured, residual = MEASURED[way]
    weights = Weights(30.0, 30.0, 30.0, joint_prior=0.0, joint_limits=0.0, shape=0.0)
    table, _, _ = Options(None, sigma, sigma, sigma).stage_table([Stage(weights)])
    blocks = make_blocks(tree)
    terms = make_terms(tree, Measurements(INTRINSICS, **measured(keypoint_of(body))), Priors())
    cost = linearize(tree, terms, table[0], pose, blocks, make_scratch(tree))
    check_blocks(body, tree, pose, residual, 15.0, cost, blocks, sigma=sigma)


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
        cost = linearize(tree, terms, table[0], pose, make_blocks(tree), make_scratch(tree))
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
