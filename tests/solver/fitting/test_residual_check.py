# SPDX-License-Identifier: GPL-3.0-or-later
"""`check_residual` finds wrong derivatives, and finds none in those that are right."""

import numpy as np
import pytest
from numba.extending import register_jitable
from scope.solver import (
    InvalidValueError,
    check_residual,
    load_joint_prior,
    register_residual,
    rotations,
)
from scope.solver.residuals.accumulation import add_to_point

from ..synthetic import random_body

K = 5
P = 3
M = 12
BODY = random_body(np.random.default_rng(1), K, P, M)
ROWS = [[2], [4]], [[0.3, 1.0], [-0.2, 2.0]]


@register_jitable
def accumulate_mistaken(tree, ints, floats, weight, pose, blocks):
    """The example's kernel, with its Jᵀr and JᵀJ times a factor each: floats[:, 2:4]."""
    cost = 0.0
    for k in range(ints.shape[0]):
        i = ints[k, 0]
        w = weight * floats[k, 1]
        r = pose.t[i, 1] - floats[k, 0]
        cost += 0.5 * w * r * r
        f = floats[k, 2] * w * r
        W = floats[k, 3] * w
        origin = tree.keypoints + i
        add_to_point(
            tree, pose, blocks, origin, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, W, 0.0, 0.0, 0.0, f, 0.0
        )
    return cost


def mistaken(gradient, curvature, **options):
    """The differences that are found if the kernel's sums are so many times what they should be."""
    factors = np.tile([gradient, curvature], (2, 1))
    return check_residual(BODY, "mistaken", ROWS[0], np.hstack([ROWS[1], factors]), **options)


def everything(part, ints, floats):
    """A residual of all that one may be a function of, some of which it couples."""
    return np.concatenate([part.t, part.beta, rotations.log(part.R @ part.Omega)])


def accumulate_unweighted(tree, ints, floats, weight, pose, blocks):
    """The right kernel, but for its weight."""
    return accumulate_mistaken(tree, ints, floats, 1.0, pose, blocks)


def accumulate_alone(tree, ints, floats, weight, pose, blocks):
    """The right kernel, but that it begins with empty blocks."""
    for k in range(ints.shape[0]):
        blocks.A[ints[k, 0]] = 0.0
    return accumulate_mistaken(tree, ints, floats, weight, pose, blocks)


register_residual("mistaken", kernel=accumulate_mistaken, floats=4)
register_residual("unweighted", kernel=accumulate_unweighted, floats=4)
register_residual("alone", kernel=accumulate_alone, floats=4)
register_residual("everything", function=everything, floats=0)


def tables():
    """Rows of residuals whose derivatives are right."""
    yield "everything", ([[0], [4]], np.zeros((2, 0)))
    yield "joint_flow", load_joint_prior().tables(["pelvis", *load_joint_prior().names[:K]])
    yield (
        "joint_limits",
        (np.array([[2]]), np.array([[0.6, 0.0, 0.8, -0.02, 0.02, 0.02, 1.0, 2.0]])),
    )


@pytest.mark.parametrize(("name", "rows"), list(tables()))
def test_right_derivatives_differ_by_rounding_only(name, rows):
    found = check_residual(BODY, name, *rows)
    assert set(found) == {"root", "joints", "shape", "curvature", "sum"}
    assert max(found.values()) < 1e-5, found


def test_each_kind_of_mistake_shows():
    assert max(mistaken(1.0, 1.0).values()) < 1e-5
    assert mistaken(-1.0, 1.0)["root"] == pytest.approx(2.0, abs=1e-6)
    assert mistaken(0.5, 1.0)["root"] == pytest.approx(0.5, abs=1e-6)
    assert mistaken(0.5, 1.0)["joints"] > 0.1
    found = mistaken(1.0, 0.5)
    assert found.pop("curvature") == pytest.approx(1.0, abs=1e-6)
    assert max(found.values()) < 1e-8
    assert mistaken(1.0, 0.0)["curvature"] == np.inf
    for name in ("unweighted", "alone"):
        found = check_residual(BODY, name, ROWS[0], np.hstack([ROWS[1], np.ones((2, 2))]))
        assert found.pop("sum") > 0.3
        assert max(found.values()) < 1e-5


def test_a_residual_without_a_cost_at_the_state_says_nothing():
    wide = np.array([[2]]), np.array([[1.0, 0.0, 0.0, -9.0, 9.0, 9.0, 1.0, 1.0]])
    with pytest.raises(
        InvalidValueError,
        match=r"cost of 'joint_limits' must be positive .* is 0 "
        r".* seed 3",
    ):
        check_residual(BODY, "joint_limits", *wide, seed=3)
    with pytest.raises(InvalidValueError, match="no residual named 'nothing'"):
        check_residual(BODY, "nothing", *ROWS)


@pytest.mark.parametrize("factors", [(np.nan, 1.0), (1.0, np.nan)])
def test_derivatives_that_are_not_finite_are_refused(factors):
    with pytest.raises(
        InvalidValueError, match="derivatives .* of 'mistaken' must be finite, .* seed 2"
    ):
        mistaken(*factors, seed=2)
