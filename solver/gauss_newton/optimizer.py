# SPDX-License-Identifier: GPL-3.0-or-later
"""Levenberg-Marquardt on one frame, through a schedule of stages; one compiled function runs the whole of it.

Every trial point is linearized in the pass that evaluates it, so an accepted step costs one pass and one solve; a
rejected one leaves the kept blocks to be solved again with a larger damping (two sets of blocks, swapped on
acceptance). The damping follows the ratio of the actual decrease to the predicted one, after Nielsen. Rejected or not,
a trial teaches what Gauss-Newton leaves out of the joints' Hessians (curvature.py).
"""

import numpy as np

from ..compiled.kernel import kernel
from .curvature import correct, forget, learn, remember
from .linearize import linearize
from .recursion import eliminate, retract, step

DAMPING_LEAST, DAMPING_MOST = 1e-9, 1e12
CONVERGED, MAX_ITERATIONS, STALLED, NO_MEASUREMENTS, NON_FINITE = range(5)


@kernel
def optimize(  # type: ignore[no-untyped-def]
    tree, terms, measured, stages, tolerances, limits, triggs, damping, root_scale, pose, other_pose, blocks,
    other_blocks, curvature, work,
):
    """Run all stages from `pose`; return (cost, status, iterations, how many were rejected, 1 if the result is in
    `other_pose`).

    stages (S, 2, weights), tolerances (S,), limits (S,). Without measurements, or for a cost that is not finite, the
    pose stays where it is. At the end work.C is the reduced Gauss-Newton system of the result: see `eliminate`.
    """
    cur, nxt, cur_blocks, nxt_blocks, swapped = pose, other_pose, blocks, other_blocks, 0
    cost, status, iterations, rejected = 0.0, CONVERGED, 0, 0
    if not measured:
        cost = linearize(tree, terms, stages[-1], triggs, cur, cur_blocks, work.scratch)
        eliminate(tree, cur, cur_blocks, DAMPING_LEAST, root_scale, work)
        return cost, NO_MEASUREMENTS, iterations, rejected, swapped
    for s in range(stages.shape[0]):
        stage = stages[s]
        lam, grow = damping, 2.0
        cost = linearize(tree, terms, stage, triggs, cur, cur_blocks, work.scratch)
        if not np.isfinite(cost):
            status = NON_FINITE
            break
        forget(curvature)
        remember(tree, cur, cur_blocks, curvature)
        status = MAX_ITERATIONS
        for _ in range(limits[s]):
            correct(tree, cur, cur_blocks, curvature, 1.0)
            predicted = step(tree, cur, cur_blocks, lam, root_scale, work)
            if predicted <= 1e-13 * cost:
                status = CONVERGED
                break
            iterations += 1
            trial_cost = np.inf
            if np.isfinite(predicted):
                retract(tree, cur, work, nxt)
                trial_cost = linearize(tree, terms, stage, triggs, nxt, nxt_blocks, work.scratch)
            better = trial_cost < cost  # False for NaN
            if np.isfinite(trial_cost):
                learn(tree, cur, work.u, nxt, nxt_blocks, better, curvature)
            if better:
                decrease = cost - trial_cost
                small = decrease <= tolerances[s] * cost
                gain = 2.0 * decrease / predicted - 1.0
                lam = min(max(lam * max(1.0 / 9.0, 1.0 - gain * gain * gain), DAMPING_LEAST), DAMPING_MOST)
                grow = 2.0
                cost = trial_cost
                cur, nxt = nxt, cur
                cur_blocks, nxt_blocks = nxt_blocks, cur_blocks
                swapped = 1 - swapped
                remember(tree, cur, cur_blocks, curvature)
                if small:
                    status = CONVERGED
                    break
            else:
                rejected += 1
                lam *= grow
                grow *= 2.0
                if lam > DAMPING_MOST:
                    status = STALLED
                    break
        correct(tree, cur, cur_blocks, curvature, 0.0)
    eliminate(tree, cur, cur_blocks, DAMPING_LEAST, root_scale, work)
    return cost, status, iterations, rejected, swapped
