# SPDX-License-Identifier: Apache-2.0
"""What a kernel of a residual r(T_i, Omega_i, beta) of your own is made of, for
`register_residual(name, kernel=accumulate)`.

    accumulate(tree, ints, floats, weight, pose, blocks) -> cost
is compiled by numba and called at every linearization, from several threads at a time:

    tree      `Tree`: point k < tree.keypoints is a keypoint, tree.keypoints + i the joint of part
              i; point k belongs to part tree.point_part[k], and tree.parents[i] is i's parent
    ints      (n, INTS), the rows of `Measurements.tables[name]`; floats (n, FLOATS) likewise
    weight    `Weights.tables[name]`, which multiplies the cost, and so JᵀJ and Jᵀr
    pose      `Pose`: pose.R[i], pose.t[i] of part i in the camera frame, metres, pose.Omega[i] of
              its joint, pose.beta[:tree.shape_count]
    blocks    `Blocks`, the sums of all residuals: add to them and never set them

It returns the sum of 1/2 weight |r|^2 and adds weight JᵀJ, which must be positive semidefinite, and
weight Jᵀr of each row. Two functions do that, and need no more than a row's own derivatives:

    of a point p_k, with G = dr/dp (camera frame), W = weight GᵀG and f = weight Gᵀr:
        x, y, z = lever(tree, pose, k)        from the part's origin to the point, R_i v_k
        add_to_point(tree, pose, blocks, k, x, y, z, W00, W01, W02, W11, W12, W22, f0, f1, f2)
    of a joint's state, with Omega_i <- exp(u) Omega_i, J = dr/du, H = weight JᵀJ, g = weight Jᵀr:
        add_to_joint(tree, pose, blocks, i, H00, H01, H02, H11, H12, H22, g0, g1, g2)

A joint's position is its point, with a lever of zero. With a robust kernel, (rho, rho') =
geman_mcclure(|r|^2, 1/sigma) gives the cost 1/2 weight rho, and rho' weighs W and f. Residuals that
turn with the part itself add to `blocks.A` directly: see `Blocks`, GRADIENT and SHAPE. None may
depend on two parts. `check_residual` compares Jᵀr and JᵀJ with differences of the cost.
"""

from .part import GRADIENT, SHAPE, Blocks, Pose
from .residuals.accumulation import add_to_joint, add_to_point, geman_mcclure, lever, relative_log
from .tree import Tree

__all__ = [
    "GRADIENT",
    "SHAPE",
    "Blocks",
    "Pose",
    "Tree",
    "add_to_joint",
    "add_to_point",
    "geman_mcclure",
    "lever",
    "relative_log",
]
