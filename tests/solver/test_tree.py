# SPDX-License-Identifier: GPL-3.0-or-later
"""Nothing is hard-wired to a body: any number of joints, any tree, any number of shape
coefficients.
"""

import numpy as np
import pytest
from scope.solver import (
    InvalidValueError,
    Keypoints2D,
    Keypoints3D,
    Measurements,
    Options,
    Priors,
    Stage,
    State,
    Weights,
    fit,
    make_tree,
    measurements,
    rotations,
    validation,
)
from scope.solver.gauss_newton.optimizer import optimize
from scope.solver.residuals import joint_flow, joint_limits

from .synthetic import (
    INTRINSICS,
    forward,
    project,
    random_body,
    random_flow,
    random_state,
)

TIGHT = Options(stages=[Stage(Weights(joint_prior=0.0, shape=0.0, joint_limits=0.0), 1e-14, 300)])


def check_recovery(body, state, K, atol=1e-5):
    R, t, points = forward(body, *state)
    index = np.arange(len(points))
    seen = Measurements(
        INTRINSICS,
        Keypoints2D(index, project(points), np.ones(len(index))),
        Keypoints3D(index, points, np.ones(len(index))),
    )
    rng = np.random.default_rng(0)
    turned = state[2] @ rotations.exp(min(0.05, 0.5 / K) * rng.standard_normal((K, 3)))
    near = State(state[0], state[1] + 0.02, turned, 0.9 * state[3])
    found = fit(body, seen, init=near, priors=Priors(), options=TIGHT)
    placed = np.einsum(
        "mij,mj->mi",
        found.R_camera_part[body.keypoint_part],
        body.V @ found.state.beta + body.v_bar,
    )
    np.testing.assert_allclose(placed + found.t_camera_part[body.keypoint_part], points, atol=atol)
    return found


@pytest.mark.parametrize(
    ("K", "kind", "P"),
    [(1, "chain", 0), (2, "star", 1), (23, "random", 1), (51, "star", 10), (100, "chain", 0)],
)
def test_trees_and_shapes(K, kind, P):
    rng = np.random.default_rng(K + P)
    body = random_body(rng, K, P, 4 * (K + 1))
    if kind == "chain":
        body.parents = np.arange(-1, K)
    elif kind == "star":
        body.parents = np.array([-1] + [0] * K)
    body.l *= 0.3 if K == 100 else 1.0
    check_recovery(body, random_state(rng, K, P, 0.3), K)


def test_many_shape_coefficients():
    rng = np.random.default_rng(100)
    body = random_body(rng, 23, 100, 240, shape=0.005)
    found = check_recovery(body, random_state(rng, 23, 100, 0.3), 23, atol=1e-4)
    assert found.state.beta.shape == (100,)


def test_arrays_that_cannot_be_written_to_need_no_other_machine_code():
    """Numba compiles anew for them, which takes minutes; and a body's own arrays may change."""
    body = random_body(np.random.default_rng(3), 4, 2, 6)
    points = forward(body, *random_state(np.random.default_rng(4), 4, 2))[2]
    indices = np.arange(6)
    pixels = project(points)
    confidence = np.full(6, 0.5)
    intrinsics = INTRINSICS.copy()
    limits = joint_limits.pack(np.array([2]), np.eye(3)[:1], *np.ones((5, 1)))
    flow = joint_flow.pack([1], random_flow(np.random.default_rng(5), np.eye(3)), [1.0])
    priors = Priors(limits=limits, flow=flow)

    def fitted():
        seen2d = Keypoints2D(indices, pixels, confidence)
        seen3d = Keypoints3D(indices, points, confidence)
        return fit(body, Measurements(intrinsics, seen2d, seen3d), priors=priors)

    kernels = [
        each
        for module in (measurements, validation)
        for each in vars(module).values()
        if hasattr(each, "signatures")
    ]
    expected = fitted()
    body.parents = body.parents.astype(np.int64)
    for arrays, called in (
        ((indices, pixels, points, confidence, intrinsics), kernels),
        ((body.parents, *limits, *flow), [optimize]),
    ):
        compiled = [len(each.signatures) for each in called]
        for array in arrays:
            array.flags.writeable = False
        found = fitted()
        assert [len(each.signatures) for each in called] == compiled
        np.testing.assert_array_equal(found.t_camera_part, expected.t_camera_part)
    assert not np.shares_memory(make_tree(body).parents, body.parents)


@pytest.mark.parametrize(
    ("field", "names"),
    [
        ("joint_names", ["a", "b"]),  # as of a list without its root
        ("joint_names", ["a", "b", "b"]),
        ("joint_names", "abc"),
        ("keypoint_names", list("abcde")),
    ],
)
def test_names_that_are_not_one_for_each_are_refused(field, names):
    body = random_body(np.random.default_rng(0), K=2, P=0, M=6)
    setattr(body, field, names)
    with pytest.raises(InvalidValueError, match=f"{field} of the body must be"):
        make_tree(body)


def test_a_root_named_like_a_hinge_has_no_limits():
    """As of an arm alone, which turns freely about its elbow."""
    body = random_body(np.random.default_rng(0), K=2, P=0, M=6)
    body.joint_names = ["left_elbow", "right_elbow", "hand"]
    _, _, points = forward(
        body, np.eye(3), np.array([0.0, 0.0, 3.0]), np.tile(np.eye(3), (2, 1, 1)), []
    )
    fit(body, Measurements(keypoints3d=Keypoints3D(range(6), points)))
    ints, _ = joint_limits.hinges_of(body.joint_names)
    assert ints.ravel().tolist() == [1]
