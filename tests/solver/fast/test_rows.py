# SPDX-License-Identifier: GPL-3.0-or-later
"""The functions in SIMD against those in plain numba, for widths of the shape up to 40."""

import numpy as np
import pytest
from scope.solver import rotations
from scope.solver.fast import rows as fast
from scope.solver.gauss_newton import plain_rows as plain
from scope.solver.kernel import kernel
from scope.solver.residuals import joint_flow

WIDTHS = (0, 4, 8, 12, 40)


def numbers(rng, count):
    return tuple(rng.normal(size=count).tolist())


def arguments(name, W, rng):
    """Arguments of a function, and the numbers of those that it writes."""
    row = 8 + W
    A = rng.normal(size=(6, row))
    Y = rng.normal(size=(3, row))
    C = rng.normal(size=(W, W))
    c = rng.normal(size=W)
    V = rng.normal(size=(3, W))
    moved = np.zeros((12, W))
    vectors = [numbers(rng, count) for count in (9, 6, 6, 9, 3)]
    return {
        "place_origin": ((V, numbers(rng, 9), rng.normal(size=(3, W)), np.zeros((3, W))), [3]),
        "add_point": ((V, *vectors, A, C, c, moved), [6, 7, 8]),
        "add_origin": (
            (V, numbers(rng, 6), numbers(rng, 9), numbers(rng, 3), numbers(rng, 3), A, C, c, moved),
            [5, 6, 7],
        ),
        "take_moment": ((A, numbers(rng, 3), Y), [2]),
        "scale_rows": ((numbers(rng, 6), Y), [1]),
        "add_to_parent": ((A, Y, rng.normal(size=(6, row))), [2]),
        "subtract_eliminated": ((A, C, c), [1, 2]),
    }[name]


def runner(apply):
    """A kernel that Python can call."""

    @kernel
    def run(table, at, state):
        apply(table, at, state)

    return run


NAMES = [
    name
    for name, value in vars(plain).items()
    if hasattr(value, "py_func") and not name.startswith("_")
]


@pytest.mark.parametrize("W", WIDTHS)
@pytest.mark.parametrize("name", NAMES)
def test_both_compute_the_same(name, W):
    given, written = arguments(name, W, np.random.default_rng(W))
    copies = [value.copy() if isinstance(value, np.ndarray) else value for value in given]
    getattr(plain, name)(*given)
    getattr(fast, name)(*copies)
    for k, value in enumerate(given):
        if isinstance(value, np.ndarray) and k in written:
            # Of a product, only the upper triangle counts.
            is_square = value.ndim == 2 and value.shape == (W, W)
            pick = np.triu if is_square else np.asarray
            np.testing.assert_allclose(pick(copies[k]), pick(value), rtol=1e-12, atol=1e-12)


def test_the_first_rows_of_the_memory_are_the_turned_point():
    """The focal length's column needs them."""
    given, _ = arguments("add_point", 12, np.random.default_rng(1))
    copies = [value.copy() if isinstance(value, np.ndarray) else value for value in given]
    plain.add_point(*given)
    fast.add_point(*copies)
    R = np.reshape(given[1], (3, 3))
    np.testing.assert_allclose(given[9][:3], R @ given[0], atol=1e-12)
    np.testing.assert_allclose(copies[9][:3], R @ given[0], atol=1e-12)


@pytest.mark.parametrize("name", ["chart", "layer", "finish", "normal"])
def test_formulas_of_joints_side_by_side(name):
    rng = np.random.default_rng(7)
    formula = getattr(joint_flow, name)
    lanes = plain.LANES
    table = rng.normal(size=3 + lanes * joint_flow.SIZE)
    state = rng.normal(size=(plain.STATE, lanes))
    if name == "chart":
        turned = rotations.exp(0.4 * rng.normal(size=(lanes, 3)))
        state[:9] = turned.reshape(lanes, 9).T
        table[3 : 3 + 9 * lanes] = np.repeat(np.eye(3).ravel(), lanes)
    q = table[3:].reshape(-1, lanes)
    expected = np.array(np.broadcast_arrays(*formula(q, 0, 1, tuple(state))))
    for module in (plain, fast):
        found = state.ravel().copy()
        runner(module.in_lanes(formula))(table, 3, found)
        np.testing.assert_allclose(found, expected.ravel(), rtol=1e-12)
