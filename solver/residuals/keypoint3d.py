# SPDX-License-Identifier: Apache-2.0
"""A keypoint measured in space, in the camera frame.

    r = p - p_measured,   p = R_i (V_j beta + v_bar_j) + t_i,   metres
    dr/dx = [-[p - origin]x, I],  dr/dbeta = R V_j + D
It serves temporal terms as well: last frame's position, or its extrapolation, is a measurement.
Source: section 3 of the paper.
"""

from ..kernel import kernel
from .accumulation import geman_mcclure


@kernel
def term(p, measured, weight, inv_sigma):  # type: ignore[no-untyped-def]
    """Return (cost, w GᵀG by rows of its upper triangle (6), w Gᵀr (3)) of two points (3)."""
    rx = p[0] - measured[0]
    ry = p[1] - measured[1]
    rz = p[2] - measured[2]
    s = rx * rx + ry * ry + rz * rz
    rho, w = geman_mcclure(s, inv_sigma)
    w *= weight
    x = w * rx
    y = w * ry
    z = w * rz
    return 0.5 * weight * rho, (w, 0.0, 0.0, w, 0.0, w), (x, y, z)
