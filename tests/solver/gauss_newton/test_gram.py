# SPDX-License-Identifier: GPL-3.0-or-later
"""Gram products in tiles, against numpy, for every width up to 40: the upper triangle, and rows
alone.
"""

import numpy as np
import pytest
from scope.solver.gauss_newton.gram import (
    add_gram,
    subtract_gram,
    subtract_gram_below,
    subtract_gram_rows,
)

WIDTHS = range(4, 44, 4)


def assert_upper_is(C: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(np.triu(C), np.triu(expected), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("W", WIDTHS)
@pytest.mark.parametrize("count", [1, 6, 15])
def test_products_of_two_arrays_and_of_one(W: int, count: int) -> None:
    rng = np.random.default_rng(W + count)
    C0 = rng.normal(size=(W, W))
    X = rng.normal(size=(count, 3 + W))
    Z = rng.normal(size=(count, 1 + W))
    C = C0.copy()
    add_gram(C, W, X, 3, 3 + W, Z, 1, 1 + W, count)
    assert_upper_is(C, C0 + X[:, 3:].T @ Z[:, 1:])
    C = C0.copy()
    subtract_gram(C, W, X, 3, 3 + W, count)
    assert_upper_is(C, C0 - X[:, 3:].T @ X[:, 3:])


@pytest.mark.parametrize("W", [24, 28, 40])
@pytest.mark.parametrize("first", [0, 4, 12])
@pytest.mark.parametrize("count", [4, 8, 12])
def test_known_zeros_are_skipped_without_changing_the_product(
    W: int, first: int, count: int
) -> None:
    rng = np.random.default_rng(W)
    C0 = rng.normal(size=(W, W))
    X = rng.normal(size=(count, W))
    for j in range(count):
        X[: 3 * (j // 3), first + j] = 0.0
    C = C0.copy()
    subtract_gram_below(C, W, X, 0, W, count, first)
    assert_upper_is(C, C0 - X.T @ X)


@pytest.mark.parametrize("width", WIDTHS)
def test_four_rows_alone(width: int) -> None:
    rng = np.random.default_rng(width)
    count = 7
    c_row = width + 5
    C0 = rng.normal(size=(6, c_row))
    X = rng.normal(size=(count, 4))
    Z = rng.normal(size=(count, width))
    C = C0.copy()
    # rows 1..4, columns 2..
    subtract_gram_rows(C, c_row + 2, c_row, X, 0, 4, Z, 0, width, count, width)
    expected = C0.copy()
    expected[1:5, 2 : 2 + width] -= X.T @ Z
    np.testing.assert_allclose(C, expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(C[[0, 5]], C0[[0, 5]])
