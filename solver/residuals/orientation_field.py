# SPDX-License-Identifier: Apache-2.0
"""The part orientation field: the unit direction between two points of one part against a measured
unit vector.

    r = d/|d| - n,   d = R_i (V beta + v_bar),
    (V, v_bar) the difference of the two points' (part origin: zero)
    dr/dd = G = (I - n^ n^ᵀ) / |d|, n^ = d/|d|;   dr/dx = G [-[d]x, 0],  dr/dbeta = G R V
Neither the position of the part nor D enters. |r|^2 = 2 - 2 cos(angle); n is in the camera frame.
A lever shorter than a tenth of a millimetre has no direction and counts for nothing.
Source: section 3 of the paper (part orientation field).
"""

import math

from ..kernel import kernel
from .accumulation import geman_mcclure

SHORTEST = 1e-4  # metres


@kernel
def term(d, n, weight, inv_sigma):  # type: ignore[no-untyped-def]
    """Return (cost, w GᵀG by rows of its upper triangle (6), w Gᵀr (3)) of a lever d (3) measured
    along n (3).
    """
    dx, dy, dz = d
    nx, ny, nz = n
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    if length < SHORTEST:
        return 0.0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    il = 1.0 / length
    hx = dx * il
    hy = dy * il
    hz = dz * il
    rx = hx - nx
    ry = hy - ny
    rz = hz - nz
    s = rx * rx + ry * ry + rz * rz
    rho, w = geman_mcclure(s, inv_sigma)
    w *= weight
    along = hx * rx + hy * ry + hz * rz
    g = w * il
    fx = g * (rx - hx * along)
    fy = g * (ry - hy * along)
    fz = g * (rz - hz * along)
    g *= il
    W = (
        g * (1.0 - hx * hx), -g * hx * hy, -g * hx * hz,
        g * (1.0 - hy * hy), -g * hy * hz, g * (1.0 - hz * hz),
    )  # fmt: skip
    return 0.5 * weight * rho, W, (fx, fy, fz)
