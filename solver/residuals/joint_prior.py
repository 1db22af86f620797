# SPDX-License-Identifier: Apache-2.0
"""A joint's state pulled towards a mean: the rest pose, a learned mean, or last frame's state.

    r = sqrt(w_i) log(Omega_mean_iᵀ Omega_i),   radians
    dr/du = sqrt(w_i) J^-1(phi) Omega_meanᵀ R_parᵀ,  phi = log(Omega_meanᵀ Omega),
    for Omega <- exp(R_parᵀ u) Omega
The gradient is w Omega_mean phi in the parent's axes, because J^-T(phi) phi = phi. Source: section
3 of the paper (joint state prior), with a Gaussian on SO(3) in place of the normalizing flow.
"""

import numpy as np

from ..kernel import kernel
from ..matrices import rotated
from ..part import Array
from ..rotations import left_jacobian_inverse3
from .accumulation import add_to_joint, relative_log, rows_of

INTS = 1  # joint
FLOATS = 10  # Omega_mean (9) by rows, w
INDEXES = "joints"
WEIGHTS = slice(0)  # says nothing of where the body is


@kernel
def accumulate(tree, ints, floats, weight, pose, blocks):  # type: ignore[no-untyped-def]
    """Add every row's H_uu and g_u to the blocks and return the cost. ints (n, 1), floats (n,
    10).
    """
    cost = 0.0
    for k in range(ints.shape[0]):
        i = ints[k, 0]
        m = floats[k]
        w = weight * m[9]
        if w <= 0.0:
            continue
        x, y, z = relative_log(m, pose.Omega[i])
        J = left_jacobian_inverse3(x, y, z)
        # J^-T J^-1 = q I + (1 - q) a aᵀ with a the axis and q = |phi/2|^2 / sin^2(|phi|/2): read q
        # off the trace
        s = x * x + y * y + z * z
        trace = 0.0
        for e in range(9):
            trace += J[e] * J[e]
        q = 0.5 * (trace - 1.0)
        p = (1.0 - q) / s if s > 1e-12 else -1.0 / 12.0
        cost += 0.5 * w * s
        # Omega_mean a: the axis in the parent's axes
        ax, ay, az = rotated(m, (x, y, z))
        add_to_joint(
            tree, pose, blocks, i,
            w * (q + p * ax * ax), w * p * ax * ay, w * p * ax * az,
            w * (q + p * ay * ay), w * p * ay * az, w * (q + p * az * az),
            w * ax, w * ay, w * az,
        )  # fmt: skip
    return cost


def pack(joints: Array, Omega_mean: Array, weights: Array) -> tuple[Array, Array]:
    """Return the tables of `accumulate` from joints (n,) in 1..K, means (n, 3, 3) and weights
    (n,).
    """
    return rows_of(joints, np.reshape(Omega_mean, (len(joints), 9)), weights)
