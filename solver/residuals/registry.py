# SPDX-License-Identifier: GPL-3.0-or-later
"""Every residual the optimizer knows. This is the one place to register another.

A residual r_i(T_i, Omega_i, beta) beside the measurements is a module with
    INTS, FLOATS                             columns of its two tables, one row for each term
    INDEXES                                  what all its whole numbers count: "points" as in the measurements, "parts"
                                             0..K or "joints" 1..K. Rows outside are refused; without it, negative ones
    accumulate(tree, ints, floats, weight, inv_sigma, triggs, pose, blocks) -> cost
                                             compiled with @kernel; adds JᵀJ and Jᵀr to `Blocks` (see part.py)
    evaluate(part, ...) -> Linearization     the same in plain numpy, for the derivative test
To register it: its import, and one line, its module in RESIDUALS. Its tables come in through
`Measurements.tables[name]`, its weight through `Weights.tables[name]`. A residual with no rows costs one call.

The three measurements (keypoint2d, keypoint3d, orientation_field) are not here: the hot path in linearize.py merges
those of one point into one term.
"""

from typing import Any

import numpy as np

from ..errors import InvalidValueError
from ..kernel import inlined_kernel
from . import floor, foot_contact, joint_flow, joint_limits, joint_prior, pose_prior
from .part import Array

RESIDUALS = {
    "pose_prior": pose_prior,
    "joint_prior": joint_prior,
    "joint_limits": joint_limits,
    "joint_flow": joint_flow,
    "foot_contact": foot_contact,
    "floor": floor,
}

# Columns of a stage's weights: the measurements, the shape prior, then RESIDUALS in order.
KEYPOINT2D, KEYPOINT3D, ORIENTATION_FIELD, SHAPE_PRIOR, FIRST_TABLE = range(5)


@inlined_kernel
def _nothing(tree, ints, floats, weights, inv_sigma, triggs, pose, blocks):  # type: ignore[no-untyped-def]
    """Cost of no residual."""
    return 0.0


def _followed_by(before: Any, index: int, accumulate: Any) -> Any:
    """Return the kernel that runs `before`, then the residual with that index."""
    column = FIRST_TABLE + index

    @inlined_kernel
    def run(tree, ints, floats, weights, inv_sigma, triggs, pose, blocks):  # type: ignore[no-untyped-def]
        cost = before(tree, ints, floats, weights, inv_sigma, triggs, pose, blocks)
        w, s = weights[column], inv_sigma[column]
        return cost + accumulate(tree, ints[index], floats[index], w, s, triggs, pose, blocks)

    return run


# Adds the residuals of all tables to the blocks and returns their cost; ints, floats and weights in RESIDUALS' order.
accumulate_tables = _nothing
for _index, _module in enumerate(RESIDUALS.values()):
    accumulate_tables = _followed_by(accumulate_tables, _index, _module.accumulate)


def registered(name: str) -> Any:
    """Return the module of the residual with that name.

    :raises InvalidValueError: there is none.
    """
    if name not in RESIDUALS:
        raise InvalidValueError(f"There is no residual named {name!r}; the registered ones are {', '.join(RESIDUALS)}.")
    return RESIDUALS[name]


def empty_tables() -> dict[str, tuple[Array, Array]]:
    """Return tables without rows for every residual."""
    return {name: (np.zeros((0, m.INTS), np.int64), np.zeros((0, m.FLOATS))) for name, m in RESIDUALS.items()}
