# SPDX-License-Identifier: Apache-2.0
"""The loops of a Gauss-Newton step over the shape's columns, and over joints with a learned prior,
in plain numba.

Rows are those of `Blocks` and `Workspace`: [6 for the twist | gradient | 0 | W for the shape].
Vectors of 3 numbers, 3 x 3 matrices of 9 by rows and symmetric ones of 6, the upper triangle by
rows, come in as tuples.
"""

from collections.abc import Callable
from typing import Any

from ..kernel import inlined_kernel, kernel
from ..part import GRADIENT, SHAPE

LANES = 8  # joints side by side in a row of joint_flow's tables
STATE = 13  # numbers of a joint's state there


@kernel
def place_origin(D_parent, R_parent, S, D) -> None:  # type: ignore[no-untyped-def]
    """D = D_par + R_par S: how a part's origin moves with the shape. R_par (9); the rest (3, W)."""
    for r in range(3):
        a = R_parent[3 * r]
        b = R_parent[3 * r + 1]
        c = R_parent[3 * r + 2]
        for k in range(S.shape[1]):
            D[r, k] = D_parent[r, k] + a * S[0, k] + b * S[1, k] + c * S[2, k]


@kernel
def add_point(V, R, W, W_all, eW_all, g, B, C, c, moved) -> None:  # type: ignore[no-untyped-def]
    """Add what a point V (3, W) of a part's shape adds, with V' = R V:

    N += [[e]x W_all; W] V',   C += V'ᵀ W_all V',   c += V'ᵀ g;   N is B (6, 8+W) from `SHAPE` on.
    R and [e]x W_all (9), W and W_all (6), g (3); the first rows of moved (6, W) become V'.
    """
    for k in range(V.shape[1]):
        x = R[0] * V[0, k] + R[1] * V[1, k] + R[2] * V[2, k]
        y = R[3] * V[0, k] + R[4] * V[1, k] + R[5] * V[2, k]
        z = R[6] * V[0, k] + R[7] * V[1, k] + R[8] * V[2, k]
        B[0, SHAPE + k] += eW_all[0] * x + eW_all[1] * y + eW_all[2] * z
        B[1, SHAPE + k] += eW_all[3] * x + eW_all[4] * y + eW_all[5] * z
        B[2, SHAPE + k] += eW_all[6] * x + eW_all[7] * y + eW_all[8] * z
        B[3, SHAPE + k] += W[0] * x + W[1] * y + W[2] * z
        B[4, SHAPE + k] += W[1] * x + W[3] * y + W[4] * z
        B[5, SHAPE + k] += W[2] * x + W[4] * y + W[5] * z
        c[k] += g[0] * x + g[1] * y + g[2] * z
        moved[0, k] = x
        moved[1, k] = y
        moved[2, k] = z
        moved[3, k] = W_all[0] * x + W_all[1] * y + W_all[2] * z
        moved[4, k] = W_all[1] * x + W_all[3] * y + W_all[4] * z
        moved[5, k] = W_all[2] * x + W_all[4] * y + W_all[5] * z
    for a in range(V.shape[1]):
        for b in range(V.shape[1]):
            C[a, b] += (
                moved[0, a] * moved[3, b] + moved[1, a] * moved[4, b] + moved[2, a] * moved[5, b]
            )


@kernel
def add_origin(D, W, Z, f, B, C, c, moved) -> None:  # type: ignore[no-untyped-def]
    """Add the motion D (3, W) of a part's origin to its sums:

    C += HᵀD + DᵀH with H = N_lin + W D / 2,   N_ang += Z D,   N_lin += W D,   c += Dᵀ f.
    W (6), Z (9), f (3); moved (6, W) is overwritten.
    """
    for k in range(D.shape[1]):
        x = D[0, k]
        y = D[1, k]
        z = D[2, k]
        a0 = W[0] * x + W[1] * y + W[2] * z
        a1 = W[1] * x + W[3] * y + W[4] * z
        a2 = W[2] * x + W[4] * y + W[5] * z
        moved[0, k] = B[3, SHAPE + k] + 0.5 * a0
        moved[1, k] = B[4, SHAPE + k] + 0.5 * a1
        moved[2, k] = B[5, SHAPE + k] + 0.5 * a2
        B[0, SHAPE + k] += Z[0] * x + Z[1] * y + Z[2] * z
        B[1, SHAPE + k] += Z[3] * x + Z[4] * y + Z[5] * z
        B[2, SHAPE + k] += Z[6] * x + Z[7] * y + Z[8] * z
        B[3, SHAPE + k] += a0
        B[4, SHAPE + k] += a1
        B[5, SHAPE + k] += a2
        c[k] += f[0] * x + f[1] * y + f[2] * z
    for a in range(D.shape[1]):
        for b in range(D.shape[1]):
            for r in range(3):
                C[a, b] += moved[r, a] * D[r, b] + D[r, a] * moved[r, b]


@kernel
def take_moment(A, s, Y) -> None:  # type: ignore[no-untyped-def]
    """Y = UᵀA = A_ang - s x A_lin: the moment about a joint at s (3). A (6, 8+W), Y (3, 8+W)."""
    for k in range(A.shape[1]):
        Y[0, k] = A[0, k] - (s[1] * A[5, k] - s[2] * A[4, k])
        Y[1, k] = A[1, k] - (s[2] * A[3, k] - s[0] * A[5, k])
        Y[2, k] = A[2, k] - (s[0] * A[4, k] - s[1] * A[3, k])


@kernel
def scale_rows(F, Y) -> None:  # type: ignore[no-untyped-def]
    """Y <- L^-1 Y; F: L^-1 by rows of its lower triangle (6), Y (3, 8+W)."""
    for k in range(Y.shape[1]):
        y0 = Y[0, k]
        y1 = Y[1, k]
        y2 = Y[2, k]
        Y[0, k] = F[0] * y0
        Y[1, k] = F[1] * y0 + F[2] * y1
        Y[2, k] = F[3] * y0 + F[4] * y1 + F[5] * y2


@kernel
def add_to_parent(A, Y, A_parent) -> None:  # type: ignore[no-untyped-def]
    """A_par += A - Y~ᵀY~, what a joint leaves of its subtree. A and A_par (6, 8+W), Y~ (3, 8+W)."""
    for r in range(6):
        y0 = Y[0, r]
        y1 = Y[1, r]
        y2 = Y[2, r]
        for k in range(A.shape[1]):
            A_parent[r, k] += A[r, k] - y0 * Y[0, k] - y1 * Y[1, k] - y2 * Y[2, k]


@kernel
def subtract_eliminated(Y, C, c) -> None:  # type: ignore[no-untyped-def]
    """C -= E~ᵀE~ and c -= E~ᵀq~, what the rows (., 8+W) of [. | q~ | 0 | E~] leave of the shape."""
    for r in range(Y.shape[0]):
        for a in range(C.shape[0]):
            c[a] -= Y[r, GRADIENT] * Y[r, SHAPE + a]
            for b in range(C.shape[0]):
                C[a, b] -= Y[r, SHAPE + a] * Y[r, SHAPE + b]


def in_lanes(formula: Callable[..., Any]) -> Any:
    """Return `apply(table, at, state)` for kernels: state <- formula(q, at, n, state) of each lane.

    Entry k of a lane's state is state[k LANES + lane], its parameter k is table[at + k LANES +
    lane]; both arrays are float64 and flat, or views that are.
    """

    def apply(table, at, state):  # type: ignore[no-untyped-def]
        for lane in range(LANES):
            found = formula(table, at + lane, LANES, _state_of(state, lane))
            for k in range(STATE):
                state[k * LANES + lane] = found[k]

    # Numba tells the code of functions apart by their names.
    apply.__name__ = f"{formula.__name__}_in_lanes"
    apply.__qualname__ = apply.__name__
    return inlined_kernel(apply)


@inlined_kernel
def _state_of(state, lane):  # type: ignore[no-untyped-def]
    """Return the state of a lane."""
    return (
        state[lane], state[LANES + lane], state[2 * LANES + lane], state[3 * LANES + lane],
        state[4 * LANES + lane], state[5 * LANES + lane], state[6 * LANES + lane],
        state[7 * LANES + lane], state[8 * LANES + lane], state[9 * LANES + lane],
        state[10 * LANES + lane], state[11 * LANES + lane], state[12 * LANES + lane],
    )  # fmt: skip
