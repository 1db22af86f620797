# SPDX-License-Identifier: Apache-2.0
"""One-sided limits on a joint's state: its angle about an axis, and how far it swings off that
axis.

    phi = log(Omega), a unit axis in the parent's axes at rest, angle = aᵀ phi,
    swing s = (I - a aᵀ) phi
    r_1   = sqrt(w) (max(0, angle - upper) - max(0, lower - angle))
    r_2-4 = sqrt(w_swing) s max(0, 1 - swing_limit / |s|)
    dr_1/du = sqrt(w) aᵀ J^-1(phi) R_parᵀ
    dr_2-4/du = sqrt(w_swing) (k I + (1 - k) s^ s^ᵀ) (I - a aᵀ) J^-1(phi) R_parᵀ
with k = 1 - swing_limit / |s|, both zero inside the limits. Radians. Source: one-sided penalties on
knees and upper arms as the paper's code has them; the ranges are ours.
"""

import math
from collections.abc import Sequence

import numpy as np

from ..kernel import kernel
from ..matrices import add3, add6, entries, outer, rotated, transposed, turned
from ..part import Array
from ..rotations import left_jacobian_inverse3, log3
from .accumulation import add_to_joint, rows_of

INTS = 1  # joint
FLOATS = 8  # axis (3), lower, upper, swing_limit, w, w_swing
INDEXES = "joints"
WEIGHTS = slice(0)  # says nothing of where the body is

# Axis in the parent's rest axes of SMPL's T-pose (x to the person's left, y up, z forward), lower,
# upper, swing limit. A knee bends the shin backwards; an elbow brings the forearm forwards, and
# carries some of the forearm's twist.
HINGES = {
    "left_knee": ((1.0, 0.0, 0.0), -0.05, 2.6, 0.3),
    "right_knee": ((1.0, 0.0, 0.0), -0.05, 2.6, 0.3),
    "left_elbow": ((0.0, -1.0, 0.0), -0.05, 2.7, 1.2),
    "right_elbow": ((0.0, 1.0, 0.0), -0.05, 2.7, 1.2),
}


@kernel
def accumulate(tree, ints, floats, weight, pose, blocks):  # type: ignore[no-untyped-def]
    """Add every row's H_uu and g_u to the blocks and return the cost. ints (n, 1), floats (n,
    8).
    """
    cost = 0.0
    for k in range(ints.shape[0]):
        i = ints[k, 0]
        f = floats[k]
        x, y, z = log3(*entries(pose.Omega[i]))
        angle = f[0] * x + f[1] * y + f[2] * z
        r = max(0.0, angle - f[4]) - max(0.0, f[3] - angle)
        sx = x - angle * f[0]
        sy = y - angle * f[1]
        sz = z - angle * f[2]
        swing = math.sqrt(sx * sx + sy * sy + sz * sz)
        w = weight * f[6]
        v = weight * f[7]
        hinged = r != 0.0 and w > 0.0
        swung = swing > f[5] and v > 0.0
        if not hinged and not swung:
            continue
        Jt = transposed(left_jacobian_inverse3(x, y, z))
        H = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        g = (0.0, 0.0, 0.0)
        a0, a1, a2 = rotated(Jt, f)
        if hinged:
            cost += 0.5 * w * r * r
            H = outer(w, a0, a1, a2)
            g = (w * r * a0, w * r * a1, w * r * a2)
        if swung:
            share = 1.0 - f[5] / swing
            cost += 0.5 * v * share * share * swing * swing
            # JᵀJ = k^2 (J^-Tᵀ(I - a aᵀ)J^-1) + (1 - k^2) b bᵀ with b = J^-T s^
            b0, b1, b2 = rotated(Jt, (sx / swing, sy / swing, sz / swing))
            p = v * share * share
            H = add6(H, turned(Jt, (p, 0.0, 0.0, p, 0.0, p)))
            H = add6(H, outer(-p, a0, a1, a2))
            H = add6(H, outer(v - p, b0, b1, b2))
            force = v * share * swing
            g = add3(g, (force * b0, force * b1, force * b2))
        add_to_joint(tree, pose, blocks, i, *H, *g)
    return cost


def pack(
    joints: Array,
    axes: Array,
    lower: Array,
    upper: Array,
    swing_limit: Array,
    w: Array,
    w_swing: Array,
) -> tuple[Array, Array]:
    """Return the tables of `accumulate`: int64 (n, 1) and float64 (n, 8).

    :param joints: (n,) in 1..K.
    :param axes: (n, 3) unit vectors, in the parent's rest axes.
    :param lower, upper: (n,), (n,) bounds of the twist about the axis, radians.
    :param swing_limit: (n,) bound of the turn of the axis itself, radians.
    :param w, w_swing: (n,), (n,) weights of the two.
    """
    return rows_of(joints, axes, lower, upper, swing_limit, w, w_swing)


def hinges_of(joint_names: Sequence[str]) -> tuple[Array, Array]:
    """Return the tables of `accumulate` for the knees and elbows among a body's joint names but the
    root's, which bends about nothing; empty if it has none.
    """
    below = joint_names[1:]
    found = [(1 + below.index(name), *hinge) for name, hinge in HINGES.items() if name in below]
    if not found:
        return np.zeros((0, INTS), np.int64), np.zeros((0, FLOATS))
    joints, axes, lower, upper, swing = (np.array(column) for column in zip(*found, strict=True))
    ones = np.ones(len(joints))
    return pack(joints, axes, lower, upper, swing, ones, ones)
