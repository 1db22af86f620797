# SPDX-License-Identifier: Apache-2.0
"""Vectors and 3 x 3 matrices as tuples of numbers, for kernels: nothing is allocated.

Vectors have 3 numbers, matrices 9 by rows, and symmetric ones the 6 of their upper triangle by
rows.
"""

from typing import Any

from numba.extending import register_jitable

from .kernel import expanded_kernel

MINUS_EYE = (-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0)

formula: Any = register_jitable  # Python runs such a function as it is; kernels may call it


@expanded_kernel
def entries(R):  # type: ignore[no-untyped-def]
    """Return the nine entries of an array R (3, 3)."""
    return (
        R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2], R[2, 0], R[2, 1], R[2, 2],
    )  # fmt: skip


@expanded_kernel
def write_entries(a, M) -> None:  # type: ignore[no-untyped-def]
    """Write nine entries to an array M (3, 3)."""
    for r in range(3):
        for c in range(3):
            M[r, c] = a[3 * r + c]


@formula
def transposed(a):  # type: ignore[no-untyped-def]
    """Return Aᵀ."""
    return a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]


@formula
def product(a, b):  # type: ignore[no-untyped-def]
    """Return A B."""
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


@formula
def rotated(a, v):  # type: ignore[no-untyped-def]
    """Return A v."""
    return (
        a[0] * v[0] + a[1] * v[1] + a[2] * v[2],
        a[3] * v[0] + a[4] * v[1] + a[5] * v[2],
        a[6] * v[0] + a[7] * v[1] + a[8] * v[2],
    )


@formula
def determinant(a):  # type: ignore[no-untyped-def]
    """Return det A."""
    return (
        a[0] * (a[4] * a[8] - a[5] * a[7])
        + a[1] * (a[5] * a[6] - a[3] * a[8])
        + a[2] * (a[3] * a[7] - a[4] * a[6])
    )


@formula
def upper(a):  # type: ignore[no-untyped-def]
    """Return the upper triangle of a matrix."""
    return a[0], a[1], a[2], a[4], a[5], a[8]


@formula
def symmetric(h):  # type: ignore[no-untyped-def]
    """Return all of a symmetric matrix."""
    return h[0], h[1], h[2], h[1], h[3], h[4], h[2], h[4], h[5]


@formula
def turned(a, h):  # type: ignore[no-untyped-def]
    """Return A H Aᵀ, of a symmetric H symmetric too."""
    return upper(product(product(a, symmetric(h)), transposed(a)))


@formula
def outer(w, a, b, c):  # type: ignore[no-untyped-def]
    """Return w (a, b, c)ᵀ(a, b, c), symmetric."""
    return w * a * a, w * a * b, w * a * c, w * b * b, w * b * c, w * c * c


@expanded_kernel
def add3(a, b):  # type: ignore[no-untyped-def]
    """Return a + b of vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@expanded_kernel
def add6(a, b):  # type: ignore[no-untyped-def]
    """Return A + B of symmetric matrices."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@expanded_kernel
def add9(a, b):  # type: ignore[no-untyped-def]
    """Return A + B."""
    return (
        a[0] + b[0],
        a[1] + b[1],
        a[2] + b[2],
        a[3] + b[3],
        a[4] + b[4],
        a[5] + b[5],
        a[6] + b[6],
        a[7] + b[7],
        a[8] + b[8],
    )


@expanded_kernel
def add_cross(m, a, b):  # type: ignore[no-untyped-def]
    """Return m + a x b."""
    return (
        m[0] + a[1] * b[2] - a[2] * b[1],
        m[1] + a[2] * b[0] - a[0] * b[2],
        m[2] + a[0] * b[1] - a[1] * b[0],
    )


@expanded_kernel
def cross_symmetric(a, w):  # type: ignore[no-untyped-def]
    """Return [a]x W of a symmetric W."""
    x, y, z = a
    w00, w01, w02, w11, w12, w22 = w
    return (
        y * w02 - z * w01, y * w12 - z * w11, y * w22 - z * w12,
        z * w00 - x * w02, z * w01 - x * w12, z * w02 - x * w22,
        x * w01 - y * w00, x * w11 - y * w01, x * w12 - y * w02,
    )  # fmt: skip


@expanded_kernel
def cross_both(a, b):  # type: ignore[no-untyped-def]
    """Return [a]x W [a]xᵀ of a symmetric W, symmetric; b is [a]x W."""
    x, y, z = a
    return (
        y * b[2] - z * b[1], z * b[0] - x * b[2], x * b[1] - y * b[0],
        z * b[3] - x * b[5], x * b[4] - y * b[3], x * b[7] - y * b[6],
    )  # fmt: skip
