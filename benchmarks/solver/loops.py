# SPDX-License-Identifier: GPL-3.0-or-later
"""Compiled loops around the timed code, so that no call from Python is part of the measurement."""

from ...solver.gauss_newton.curvature import apply_correction, set_current, update
from ...solver.gauss_newton.linearize import linearize
from ...solver.gauss_newton.recursion import retract, step
from ...solver.kernel import kernel
from ...solver.residuals.registry import accumulate_tables


@kernel
def put(bank, k, pose):  # type: ignore[no-untyped-def]
    """Set the unknowns of `pose` to state k of the bank."""
    b = k % bank[0].shape[0]
    n = pose.Omega.shape[0]
    W = pose.beta.shape[0]
    for r in range(3):
        pose.t[0, r] = bank[1][b, r]
        for c in range(3):
            pose.R[0, r, c] = bank[0][b, r, c]
            for i in range(n):
                pose.Omega[i, r, c] = bank[2][b, i, r, c]
    for a in range(W):
        pose.beta[a] = bank[3][b, a]


@kernel
def steps(  # type: ignore[no-untyped-def]
    count, tree, terms, stage, damping, root_scale, bank, pose, blocks, work
):
    """Linearize and solve `count` times; return something that depends on all of it."""
    total = 0.0
    for k in range(count):
        put(bank, k, pose)
        total += linearize(tree, terms, stage, pose, blocks, work.scratch)
        total += step(tree, pose, blocks, damping, root_scale, work)
    return total


@kernel
def iterations(  # type: ignore[no-untyped-def]
    count,
    tree,
    terms,
    stage,
    damping,
    root_scale,
    bank,
    pose,
    trial,
    blocks,
    other,
    curvature,
    work,
):
    """Solve, move and linearize at the trial point `count` times: an iteration, accepted or
    rejected.
    """
    put(bank, 0, pose)
    total = linearize(tree, terms, stage, pose, blocks, work.scratch)
    for k in range(count):
        put(bank, k, pose)
        apply_correction(tree, pose, blocks, curvature, 1.0)
        total += step(tree, pose, blocks, damping, root_scale, work)
        retract(tree, pose, work, trial)
        total += linearize(tree, terms, stage, trial, other, work.scratch)
        update(tree, pose, work.u, trial, other, True, curvature)
        set_current(tree, trial, other, curvature)
    return total


@kernel
def priors(count, tree, terms, stage, bank, pose, blocks):  # type: ignore[no-untyped-def]
    """Evaluate the tables of residuals alone, with Jacobian and their sums, `count` times."""
    total = 0.0
    for k in range(count):
        put(bank, k, pose)
        total += accumulate_tables(tree, terms.ints, terms.floats, stage[0], pose, blocks)
    return total
