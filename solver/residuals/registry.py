# SPDX-License-Identifier: GPL-3.0-or-later
"""Every residual the optimizer knows. This is the one place to register another.

A residual r_i(T_i, Omega_i, beta) beside the measurements is a module with
    INTS, FLOATS                             columns of its two tables, one row for each term
    accumulate(tree, ints, floats, weight, inv_sigma, triggs, pose, blocks) -> cost
                                             compiled with @kernel; adds JᵀJ and Jᵀr to `Blocks` (see part.py)
    evaluate(part, ...) -> Linearization     the same in plain numpy, for the derivative test
To register it: its module in RESIDUALS, its call in `accumulate_tables`. Its tables come in through
`Measurements.tables[name]`, its weight through `Weights.tables[name]`. A residual with no rows costs one call.

The three measurements (keypoint2d, keypoint3d, orientation_field) are not here: the hot path in linearize.py merges
those of one point into one term.
"""

import numpy as np

from ..kernel import kernel
from . import joint_flow, joint_limits, joint_prior, pose_prior
from .part import Array

RESIDUALS = {
    "pose_prior": pose_prior,
    "joint_prior": joint_prior,
    "joint_limits": joint_limits,
    "joint_flow": joint_flow,
}

# Columns of a stage's weights: the measurements, the shape prior, then RESIDUALS in order.
KEYPOINT2D, KEYPOINT3D, ORIENTATION_FIELD, SHAPE_PRIOR, FIRST_TABLE = range(5)


@kernel
def accumulate_tables(tree, ints, floats, weights, inv_sigma, triggs, pose, blocks):  # type: ignore[no-untyped-def]
    """Add the residuals of all tables to the blocks and return their cost; tuples and weights in RESIDUALS' order."""
    w, s = weights[FIRST_TABLE:], inv_sigma[FIRST_TABLE:]
    cost = pose_prior.accumulate(tree, ints[0], floats[0], w[0], s[0], triggs, pose, blocks)
    cost += joint_prior.accumulate(tree, ints[1], floats[1], w[1], s[1], triggs, pose, blocks)
    cost += joint_limits.accumulate(tree, ints[2], floats[2], w[2], s[2], triggs, pose, blocks)
    cost += joint_flow.accumulate(tree, ints[3], floats[3], w[3], s[3], triggs, pose, blocks)
    return cost


def empty_tables() -> dict[str, tuple[Array, Array]]:
    """Return tables without rows for every residual."""
    return {name: (np.zeros((0, m.INTS), np.int64), np.zeros((0, m.FLOATS))) for name, m in RESIDUALS.items()}
