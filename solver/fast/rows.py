# SPDX-License-Identifier: Apache-2.0
"""The functions of gauss_newton/plain_rows.py, four columns at a time; see there what they compute.

Each formula below is run once for every four columns, with all of their rows in registers. Of
products such as C += XᵀZ, four rows of C are a pass over three rows of Z; only vectors on and above
the diagonal are touched.
"""

from typing import Any

from ..kernel import expanded_kernel, kernel
from ..part import GRADIENT, SHAPE
from ..tree import WIDTH
from .vectors import in_lanes as in_lanes
from .vectors import row_pass


def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _times(a: Any, b: Any) -> Any:
    """Return A b of a symmetric A, given by rows of its upper triangle."""
    return [_dot(row, b) for row in ([a[0], a[1], a[2]], [a[1], a[3], a[4]], [a[2], a[4], a[5]])]


def _place_formula(s, D_parent, S, D):  # type: ignore[no-untyped-def]
    """s: R_par (9)."""
    return [], [], [D_parent[r] + _dot(s[3 * r : 3 * r + 3], S) for r in range(3)]


def _point_formula(s, N, V, moved):  # type: ignore[no-untyped-def]
    """s: R (9), [e]x W_all (9), W (6), W_all (6)."""
    turned = [_dot(s[3 * r : 3 * r + 3], V) for r in range(3)]
    angular = [N[r] + _dot(s[9 + 3 * r : 12 + 3 * r], turned) for r in range(3)]
    linear = [N[3 + r] + more for r, more in enumerate(_times(s[18:24], turned))]
    return angular + linear, [], turned + _times(s[24:30], turned)


def _origin_formula(s, N, D, moved):  # type: ignore[no-untyped-def]
    """s: W (6), Z (9), one half; moved: H."""
    WD = _times(s[:6], D)
    angular = [N[r] + _dot(s[6 + 3 * r : 9 + 3 * r], D) for r in range(3)]
    linear = [N[3 + r] + WD[r] for r in range(3)]
    return angular + linear, [], [N[3 + r] + WD[r] * s[15] for r in range(3)]


def _add_rows(c: Any, s: Any, X: Any) -> Any:
    return c + X[0] * s[0] + X[1] * s[1] + X[2] * s[2]


def _add_formula(s, c, X, _):  # type: ignore[no-untyped-def]
    """Return c + Xᵀ s."""
    return [_add_rows(c[0], s, X)], [], []


def _product_formula(s, C, Z, _):  # type: ignore[no-untyped-def]
    """Return four rows of C + XᵀZ; s: X by columns (12)."""
    return [_add_rows(C[r], s[3 * r : 3 * r + 3], Z) for r in range(4)], [], []


def _moment_formula(s, A, Y, _):  # type: ignore[no-untyped-def]
    """s: the joint (3)."""
    x, y, z = s
    turned = [y * A[5] - z * A[4], z * A[3] - x * A[5], x * A[4] - y * A[3]]
    return [], [A[r] - turned[r] for r in range(3)], []


def _scale_formula(s, Y, _, __):  # type: ignore[no-untyped-def]
    """s: L^-1 by rows of its lower triangle (6)."""
    return [Y[0] * s[0], Y[0] * s[1] + Y[1] * s[2], Y[0] * s[3] + Y[1] * s[4] + Y[2] * s[5]], [], []


def _parent_formula(s, A_parent, A, Y):  # type: ignore[no-untyped-def]
    """s: the first six columns of Y~ (18), three numbers each."""
    out = []
    for r in range(6):
        out.append(A_parent[r] + A[r] - Y[0] * s[3 * r] - Y[1] * s[3 * r + 1] - Y[2] * s[3 * r + 2])
    return out, [], []


_place = row_pass(_place_formula, (3, 3, 3))
_point = row_pass(_point_formula, (6, 3, 6))
_origin = row_pass(_origin_formula, (6, 3, 3))
_add = row_pass(_add_formula, (1, 3, 0))
_product = row_pass(_product_formula, (4, 3, 0))
_moment = row_pass(_moment_formula, (6, 3, 0))
_scale = row_pass(_scale_formula, (3, 0, 0))
_parent = row_pass(_parent_formula, (6, 6, 3))


@expanded_kernel
def _add_product(C, sign, X, x, Z, z) -> None:  # type: ignore[no-untyped-def]
    """C += sign XᵀZ in the upper triangle of C (W, W), at least.

    The last W columns of three rows each: of X from row x on, and of Z from z on.
    """
    W = C.shape[0]
    row = Z.shape[1]
    X0 = X[x, X.shape[1] - W :]
    X1 = X[x + 1, X.shape[1] - W :]
    X2 = X[x + 2, X.shape[1] - W :]
    for a in range(0, W, WIDTH):
        factors = (
            sign * X0[a], sign * X1[a], sign * X2[a],
            sign * X0[a + 1], sign * X1[a + 1], sign * X2[a + 1],
            sign * X0[a + 2], sign * X1[a + 2], sign * X2[a + 2],
            sign * X0[a + 3], sign * X1[a + 3], sign * X2[a + 3],
        )  # fmt: skip
        _product(factors, W - a, C, a * W + a, W, Z, (z + 1) * row - W + a, row, Z, 0, row)


@kernel
def place_origin(D_parent, R_parent, S, D) -> None:  # type: ignore[no-untyped-def]
    """D = D_par + R_par S."""
    W = S.shape[1]
    _place(R_parent, W, D_parent, 0, W, S, 0, W, D, 0, W)


@kernel
def add_point(V, R, W, W_all, eW_all, g, B, C, c, moved) -> None:  # type: ignore[no-untyped-def]
    """N += [[e]x W_all; W] V',   C += V'ᵀ W_all V',   c += V'ᵀ g."""
    n = V.shape[1]
    _point(R + eW_all + W + W_all, n, B, SHAPE, B.shape[1], V, 0, n, moved, 0, n)
    _add(g, n, c, 0, n, moved, 0, n, moved, 0, n)
    _add_product(C, 1.0, moved, 0, moved, 3)


@kernel
def add_origin(D, W, Z, f, B, C, c, moved) -> None:  # type: ignore[no-untyped-def]
    """C += HᵀD + DᵀH,   N_ang += Z D,   N_lin += W D,   c += Dᵀ f."""
    n = D.shape[1]
    _origin(W + Z + (0.5,), n, B, SHAPE, B.shape[1], D, 0, n, moved, 0, n)
    _add(f, n, c, 0, n, D, 0, n, D, 0, n)
    _add_product(C, 1.0, moved, 0, D, 0)
    _add_product(C, 1.0, D, 0, moved, 0)


@kernel
def take_moment(A, s, Y) -> None:  # type: ignore[no-untyped-def]
    """Y = A_ang - s x A_lin."""
    n = A.shape[1]
    _moment(s, n, A, 0, n, Y, 0, n, Y, 0, n)


@kernel
def scale_rows(F, Y) -> None:  # type: ignore[no-untyped-def]
    """Y <- L^-1 Y."""
    n = Y.shape[1]
    _scale(F, n, Y, 0, n, Y, 0, n, Y, 0, n)


@kernel
def add_to_parent(A, Y, A_parent) -> None:  # type: ignore[no-untyped-def]
    """A_par += A - Y~ᵀY~."""
    n = A.shape[1]
    columns = (
        Y[0, 0], Y[1, 0], Y[2, 0], Y[0, 1], Y[1, 1], Y[2, 1], Y[0, 2], Y[1, 2], Y[2, 2],
        Y[0, 3], Y[1, 3], Y[2, 3], Y[0, 4], Y[1, 4], Y[2, 4], Y[0, 5], Y[1, 5], Y[2, 5],
    )  # fmt: skip
    _parent(columns, n, A_parent, 0, n, A, 0, n, Y, 0, n)


@kernel
def subtract_eliminated(Y, C, c) -> None:  # type: ignore[no-untyped-def]
    """C -= E~ᵀE~,   c -= E~ᵀq~."""
    W = C.shape[0]
    n = Y.shape[1]
    for r in range(0, Y.shape[0], 3):
        q = (-Y[r, GRADIENT], -Y[r + 1, GRADIENT], -Y[r + 2, GRADIENT])
        _add(q, W, c, 0, W, Y, r * n + SHAPE, n, Y, 0, n)
        _add_product(C, -1.0, Y, r, Y, r)
