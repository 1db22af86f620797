# SPDX-License-Identifier: Apache-2.0
"""The results of a fit: its state, how it ended, and what its cost is made of.

Every residual's cost is linear in its weight, so the share of one kind is the cost with all other
weights at zero.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..gauss_newton.linearize import linearize
from ..gauss_newton.terms import Terms
from ..part import Blocks, Pose
from ..residuals.external import external_residuals
from ..residuals.registry import (
    KEYPOINT2D,
    KEYPOINT3D,
    ORIENTATION_FIELD,
    RESIDUALS,
    SHAPE_PRIOR,
    column_of,
)
from ..state import Fit, State, Status
from ..tree import Tree

# Columns of a stage's weights by name, in their order.
COLUMNS = {
    "keypoints2d": KEYPOINT2D,
    "keypoints3d": KEYPOINT3D,
    "orientation_field": ORIENTATION_FIELD,
    "shape_prior": SHAPE_PRIOR,
    **{name: column_of(name) for name in RESIDUALS},
}


class Outcome(NamedTuple):
    """How an optimization ended; the fields are those of `Fit` and `ClipFit`."""

    status: Status
    cost: float
    iterations: int
    rejected: int
    cost_by_term: dict[str, float]


def make_fit(
    tree: Tree,
    pose: Pose,
    outcome: Outcome,
    beta_information: NDArray[np.float64],
    counts: tuple[int, int],
) -> Fit:
    """Return the result of one frame at `pose`, which is copied; beta_information (P, P), counts of
    `usable`.
    """
    return Fit(
        state=State.from_pose(tree, pose),
        R_camera_part=pose.R.copy(),
        t_camera_part=pose.t.copy(),
        beta_information=beta_information,
        seen=counts[0],
        measurements=counts[1],
        status=outcome.status,
        cost=outcome.cost,
        iterations=outcome.iterations,
        rejected=outcome.rejected,
        cost_by_term=outcome.cost_by_term,
    )


def cost_by_term(
    tree: Tree,
    terms: Terms,
    stage: NDArray[np.float64],
    triggs: float,
    pose: Pose,
    blocks: Blocks,
    scratch: NDArray[np.float64],
) -> dict[str, float]:
    """Return the cost of each kind of residual at `pose`; they add up to what `linearize` returns
    there.

    Kinds whose weight is zero are left out.

    :param stage: (2, C) a row of weights and a row of 1/sigma, in the registry's order.
    :param scratch: (12, W) of `make_scratch`. :param blocks: overwritten. Others as of
        `linearize`.
    """
    found = {}
    measured = terms.external.calls[:, 4]  # columns of external residuals that have rows
    external = {
        name: column_of(name) for name in external_residuals() if column_of(name) in measured
    }
    for name, column in {**COLUMNS, **external}.items():
        if stage[0, column] > 0.0:
            alone = stage.copy()
            alone[0] = np.where(np.arange(len(stage[0])) == column, stage[0], 0.0)
            found[name] = float(linearize(tree, terms, alone, triggs, pose, blocks, scratch))
    return found
