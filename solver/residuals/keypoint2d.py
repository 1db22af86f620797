# SPDX-License-Identifier: Apache-2.0
r"""A keypoint seen in the image.

    r = (f x/z - u, f y/z - v),   p = (x, y, z) = R_i (V_j beta + v_bar_j) + t_i
with (u, v) the pixel in normalized image coordinates of the given intrinsics, u = (px - cx - skew
v) / fx, and f = 1, or the unknown focal length over the given one. Weights are therefore per square
of a normalized coordinate: one pixel squared times focal squared.

    dr/dp = G = (f/z) [[1, 0, -x/z], [0, 1, -y/z]],  dr/dx = G [-[p - origin]x, I],
    dr/dbeta = G (R V_j + D),
    dr/dlog f = f (x/z, y/z)

Nearer than z_min, or behind the camera, z is replaced by z_min in the projection and a third
residual, (z_min - z) / z_min, which no robust kernel flattens, pushes the point to the front; all
is finite and continuous. Source: section 3 of the paper, pinhole projection.
"""

from ..kernel import kernel
from .accumulation import geman_mcclure

Z_MIN = 0.1  # metres


@kernel
def term(p, uv, focal, weight, inv_sigma):  # type: ignore[no-untyped-def]
    """Return (cost, w GᵀG by rows of its upper triangle (6), w Gᵀr (3), w Gᵀg (3), w gᵀg, w gᵀr) of
    p (3) seen at uv (2), with g = dr/dlog f.
    """
    x, y, z = p
    u, v = uv
    front = z > Z_MIN
    iz = 1.0 / (z if front else Z_MIN)
    gx = focal * x * iz
    gy = focal * y * iz
    rx = gx - u
    ry = gy - v
    s = rx * rx + ry * ry
    rho, w = geman_mcclure(s, inv_sigma)
    cost = 0.5 * weight * rho
    w *= weight
    a = focal * iz
    bx, by = (-gx * iz, -gy * iz) if front else (0.0, 0.0)
    aw = a * w
    fx = aw * rx
    fy = aw * ry
    fz = w * (bx * rx + by * ry)
    w22 = w * (bx * bx + by * by)
    h = (aw * gx, aw * gy, w * (bx * gx + by * gy))
    if not front:
        depth = (Z_MIN - z) / Z_MIN
        cost += 0.5 * weight * depth * depth
        w22 += weight / (Z_MIN * Z_MIN)
        fz -= weight * depth / Z_MIN
    W = (a * aw, 0.0, bx * aw, a * aw, by * aw, w22)
    return cost, W, (fx, fy, fz), h, w * (gx * gx + gy * gy), w * (gx * rx + gy * ry)
