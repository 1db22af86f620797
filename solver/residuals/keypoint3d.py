# SPDX-License-Identifier: Apache-2.0
"""A keypoint measured in space, in the camera frame.

    r = p - p_measured,   p = R_i (V_j beta + v_bar_j) + t_i,   metres
    dr/dx = [-[p - origin]x, I],  dr/dbeta = R V_j + D
It serves temporal terms as well: last frame's position, or its extrapolation, is a measurement.
Source: section 3 of the paper.
"""

from ..kernel import kernel
from .accumulation import geman_mcclure, triggs_share


@kernel
def term(x, y, z, mx, my, mz, weight, inv_sigma, triggs):  # type: ignore[no-untyped-def]
    """Return (cost, w, kappa, 3 of w r): the second-order matrix is w I - kappa (w r)(w r)ᵀ."""
    rx = x - mx
    ry = y - my
    rz = z - mz
    s = rx * rx + ry * ry + rz * rz
    rho, w = geman_mcclure(s, inv_sigma)
    w *= weight
    kappa = 0.0
    if triggs > 0.0 and s > 0.0 and w > 0.0:
        kappa = triggs_share(s, inv_sigma, triggs) / (s * w)
    return 0.5 * weight * rho, w, kappa, w * rx, w * ry, w * rz
