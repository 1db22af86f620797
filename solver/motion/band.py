# SPDX-License-Identifier: Apache-2.0
r"""Block-banded Cholesky over time, with an arrowhead of global columns: the exact step of a clip
in O(T).

Frame f is coupled to f+1 and f+2 and to the global columns. Its rows of the front, once the frames
before it have been eliminated, are factorized in place,
    [S | E_1 | E_2 | g N] -> L^-1 [S | E_1 | E_2 | g N] = Z,   S = L Lᵀ
and Z without its first block takes ZᵀZ from what follows. The clip is eliminated from both of its
ends, each in a thread of its own, and the ends meet at two frames in the middle; what is left are
the global columns.
    d_f = -L^-ᵀ (q + E_1 d_{f+1} + E_2 d_{f+2} + N dg)   in opposite order
The factorization from both ends of a banded matrix is known as the twisted one.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from ..gauss_newton.recursion import factorize, solve_globals
from ..kernel import kernel
from ..part import Array
from ..tree import Tree
from .system import GLOBALS, ClipSystem


class Factor(NamedTuple):
    """The factor of a clip, and the step. n and W as in `ClipSystem`."""

    Z: Array  # (T, n, 3 n + 4 + W)
    trails: (
        # (2, 2 n + 4 + W, 2 n + 4 + W): what is left of the two frames that follow, and of the
        # global columns
        Array
    )
    d: Array  # (T, n)
    C: Array  # (W, W), the reduced system of the global columns, then its factor
    c: Array  # (W,)
    dg: Array  # (W,)


def make_factor(system: ClipSystem) -> Factor:
    """Return the memory for the factor of a system of that size."""
    frames, n, q = system.N.shape
    W = len(system.c)
    trails = np.zeros((2, 2 * n + q, 2 * n + q))
    return Factor(
        np.zeros((frames, n, 3 * n + q)),
        trails,
        np.zeros((frames, n)),
        np.zeros((W, W)),
        *np.zeros((2, W)),
    )


@kernel
def _subtract_four_rows(  # type: ignore[no-untyped-def]
    z0, z1, z2, z3, row0, row1, row2, row3, target
) -> None:
    """Subtract four rows (n,), each times a number, from another."""
    for k in range(target.shape[0]):
        target[k] -= z0 * row0[k] + z1 * row1[k] + z2 * row2[k] + z3 * row3[k]


@kernel
def subtract_products(Z, n: int, trail) -> None:  # type: ignore[no-untyped-def]
    """Subtract ZᵀZ of the columns from n on of Z (n, n + m) from the upper triangle of `trail`
    (m, m).

    n is a multiple of four: four rows at a time, so that each entry is loaded and stored once for
    them.
    """
    m = trail.shape[0]
    for r in range(0, n, 4):
        for a in range(m):
            k = n + a
            _subtract_four_rows(
                Z[r, k], Z[r + 1, k], Z[r + 2, k], Z[r + 3, k],
                Z[r, k:], Z[r + 1, k:], Z[r + 2, k:], Z[r + 3, k:],
                trail[a, a:],
            )  # fmt: skip


@kernel
def _load(system, f, step, damping, root_scale, trail, Z) -> None:  # type: ignore[no-untyped-def]
    """Write frame f's rows of the front: what the frames before have left of it, and its own
    blocks, damped.
    """
    n = system.N.shape[1]
    q = system.N.shape[2]
    D = system.D[f]
    N = system.N[f]
    last = system.D.shape[0] - 1
    for a in range(n):
        for b in range(a, n):
            Z[a, b] = trail[a, b] + D[a, b]
        if a < system.B2.shape[1] * 3:
            Z[a, a] += damping * (root_scale * root_scale if 3 <= a < 6 else 1.0)
        for b in range(n):
            Z[a, n + b] = trail[a, n + b]
        for b in range(n):
            Z[a, 2 * n + b] = 0.0
        for b in range(q):
            Z[a, 3 * n + b] = trail[a, 2 * n + b] + N[a, b]
    for hop in range(1, 3):
        other = f + hop * step
        if 0 <= other <= last:
            blocks = system.B1[max(f, other)] if hop == 1 else system.B2[max(f, other)]
            for k in range(blocks.shape[0]):
                at = 3 if k == blocks.shape[0] - 1 else (0 if k == 0 else 3 + 3 * k)
                for r in range(3):
                    for s in range(3):
                        Z[at + r, hop * n + at + s] += (
                            blocks[k, r, s] if step < 0 else blocks[k, s, r]
                        )
    if 0 <= f + step <= last:
        _load_contacts(system.contacts, f, f + step, n, Z)


@kernel
def _load_contacts(contacts, f, other, n: int, Z) -> None:  # type: ignore[no-untyped-def]
    """Add to frame f's rows of the front what standing points couple it by to its neighbour
    `other`.
    """
    for k in range(contacts.counts.shape[0]):
        w = contacts.w[max(f, other), k]
        if w <= 0.0:
            continue
        own = contacts.J[f, k]
        its = contacts.J[other, k]
        columns = contacts.columns[k]
        for a in range(contacts.counts[k]):
            g0 = w * own[0, a]
            g1 = w * own[1, a]
            g2 = w * own[2, a]
            row = columns[a]
            for b in range(contacts.counts[k]):
                Z[row, n + columns[b]] -= g0 * its[0, b] + g1 * its[1, b] + g2 * its[2, b]


@kernel
def _advance(trail, n: int, q: int) -> None:  # type: ignore[no-untyped-def]
    """Move what is left by one frame: the second of the two becomes the first, and the next is
    still untouched.
    """
    for a in range(n):
        for b in range(a, n):
            trail[a, b] = trail[n + a, n + b]
        for b in range(q):
            trail[a, 2 * n + b] = trail[n + a, 2 * n + b]
        for b in range(n):
            trail[a, n + b] = 0.0
        for b in range(n + q):
            trail[n + a, n + b] = 0.0


@kernel
def eliminate_frames(  # type: ignore[no-untyped-def]
    system, first, count, step, damping, root_scale, trail, Z
) -> None:
    """Eliminate `count` frames from `first` on, upwards or downwards by step 1 or -1.

    `trail` (2 n + q, 2 n + q) is what the frames before have left of these two and of the global
    columns, and becomes what is left of the two that follow.
    """
    n = system.N.shape[1]
    q = system.N.shape[2]
    size = 2 * n + q
    for k in range(count):
        f = first + step * k
        _load(system, f, step, damping, root_scale, trail, Z[f])
        _advance(trail, n, q)
        # Of the last row, only the end belongs to the upper triangle.
        factorize(Z[f], n, trail[size - 1])
        subtract_products(Z[f], n, trail)


@kernel
def substitute_frames(Z, first, count, step, dg, d) -> None:  # type: ignore[no-untyped-def]
    """Fill d of `count` frames, whose elimination ended at `first` and went by `step`, from the
    next two and dg.
    """
    n = Z.shape[1]
    row = Z.shape[2]
    W = dg.shape[0]
    for k in range(count):
        f = first - step * k
        for r in range(n - 1, -1, -1):
            s = -Z[f, r, 3 * n]
            for a in range(W):
                s -= Z[f, r, row - W + a] * dg[a]
            for hop in range(1, 3):
                other = f + hop * step
                if 0 <= other < Z.shape[0]:
                    for b in range(n):
                        s -= Z[f, r, hop * n + b] * d[other, b]
            for b in range(r + 1, n):
                s -= Z[f, r, b] * d[f, b]
            d[f, r] = s * Z[f, r, r]


@kernel
def _join(front, back, n: int, q: int) -> None:  # type: ignore[no-untyped-def]
    """Add what the elimination from the back has left, whose frames come in opposite order, to that
    from the front.
    """
    for a in range(n):
        for b in range(a, n):
            front[a, b] += back[n + a, n + b]
            front[n + a, n + b] += back[a, b]
        for b in range(n):
            front[a, n + b] += back[b, n + a]
        for b in range(q):
            front[a, 2 * n + b] += back[n + a, 2 * n + b]
            front[n + a, 2 * n + b] += back[a, 2 * n + b]
    for a in range(q):
        for b in range(q):
            front[2 * n + a, 2 * n + b] += back[2 * n + a, 2 * n + b]


def eliminate_clip(
    system: ClipSystem,
    damping: float,
    root_scale: float,
    factor: Factor,
    pool: ThreadPoolExecutor | None = None,
) -> None:
    """Factorize the damped system and leave the reduced one of the global columns in factor.C,
    factor.c.

    Damping lambda is added to all unknowns of the poses as in a single frame, lambda s^2 to the
    root's position; `root_scale` is s, radians per metre. With `pool`, a thread of it eliminates
    the second half.
    """
    frames, n, q = system.N.shape
    front, back = factor.trails
    front[:] = 0.0
    back[:] = 0.0
    front[2 * n + GLOBALS :, 2 * n + GLOBALS :] = system.C
    front[2 * n, 2 * n + GLOBALS :] = system.c
    middle = middle_of(frames)
    half = (
        system,
        frames - 1,
        max(frames - 2 - middle, 0),
        -1,
        damping,
        root_scale,
        back,
        factor.Z,
    )
    run_both(
        pool, eliminate_frames, (system, 0, middle, 1, damping, root_scale, front, factor.Z), half
    )
    _join(front, back, n, q)
    end = middle + min(frames, 2)
    without_back = system._replace(D=system.D[:end], N=system.N[:end])
    eliminate_frames(without_back, middle, end - middle, 1, damping, root_scale, front, factor.Z)
    factor.C[:] = front[2 * n + GLOBALS :, 2 * n + GLOBALS :]
    factor.c[:] = front[2 * n, 2 * n + GLOBALS :]


def solve_clip(
    tree: Tree,
    system: ClipSystem,
    damping: float,
    root_scale: float,
    factor: Factor,
    pool: ThreadPoolExecutor | None = None,
) -> float:
    """Fill factor.d and factor.dg with the damped Gauss-Newton step and return the decrease it
    predicts.

    For (H + Lambda) d = -g the decrease of 1/2 dᵀHd + gᵀd is -1/2 gᵀd + 1/2 dᵀ Lambda d; the global
    columns are not damped.
    """
    eliminate_clip(system, damping, root_scale, factor, pool)
    factor.dg[:] = 0.0
    solve_globals(tree, factor.C, factor.c, factor.dg)
    frames = len(factor.d)
    middle = middle_of(len(factor.d))
    both = min(frames, 2)
    factor.d[:] = 0.0
    _substitute_middle(factor, middle, both)
    half = (factor.Z, middle + 2, max(frames - 2 - middle, 0), -1, factor.dg, factor.d)
    run_both(pool, substitute_frames, (factor.Z, middle - 1, middle, 1, factor.dg, factor.d), half)
    moved = np.einsum("fa,fa->", system.N[:, :, 0], factor.d) + system.c @ factor.dg
    damped = np.sum(factor.d**2) + (root_scale**2 - 1.0) * np.sum(factor.d[:, 3:6] ** 2)
    return float(0.5 * (damping * damped - moved))


def run_both(
    pool: ThreadPoolExecutor | None, kernel: Any, front: tuple[Any, ...], back: tuple[Any, ...]
) -> None:
    """Run a kernel on both halves of a clip, the second in a thread of the pool if there is one."""
    waiting = None if pool is None else pool.submit(kernel, *back)
    kernel(*front)
    if waiting is None:
        kernel(*back)
    else:
        waiting.result()


def middle_of(frames: int) -> int:
    """Return the first of the two frames at which the eliminations from both ends meet."""
    return max(frames // 2 - 1, 0)


def _substitute_middle(factor: Factor, middle: int, both: int) -> None:
    """Fill d of the last frames eliminated, whose front reaches no others."""
    for f in range(middle + both - 1, middle - 1, -1):
        substitute_frames(
            factor.Z[middle : middle + both],
            f - middle,
            1,
            1,
            factor.dg,
            factor.d[middle : middle + both],
        )
