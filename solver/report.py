# SPDX-License-Identifier: GPL-3.0-or-later
"""What a fit's cost is made of.

Every residual's cost is linear in its weight, so the share of one kind is the cost with all other weights at zero.
"""

import numpy as np

from .linearize import linearize
from .residuals.external import external_residuals
from .residuals.part import Array, Blocks, Pose
from .residuals.registry import KEYPOINT2D, KEYPOINT3D, ORIENTATION_FIELD, RESIDUALS, SHAPE_PRIOR, column_of
from .terms import Terms
from .tree import Tree

# Columns of a stage's weights by name, in their order.
COLUMNS = {
    "keypoints2d": KEYPOINT2D,
    "keypoints3d": KEYPOINT3D,
    "orientation_field": ORIENTATION_FIELD,
    "shape_prior": SHAPE_PRIOR,
    **{name: column_of(name) for name in RESIDUALS},
}


def cost_by_term(
    tree: Tree, terms: Terms, stage: Array, triggs: float, pose: Pose, blocks: Blocks, scratch: Array
) -> dict[str, float]:
    """Return the cost of each kind of residual at `pose`; they add up to what `linearize` returns there.

    Arguments as of `linearize`; the blocks are overwritten. Kinds whose weight is zero are left out.
    """
    found = {}
    measured = terms.external.calls[:, 4]  # columns of external residuals that have rows
    external = {name: column_of(name) for name in external_residuals() if column_of(name) in measured}
    for name, column in {**COLUMNS, **external}.items():
        if stage[0, column] > 0.0:
            alone = stage.copy()
            alone[0] = np.where(np.arange(len(stage[0])) == column, stage[0], 0.0)
            found[name] = float(linearize(tree, terms, alone, triggs, pose, blocks, scratch))
    return found
