# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums of Gauss-Newton terms over the points of one part, in plain numbers, and their shift to the
pelvis.

Vectors are tuples of 3 numbers, 3 x 3 matrices of 9 by rows, symmetric ones of the 6 of their upper
triangle by rows.
"""

from ..compiled.kernel import expanded_kernel
from ..compiled.part import GRADIENT


@expanded_kernel
def add3(a, b):  # type: ignore[no-untyped-def]
    """Return a + b, three numbers each."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@expanded_kernel
def add6(a, b):  # type: ignore[no-untyped-def]
    """Return a + b, six numbers each."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@expanded_kernel
def add9(a, b):  # type: ignore[no-untyped-def]
    """Return a + b, nine numbers each."""
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
def rotate(r, v):  # type: ignore[no-untyped-def]
    """Return R v; r: R by rows (9), v (3)."""
    x, y, z = v
    return (
        r[0] * x + r[1] * y + r[2] * z,
        r[3] * x + r[4] * y + r[5] * z,
        r[6] * x + r[7] * y + r[8] * z,
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
    """Return [a]x W by rows (9); w: the upper triangle of a symmetric W by rows (6)."""
    x, y, z = a
    w00, w01, w02, w11, w12, w22 = w
    return (
        y * w02 - z * w01, y * w12 - z * w11, y * w22 - z * w12,
        z * w00 - x * w02, z * w01 - x * w12, z * w02 - x * w22,
        x * w01 - y * w00, x * w11 - y * w01, x * w12 - y * w02,
    )  # fmt: skip


@expanded_kernel
def cross_both(a, b):  # type: ignore[no-untyped-def]
    """Return the upper triangle by rows (6) of [a]x W [a]xᵀ; b: [a]x W by rows (9)."""
    x, y, z = a
    return (
        y * b[2] - z * b[1], z * b[0] - x * b[2], x * b[1] - y * b[0],
        z * b[3] - x * b[5], x * b[4] - y * b[3], x * b[7] - y * b[6],
    )  # fmt: skip


@expanded_kernel
def shift_corner(s, x, a):  # type: ignore[no-untyped-def]
    """Return Z = X + [s]x A, the corner of M about the pelvis; s: the part's origin from there."""
    sx, sy, sz = s
    a00, a01, a02, a11, a12, a22 = a
    return (
        x[0] + sy * a02 - sz * a01, x[1] + sy * a12 - sz * a11, x[2] + sy * a22 - sz * a12,
        x[3] + sz * a00 - sx * a02, x[4] + sz * a01 - sx * a12, x[5] + sz * a02 - sx * a22,
        x[6] + sx * a01 - sy * a00, x[7] + sx * a11 - sy * a01, x[8] + sx * a12 - sy * a02,
    )  # fmt: skip


@expanded_kernel
def shift_angular(s, y, x, z):  # type: ignore[no-untyped-def]
    """Return Y + X [s]xᵀ + [s]x Zᵀ, the angular block of M about the pelvis: its upper triangle by
    rows (6).
    """
    sx, sy, sz = s
    y00, y01, y02, y11, y12, y22 = y
    y00 += sy * x[2] - sz * x[1] + sy * z[2] - sz * z[1]
    y01 += sz * x[0] - sx * x[2] + sy * z[5] - sz * z[4]
    y02 += sx * x[1] - sy * x[0] + sy * z[8] - sz * z[7]
    y11 += sz * x[3] - sx * x[5] + sz * z[3] - sx * z[5]
    y12 += sx * x[4] - sy * x[3] + sz * z[6] - sx * z[8]
    y22 += sx * x[7] - sy * x[6] + sx * z[7] - sy * z[6]
    return y00, y01, y02, y11, y12, y22


@expanded_kernel
def write_part(B, y, z, a, s, f, m):  # type: ignore[no-untyped-def]
    """Write M = [[Y, Z], [Zᵀ, A]], the force f and its moment m + s x f to a part's block B (6,
    8+W).
    """
    B[0, 0] = y[0]
    B[0, 1] = y[1]
    B[0, 2] = y[2]
    B[0, 3] = z[0]
    B[0, 4] = z[1]
    B[0, 5] = z[2]
    B[1, 0] = y[1]
    B[1, 1] = y[3]
    B[1, 2] = y[4]
    B[1, 3] = z[3]
    B[1, 4] = z[4]
    B[1, 5] = z[5]
    B[2, 0] = y[2]
    B[2, 1] = y[4]
    B[2, 2] = y[5]
    B[2, 3] = z[6]
    B[2, 4] = z[7]
    B[2, 5] = z[8]
    B[3, 0] = z[0]
    B[3, 1] = z[3]
    B[3, 2] = z[6]
    B[3, 3] = a[0]
    B[3, 4] = a[1]
    B[3, 5] = a[2]
    B[4, 0] = z[1]
    B[4, 1] = z[4]
    B[4, 2] = z[7]
    B[4, 3] = a[1]
    B[4, 4] = a[3]
    B[4, 5] = a[4]
    B[5, 0] = z[2]
    B[5, 1] = z[5]
    B[5, 2] = z[8]
    B[5, 3] = a[2]
    B[5, 4] = a[4]
    B[5, 5] = a[5]
    B[0, GRADIENT], B[1, GRADIENT], B[2, GRADIENT] = add_cross(m, s, f)
    B[3, GRADIENT], B[4, GRADIENT], B[5, GRADIENT] = f
