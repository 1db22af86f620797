# SPDX-License-Identifier: GPL-3.0-or-later
"""Levenberg-Marquardt on one frame, through a schedule of stages; one compiled function runs the whole of it.

Every trial point is linearized in the pass that evaluates it, so an accepted step costs one pass and one solve; a
rejected one leaves the kept blocks to be solved again with a larger damping (two sets of blocks, swapped on
acceptance). The damping follows the ratio of the actual decrease to the predicted one, after Nielsen.
"""

import numpy as np

from .initialize import initial_state
from .kernel import kernel
from .linearize import linearize, make_blocks, make_pose
from .measurements import Measurements
from .options import COLD_STAGES, WARM_STAGES, Options, Priors, default_priors
from .recursion import Workspace, eliminate, make_workspace, retract, step
from .residuals.part import Array, Blocks, Pose
from .residuals.registry import SHAPE_PRIOR
from .state import Fit, State, Status
from .terms import Terms, make_terms
from .tree import BodyArrays, Tree, make_tree

DAMPING_LEAST, DAMPING_MOST = 1e-9, 1e12
CONVERGED, MAX_ITERATIONS, STALLED, NON_FINITE = 0, 1, 2, 4


@kernel
def optimize(  # type: ignore[no-untyped-def]
    tree, terms, stages, tolerances, limits, triggs, damping, root_scale, pose, other_pose, blocks, other_blocks, work
):
    """Run all stages from `pose` and return (cost, status, iterations, 1 if the result is in `other_pose`).

    The blocks of the result lie in the set that belongs to it. stages (S, 2, weights), tolerances (S,), limits (S,).
    """
    cur, nxt, cur_blocks, nxt_blocks, swapped = pose, other_pose, blocks, other_blocks, 0
    cost, status, iterations = 0.0, CONVERGED, 0
    for s in range(stages.shape[0]):
        stage = stages[s]
        lam, grow = damping, 2.0
        cost = linearize(tree, terms, stage, triggs, cur, cur_blocks, work.scratch)
        if not np.isfinite(cost):
            return cost, NON_FINITE, iterations, swapped
        status = MAX_ITERATIONS
        for _ in range(limits[s]):
            predicted = step(tree, cur, cur_blocks, lam, root_scale, work)
            if predicted <= 1e-13 * cost:
                status = CONVERGED
                break
            iterations += 1
            trial_cost = np.inf
            if np.isfinite(predicted):
                retract(tree, cur, work, nxt)
                trial_cost = linearize(tree, terms, stage, triggs, nxt, nxt_blocks, work.scratch)
            if trial_cost < cost:  # False for NaN
                decrease = cost - trial_cost
                small = decrease <= tolerances[s] * cost
                gain = 2.0 * decrease / predicted - 1.0
                lam = min(max(lam * max(1.0 / 9.0, 1.0 - gain * gain * gain), DAMPING_LEAST), DAMPING_MOST)
                grow = 2.0
                cost = trial_cost
                cur, nxt = nxt, cur
                cur_blocks, nxt_blocks = nxt_blocks, cur_blocks
                swapped = 1 - swapped
                if small:
                    status = CONVERGED
                    break
            else:
                lam *= grow
                grow *= 2.0
                if lam > DAMPING_MOST:
                    status = STALLED
                    break
    return cost, status, iterations, swapped


def fit(
    body: BodyArrays,
    measurements: Measurements,
    *,
    init: State | None = None,
    priors: Priors | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
) -> Fit:
    """Fit pose and shape to one frame.

    minimize 1/2 sum_i |r_i(T_i, Omega_i, beta)|^2 over T_0, Omega_1..K and beta (section 3 of the paper).

    With `init` (camera frame, metres) the fit starts there, in one stage; without, from a guess by `initial_state`,
    in several. `priors` default to the body's joint limits and the population's shape. Raises ShapeError for arrays
    that do not fit the body; never for values: see Status.
    """
    return fit_tree(make_tree(body), measurements, init, default_priors(body) if priors is None else priors, options)


def fit_tree(tree: Tree, measurements: Measurements, init: State | None, priors: Priors, options: Options) -> Fit:
    """`fit` on a tree that has been made already: what to call frame after frame."""
    terms = make_terms(tree, measurements, priors)
    stages = options.stages or (COLD_STAGES if init is None else WARM_STAGES)
    table, tolerances, limits = options.stage_table(stages)
    if init is None:
        K, P = len(tree.parents) - 1, tree.shape
        mean = np.tile(np.eye(3), (K, 1, 1)) if priors.joint_mean is None else np.asarray(priors.joint_mean, float)
        beta = np.zeros(P) if priors.shape_mean is None else np.asarray(priors.shape_mean, float)
        init = initial_state(tree, terms, mean, beta)
    poses, blocks = (init.pose(tree), make_pose(tree)), (make_blocks(tree), make_blocks(tree))
    work = make_workspace(tree)
    count = len(terms.flags) + len(terms.ints[0])
    if count == 0:
        cost = linearize(tree, terms, table[-1], options.triggs, poses[0], blocks[0], work.scratch)
        status, iterations, which = Status.NO_MEASUREMENTS, 0, 0
    else:
        cost, code, iterations, which = optimize(
            tree, terms, table, tolerances, limits, options.triggs, options.damping, 1.0 / options.root_length,
            poses[0], poses[1], blocks[0], blocks[1], work,
        )  # fmt: skip
        status = Status(code)
    pose = poses[which]
    information = shape_information(tree, terms, table[-1], pose, blocks[which], options, work)
    state = State.from_pose(tree, pose)
    return Fit(state, status, float(cost), int(iterations), pose.R.copy(), pose.t.copy(), information, count)


def shape_information(
    tree: Tree, terms: Terms, stage: Array, pose: Pose, blocks: Blocks, options: Options, work: Workspace
) -> Array:
    """Return C - N_0ᵀ M_0^-1 N_0 (P, P) without the shape prior: what one frame says about beta, pose eliminated."""
    eliminate(tree, pose, blocks, DAMPING_LEAST, 1.0 / options.root_length, work)
    P = tree.shape
    return work.C[:P, :P] - stage[0, SHAPE_PRIOR] * terms.shape_information[:P, :P]
