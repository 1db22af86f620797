# SPDX-License-Identifier: GPL-3.0-or-later
"""The functions in SIMD against those in plain numba, for widths of the shape up to 40."""

import numpy as np
import pytest
from scope.solver.fast import rows as fast
from scope.solver.gauss_newton import plain_rows as plain
from scope.solver.kernel import kernel
from scope.solver.residuals import joint_flow

WIDTHS = (0, 8, 40)


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
    moved = np.zeros((6, W))
    vectors = [numbers(rng, count) for count in (9, 6, 6, 9, 3)]
    return {
        "place_origin": ((V, numbers(rng, 9), rng.normal(size=(3, W)), np.zeros((3, W))), [3]),
        # the focal length's column needs the first rows of the memory, the turned point
        "add_point": ((V, *vectors, A, C, c, moved), [6, 7, 8, 9]),
        "add_origin": (
            (V, numbers(rng, 6), numbers(rng, 9), numbers(rng, 3), A, C, c, moved),
            [4, 5, 6],
        ),
        "take_moment": ((A, numbers(rng, 3), Y), [2]),
        "scale_rows": ((numbers(rng, 6), Y), [1]),
        "add_to_parent": ((A, Y, rng.normal(size=(6, row))), [2]),
        "subtract_eliminated": ((A, C, c), [1, 2]),
    }[name]


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
            # of a product, only the upper triangle counts
            pick = np.triu if value.shape == (W, W) else np.asarray
            np.testing.assert_allclose(pick(copies[k]), pick(value), rtol=1e-12, atol=1e-12)


def test_plain_formulas_of_joints_side_by_side():
    """Those in SIMD are compared with numpy's in test_joint_flow.py."""
    apply = plain.in_lanes(joint_flow.normal)

    @kernel
    def run(table, at, state):
        apply(table, at, state)

    state = np.random.default_rng(7).normal(size=(plain.STATE, plain.LANES))
    expected = np.array(joint_flow.normal(None, 0, 1, tuple(state)))
    found = state.ravel().copy()
    run(np.zeros(0), 0, found)
    np.testing.assert_allclose(found, expected.ravel(), rtol=1e-12)
