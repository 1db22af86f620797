# SPDX-License-Identifier: Apache-2.0
"""A joint's state by a normalizing flow z(Omega) on SO(3), learned from motion: the paper's joint
state prior.

    r = sqrt(w) z,   1/2 |z|^2 = -log p(Omega) + log |det dz/dmu| + const
    dr/du = sqrt(w) dz/dw R_parᵀ,   for Omega <- exp(R_parᵀ u) Omega
p is the density against the Haar measure mu.

Chart: with M a mean rotation and (w, v) the unit quaternion of MᵀOmega, w >= 0,
    y = v / sqrt(w),   dmu/dy = 2/pi^2 w^(5/2) / (1 + w^2),
    dy/de = sqrt(w)/2 I - [y]x/2 + y yᵀ/(4 sqrt(w))
for Omega <- M exp(e) MᵀOmega: a diffeomorphism onto R^3 of all rotations but the half turns from M.
There |y| and the residual tend to infinity, as (pi - angle)^-1/2, so the prior never prefers to
turn on beyond; in the last 1e-4 radians the residual is that at pi - 1e-4 about the same axis,
whose sign is arbitrary at pi itself. Then LAYERS times, with tau(u) = u / (1 + u^2), S(a) = a +
sqrt(1 + a^2), and s, t linear in HIDDEN values of tau,
    x <- A x + b,   x_2 <- S(s_2(x_1)) x_2 + t_2(x_1),
    x_3 <- S(s_3(x_1, x_2)) x_3 + t_3(x_1, x_2),
    x_k <- x_k + beta_k sqrt(1 + x_k^2)
and z = A x + b. Everything is smooth and has an inverse in closed form, `invert`. Source: section 3
of the paper, which leaves the kind of flow open; this one is ours. Training: tools/train_prior.
"""

import math

import numpy as np

from ..gauss_newton.plain_rows import LANES, STATE
from ..gauss_newton.rows import in_lanes
from ..kernel import allocating_kernel, kernel
from ..matrices import formula, product, rotated, transposed, upper
from ..part import Array
from ..rotations import exp, exp3, log, matrix_from_quaternion
from .accumulation import add_to_joint, relative_log

LAYERS = 4
HIDDEN = 4
# Parameters of a layer in order, and where the parts of a joint's parameters begin.
LAYER_SHAPES = {
    "A": (3, 3), "b": (3,),
    "W2": (HIDDEN,), "c2": (HIDDEN,), "out2": (2, HIDDEN), "bias2": (2,),
    "W3": (HIDDEN, 2), "c3": (HIDDEN,), "out3": (2, HIDDEN), "bias3": (2,),
    "beta": (3,),
}  # fmt: skip
LAYER_SIZE = sum(math.prod(shape) for shape in LAYER_SHAPES.values())
MEAN = 0
FIRST_LAYER = 9
LAST = FIRST_LAYER + LAYERS * LAYER_SIZE  # A (3, 3) and b (3,) of the last linear map
CONSTANT = LAST + 12  # sum of log |det A| with -log(2/pi^2)
BOUND = LAST + 13  # of log |det dz/dmu| at the data of training; files have it, no fit reads it
SIZE = LAST + 14  # of a joint's parameters

INTS = LANES  # joints, 0 for none: one row holds several
FLOATS = LANES * (SIZE + 1)  # their parameters, then w, each as LANES values
INDEXES = "parts"
WEIGHTS = slice(0)  # says nothing of where the body is
_W = SIZE
NEAREST = 1e-4  # radians to pi
_MIN_TRACE = 4.0 * math.sin(0.5 * NEAREST) ** 2  # of 1 + tr MᵀOmega = 4 cos^2(angle / 2)
_FARTHEST = math.sin(0.5 * NEAREST) ** -2.5  # of (1 + w^2) / w^(5/2)

# A state of the formulas has STATE entries: x (3), dx/de (9) by rows, and |det dx/dmu| without
# constants. Formulas take it as a tuple, and find their parameter k at q[at + k n]. Their numbers
# may be numpy arrays, or whatever `in_lanes` passes.


@formula
def chart(q, at, n, s):  # type: ignore[no-untyped-def]
    """Return the state y from Omega, the first 9 of s, by rows; parameters M."""
    L = product(transposed(_matrix(q, at, n)), s)  # MᵀOmega
    four_ww = 1.0 + L[0] + L[4] + L[8]
    w = 0.5 * np.sqrt(four_ww)
    root = np.sqrt(w)
    k = root / four_ww
    x = k * (L[7] - L[5])
    y = k * (L[2] - L[6])
    z = k * (L[3] - L[1])
    f = 0.5 * root
    quarter = 0.25 / root
    a = quarter * x
    b = quarter * y
    c = quarter * z
    hx = 0.5 * x
    hy = 0.5 * y
    hz = 0.5 * z
    return (
        x, y, z,
        f + a * x, a * y + hz, a * z - hy,
        a * y - hz, f + b * y, b * z + hx,
        a * z + hy, b * z - hx, f + c * z,
        (1.0 + w * w) / (w * w * root),
    )  # fmt: skip


@formula
def _matrix(q, at, n):  # type: ignore[no-untyped-def]
    """Return nine parameters."""
    return (
        q[at], q[at + n], q[at + 2 * n], q[at + 3 * n], q[at + 4 * n],
        q[at + 5 * n], q[at + 6 * n], q[at + 7 * n], q[at + 8 * n],
    )  # fmt: skip


@formula
def _linear(q, at, n, s):  # type: ignore[no-untyped-def]
    """Return A x + b and A J, with A and b from parameter `at` on, and the rest of the state."""
    a = _matrix(q, at, n)
    x, y, z = s[:3]
    moved = (
        q[at + 9 * n] + a[0] * x + a[1] * y + a[2] * z,
        q[at + 10 * n] + a[3] * x + a[4] * y + a[5] * z,
        q[at + 11 * n] + a[6] * x + a[7] * y + a[8] * z,
    )
    return moved + product(a, s[3:12]) + s[12:]


@formula
def _hidden1(q, at, n, x):  # type: ignore[no-untyped-def]
    """Return (s, ds/dx, t, dt/dx) of the small network of x whose parameters start at `at`."""
    out = at + 2 * HIDDEN * n
    bias = at + 4 * HIDDEN * n
    s = q[bias]
    t = q[bias + n]
    sx = 0.0
    tx = 0.0
    for k in range(HIDDEN):
        w = q[at + k * n]
        u = q[at + (HIDDEN + k) * n] + w * x
        r = 1.0 / (1.0 + u * u)
        tau = u * r
        slope = r * (2.0 * r - 1.0) * w
        s = s + q[out + k * n] * tau
        t = t + q[out + (HIDDEN + k) * n] * tau
        sx = sx + q[out + k * n] * slope
        tx = tx + q[out + (HIDDEN + k) * n] * slope
    return s, sx, t, tx


@formula
def _hidden2(q, at, n, x, y):  # type: ignore[no-untyped-def]
    """Return (s, ds/dx, ds/dy, t, dt/dx, dt/dy) of the small network of x and y."""
    out = at + 3 * HIDDEN * n
    bias = at + 5 * HIDDEN * n
    s = q[bias]
    t = q[bias + n]
    sx = 0.0
    sy = 0.0
    tx = 0.0
    ty = 0.0
    for k in range(HIDDEN):
        wx = q[at + 2 * k * n]
        wy = q[at + (2 * k + 1) * n]
        u = q[at + (2 * HIDDEN + k) * n] + wx * x + wy * y
        r = 1.0 / (1.0 + u * u)
        tau = u * r
        slope = r * (2.0 * r - 1.0)
        s = s + q[out + k * n] * tau
        t = t + q[out + (HIDDEN + k) * n] * tau
        s_slope = q[out + k * n] * slope
        t_slope = q[out + (HIDDEN + k) * n] * slope
        sx = sx + s_slope * wx
        sy = sy + s_slope * wy
        tx = tx + t_slope * wx
        ty = ty + t_slope * wy
    return s, sx, sy, t, tx, ty


@formula
def _bend(beta, x):  # type: ignore[no-untyped-def]
    """Return x + beta sqrt(1 + x^2) and its derivative."""
    root = np.sqrt(1.0 + x * x)
    return x + beta * root, 1.0 + beta * x / root


@formula
def layer(q, at, n, s):  # type: ignore[no-untyped-def]
    """Return the state after one layer, whose parameters start at `at`."""
    x1, x2, x3, j00, j01, j02, j10, j11, j12, j20, j21, j22, det = _linear(q, at, n, s)
    a, a1, t, t1 = _hidden1(q, at + 12 * n, n, x1)
    root = np.sqrt(1.0 + a * a)
    scale2 = a + root
    k1 = scale2 * (a1 / root) * x2 + t1  # a1 / root = d log S / dx_1
    i10 = scale2 * j10 + k1 * j00
    i11 = scale2 * j11 + k1 * j01
    i12 = scale2 * j12 + k1 * j02
    moved2 = scale2 * x2 + t
    a, a1, a2, t, t1, t2 = _hidden2(q, at + (14 + 4 * HIDDEN) * n, n, x1, x2)
    root = np.sqrt(1.0 + a * a)
    scale3 = a + root
    k1 = scale3 * (a1 / root) * x3 + t1
    k2 = scale3 * (a2 / root) * x3 + t2
    i20 = scale3 * j20 + k1 * j00 + k2 * j10
    i21 = scale3 * j21 + k1 * j01 + k2 * j11
    i22 = scale3 * j22 + k1 * j02 + k2 * j12
    moved3 = scale3 * x3 + t
    y1, slope1 = _bend(q[at + (LAYER_SIZE - 3) * n], x1)
    y2, slope2 = _bend(q[at + (LAYER_SIZE - 2) * n], moved2)
    y3, slope3 = _bend(q[at + (LAYER_SIZE - 1) * n], moved3)
    return (
        y1, y2, y3,
        slope1 * j00, slope1 * j01, slope1 * j02,
        slope2 * i10, slope2 * i11, slope2 * i12,
        slope3 * i20, slope3 * i21, slope3 * i22,
        det * scale2 * scale3 * slope1 * slope2 * slope3,
    )  # fmt: skip


@formula
def finish(q, at, n, s):  # type: ignore[no-untyped-def]
    """Return the state z with derivatives in the parent's axes in place of M's."""
    s = _linear(q, at + LAST * n, n, s)
    return s[:3] + product(s[3:12], transposed(_matrix(q, at, n))) + s[12:]


@formula
def normal(q, at, n, s):  # type: ignore[no-untyped-def]
    """Return JᵀJ (6, upper), Jᵀz (3), |z|^2, and from entry 10 on what a state has."""
    z = s[:3]
    J = s[3:12]
    Jt = transposed(J)
    square = z[0] * z[0] + z[1] * z[1] + z[2] * z[2]
    return upper(product(Jt, J)) + rotated(Jt, z) + (square,) + s[10:]


_chart = in_lanes(chart)
_layer = in_lanes(layer)
_finish = in_lanes(finish)
_normal = in_lanes(normal)


@kernel
def _gather(pose, ints, k, state):  # type: ignore[no-untyped-def]
    """Write the states of the joints of row k side by side."""
    for lane in range(LANES):
        Om = pose.Omega[ints[k, lane]]
        for r in range(3):
            for c in range(3):
                state[(3 * r + c) * LANES + lane] = Om[r, c]


@kernel
def _keep_off_half_turns(pose, ints, floats, row, state):  # type: ignore[no-untyped-def]
    """Write the states of a row's joints that are nearly a half turn from their M at pi -
    `NEAREST`.
    """
    for lane in range(LANES):
        M = floats[row, MEAN * LANES + lane : (MEAN + 9) * LANES : LANES]
        R = pose.Omega[ints[row, lane]]
        trace = 0.0
        for r in range(3):
            for c in range(3):
                trace += M[3 * r + c] * R[r, c]
        if 1.0 + trace > _MIN_TRACE:
            continue
        x, y, z = relative_log(M, R)
        scale = (math.pi - NEAREST) / math.sqrt(x * x + y * y + z * z)
        found = product(M, exp3(scale * x, scale * y, scale * z))
        for k in range(9):
            state[k * LANES + lane] = found[k]


@allocating_kernel
def accumulate(tree, ints, floats, weight, pose, blocks):  # type: ignore[no-untyped-def]
    """Add every joint's H_uu and g_u to the blocks and return the cost. ints (n, LANES), floats (n,
    FLOATS).
    """
    cost = 0.0
    if ints.shape[0] == 0 or weight <= 0.0:
        return cost
    state = np.empty(STATE * LANES)
    for k in range(ints.shape[0]):
        parameters = floats[k]
        _gather(pose, ints, k, state)
        _chart(parameters, 0, state)
        near = False
        for lane in range(LANES):
            near = near or not state[12 * LANES + lane] < _FARTHEST  # or not a number
        if near:
            _gather(pose, ints, k, state)
            _keep_off_half_turns(pose, ints, floats, k, state)
            _chart(parameters, 0, state)
        for number in range(LAYERS):
            _layer(parameters, (FIRST_LAYER + number * LAYER_SIZE) * LANES, state)
        _finish(parameters, 0, state)
        _normal(parameters, 0, state)
        for lane in range(LANES):
            i = ints[k, lane]
            w = weight * floats[k, _W * LANES + lane]
            if i == 0 or w <= 0.0:
                continue
            e = state[lane::LANES]
            cost += 0.5 * w * e[9]
            H = (w * e[0], w * e[1], w * e[2], w * e[3], w * e[4], w * e[5])
            g = (w * e[6], w * e[7], w * e[8])
            add_to_joint(tree, pose, blocks, i, *H, *g)
    return cost


def pack(joints: Array, parameters: Array, weights: Array) -> tuple[Array, Array]:
    """Return the tables of `accumulate` from joints (n,) in 1..K, parameters (n, SIZE) and weights
    w (n,).
    """
    n = len(joints)
    rows = -(-n // LANES)
    ints = np.zeros((rows * LANES, 1), np.int64)
    floats = np.zeros((rows * LANES, SIZE + 1))
    floats[:, MEAN : MEAN + 9] = np.eye(3).ravel()
    ints[:n, 0] = joints
    floats[:n] = np.hstack([np.reshape(parameters, (n, SIZE)), np.c_[weights]])
    width_last = floats.reshape(rows, LANES, SIZE + 1).transpose(0, 2, 1)
    return ints.reshape(rows, LANES), np.ascontiguousarray(width_last).reshape(rows, FLOATS)


def transform(parameters: Array, Omega: Array) -> tuple[Array, Array, Array]:
    """Return z (..., 3), dz/dw (..., 3, 3) and log |det dz/dmu| (...).

    For parameters (SIZE,) and states Omega (..., 3, 3), with Omega <- exp(w) Omega and mu the
    normalized Haar measure.
    """
    p = np.asarray(parameters, float)
    M = p[MEAN : MEAN + 9].reshape(3, 3)
    local = M.T @ np.asarray(Omega, float)
    near = 1.0 + np.trace(local, axis1=-2, axis2=-1) < _MIN_TRACE
    if near.any():
        phi = log(local)
        kept = exp(
            phi * ((np.pi - NEAREST) / np.maximum(np.linalg.norm(phi, axis=-1, keepdims=True), 1.0))
        )
        local = np.where(near[..., None, None], kept, local)
    s = list(np.moveaxis((M @ local).reshape(*local.shape[:-2], 9), -1, 0))
    s = chart(p, 0, 1, s)
    for k in range(LAYERS):
        s = layer(p, FIRST_LAYER + k * LAYER_SIZE, 1, s)
    s = [np.asarray(v) for v in finish(p, 0, 1, s)]
    J = np.stack(s[3:12], -1).reshape(*s[0].shape, 3, 3)
    return np.stack(s[:3], -1), J, np.log(s[12]) + p[CONSTANT]


def log_density(parameters: Array, Omega: Array) -> Array:
    """Return log p (...) in nats against the normalized Haar measure, so that the uniform
    distribution has 0.

    :param parameters: (SIZE,) of one joint.
    :param Omega: (..., 3, 3) states of the joint.
    """
    z, _, log_det = transform(parameters, Omega)
    density: Array = -0.5 * np.sum(z * z, axis=-1) - 1.5 * np.log(2.0 * np.pi) + log_det
    return density


def invert(parameters: Array, z: Array) -> Array:
    """Return Omega (..., 3, 3) with transform(parameters, Omega)[0] = z (..., 3); a normal z gives
    a sample.
    """
    p = np.asarray(parameters, float)

    def unmap(at: int, x: Array) -> Array:
        inverse: Array = np.linalg.inv(p[at : at + 9].reshape(3, 3))
        mapped: Array = (x - p[at + 9 : at + 12]) @ inverse.T
        return mapped

    x = unmap(LAST, np.asarray(z, float))
    for k in reversed(range(LAYERS)):
        at = FIRST_LAYER + k * LAYER_SIZE
        beta = p[at + LAYER_SIZE - 3 : at + LAYER_SIZE]
        x = (x - beta * np.sqrt(x * x + 1.0 - beta * beta)) / (1.0 - beta * beta)
        a, _, t, _ = _hidden1(p, at + 12, 1, x[..., 0])
        x2 = (x[..., 1] - t) * (np.sqrt(1.0 + a * a) - a)  # 1 / S(a) = S(-a)
        a, _, _, t, _, _ = _hidden2(p, at + 14 + 4 * HIDDEN, 1, x[..., 0], x2)
        x3 = (x[..., 2] - t) * (np.sqrt(1.0 + a * a) - a)
        x = unmap(at, np.stack([x[..., 0], x2, x3], -1))
    squared = np.sum(x * x, axis=-1, keepdims=True)
    w = 2.0 / (squared + np.sqrt(squared * squared + 4.0))  # |y|^2 = (1 - w^2) / w
    quaternion = np.concatenate([w, x * np.sqrt(w)], axis=-1)
    return p[MEAN : MEAN + 9].reshape(3, 3) @ matrix_from_quaternion(quaternion)
