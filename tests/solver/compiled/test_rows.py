# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows in vector registers, against numpy: widths, offsets inside larger arrays, and nothing beside
them written.
"""

import numpy as np
import pytest
from scope.solver.compiled import rows
from scope.solver.compiled.kernel import kernel


@kernel
def _all(a, d, src, s, n, results) -> None:
    rows.clear(results, d, n)
    rows.copy(results, 1000 + d, src, s, n)
    rows.add1(results, 2000 + d, a[0], src, s, n)
    rows.add3(results, 3000 + d, a[0], a[1], a[2], src, s, s + 100, s + 7, n)


@pytest.mark.parametrize("n", [0, 4, 8, 12, 40, 76])
def test_operations_are_those_of_numpy(n: int) -> None:
    rng = np.random.default_rng(n)
    src = rng.normal(size=300)
    before = rng.normal(size=4000)
    a = rng.normal(size=3)
    d = 13
    s = 5
    expected = before.copy()
    expected[d : d + n] = 0.0
    expected[1000 + d : 1000 + d + n] = src[s : s + n]
    expected[2000 + d : 2000 + d + n] += a[0] * src[s : s + n]
    expected[3000 + d : 3000 + d + n] += (
        a[0] * src[s : s + n] + a[1] * src[s + 100 : s + 100 + n] + a[2] * src[s + 7 : s + 7 + n]
    )
    found = before.copy()
    _all(a, d, src, s, n, found)
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13)
    untouched = np.isin(
        np.arange(4000), [k + d + i for k in (0, 1000, 2000, 3000) for i in range(n)], invert=True
    )
    np.testing.assert_array_equal(found[untouched], before[untouched])


@pytest.mark.parametrize(("n", "expected"), [(0, 0), (1, 4), (4, 4), (5, 8), (16, 16), (17, 20)])
def test_a_row_is_padded_to_whole_vectors(n: int, expected: int) -> None:
    assert rows.padded(n) == expected
