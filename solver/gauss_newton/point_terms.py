# SPDX-License-Identifier: GPL-3.0-or-later
"""The terms of one measured point: 2D and 3D keypoint and direction, merged into W = GᵀG, its
moments and a force.

Tuples as in part_sums.py. Weights and 1/sigma come in as plain numbers.
"""

from ..compiled.kernel import expanded_kernel
from ..residuals import keypoint2d, keypoint3d, orientation_field
from .part_sums import add3, add6, cross_symmetric
from .terms import HAS_2D, HAS_3D, HAS_DIRECTION, HAS_SHAPE


@expanded_kernel
def point_at_rest(terms, beta, j, P):  # type: ignore[no-untyped-def]
    """Return V_j beta + v_bar_j of slot j, in its part's axes."""
    x = terms.rest[j, 0]
    y = terms.rest[j, 1]
    z = terms.rest[j, 2]
    if terms.flags[j] & HAS_SHAPE:
        for a in range(P):
            b = beta[a]
            x += terms.V[j, 0, a] * b
            y += terms.V[j, 1, a] * b
            z += terms.V[j, 2, a] * b
    return x, y, z


@expanded_kernel
def _add_keypoint3d(q, p, weight, inv_sigma, triggs, cost, w, g):  # type: ignore[no-untyped-def]
    """Add the term of a point p (3) measured at q (4) to the cost, W = GᵀG (6) and Gᵀr (3)."""
    more, w3d, k, x, y, z = keypoint3d.term(
        p[0], p[1], p[2], q[0], q[1], q[2], weight * q[3], inv_sigma, triggs
    )
    w = (
        w[0] + w3d - k * x * x, w[1] - k * x * y, w[2] - k * x * z,
        w[3] + w3d - k * y * y, w[4] - k * y * z, w[5] + w3d - k * z * z,
    )  # fmt: skip
    return cost + more, w, add3(g, (x, y, z))


@expanded_kernel
def _add_direction(q, e, weight, inv_sigma, triggs, cost, w, g):  # type: ignore[no-untyped-def]
    """Add the term of a lever e (3) measured along q (4) to the cost, W = GᵀG (6) and Gᵀr (3)."""
    more, d00, d01, d02, d11, d12, d22, x, y, z = orientation_field.term(
        e[0], e[1], e[2], q[0], q[1], q[2], weight * q[3], inv_sigma, triggs
    )
    return cost + more, add6(w, (d00, d01, d02, d11, d12, d22)), add3(g, (x, y, z))


@expanded_kernel
def point_terms(terms, j, e, t, settings, cost):  # type: ignore[no-untyped-def]
    """Evaluate what was measured of slot j, at e (3) from the origin t (3) of its part.

    settings: weight and 1/sigma of each kind of term, focal scale, share of the second-order terms.
    Return the cost so far; W = GᵀG (6), [e]x W (9) and Gᵀr (3) of the position terms; with the
    direction, W, [e]x W and Gᵀr of all; and Gᵀg (3), gᵀg and gᵀr of the focal length, g = dr/dlog
    f.
    """
    # Scalars rather than tuples wherever a branch sets them: LLVM would sum in another order, with
    # other roundings.
    w2, k2, w3, k3, wd, kd, focal, triggs = settings
    flags = terms.flags[j]
    ex, ey, ez = e
    tx, ty, tz = t
    w00 = 0.0
    w01 = 0.0
    w02 = 0.0
    w11 = 0.0
    w12 = 0.0
    w22 = 0.0
    gx = 0.0
    gy = 0.0
    gz = 0.0
    hx = 0.0
    hy = 0.0
    hz = 0.0
    ff = 0.0
    fr = 0.0
    if flags & HAS_2D:
        q = terms.image[j]
        more, w00, w01, w02, w11, w12, w22, gx, gy, gz, hx, hy, hz, ff, fr = keypoint2d.term(
            ex + tx, ey + ty, ez + tz, q[0], q[1], focal, w2 * q[2], k2, triggs
        )
        cost += more
    if flags & HAS_3D:
        q = terms.point[j]
        p = (ex + tx, ey + ty, ez + tz)
        w = (w00, w01, w02, w11, w12, w22)
        cost, w, (gx, gy, gz) = _add_keypoint3d(q, p, w3, k3, triggs, cost, w, (gx, gy, gz))
        w00, w01, w02, w11, w12, w22 = w
    position = (w00, w01, w02, w11, w12, w22)
    b00, b01, b02, b10, b11, b12, b20, b21, b22 = cross_symmetric(e, position)
    moments = (b00, b01, b02, b10, b11, b12, b20, b21, b22)
    force = (gx, gy, gz)
    if flags & HAS_DIRECTION:
        w = (w00, w01, w02, w11, w12, w22)
        cost, w, (gx, gy, gz) = _add_direction(
            terms.direction[j], e, wd, kd, triggs, cost, w, (gx, gy, gz)
        )
        w00, w01, w02, w11, w12, w22 = w
        b00, b01, b02, b10, b11, b12, b20, b21, b22 = cross_symmetric(e, w)
    w = (w00, w01, w02, w11, w12, w22)
    b = (b00, b01, b02, b10, b11, b12, b20, b21, b22)
    return cost, position, moments, force, w, b, (gx, gy, gz), (hx, hy, hz), ff, fr
