# SPDX-License-Identifier: GPL-3.0-or-later
"""A joint's state by a normalizing flow z(Omega) on SO(3), learned from motion: the paper's joint
state prior.

    r = sqrt(w) (z, sqrt(h) l),   1/2 |z|^2 + l^2/2 = -log p(Omega) + const,
    l = 0 for h = 0 (the paper's residual)
    dr/du = sqrt(w) (dz/dw; ...) R_parᵀ,   for Omega <- exp(R_parᵀ u) Omega
p is the density against the Haar measure; l^2/2 = floor(B - log |det dz/dmu|) with floor(a) = (a +
sqrt(a^2 + 1))/2 and a bound B of the log-determinant near the data.

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
from collections.abc import Callable
from typing import Any

import numpy as np

from ..compiled.kernel import allocating_kernel, kernel
from ..compiled.part import Array, Linearization, Part
from ..compiled.simd import WIDTH, sqrt, vectorized
from ..rotations import exp, exp3, log, log3, matrix_from_quaternion
from .accumulation import add_to_joint

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
# sum of log |det A| with -log(2/pi^2); B
CONSTANT = LAST + 12
BOUND = LAST + 13
SIZE = LAST + 14  # of a joint's parameters

INTS = WIDTH  # joints, 0 for none: one row holds several
FLOATS = WIDTH * (SIZE + 2)  # their parameters, then w and h, each as WIDTH values
INDEXES = "parts"
_W = SIZE
NEAREST = 1e-4  # radians to pi
_MIN_TRACE = 4.0 * math.sin(0.5 * NEAREST) ** 2  # of 1 + tr MᵀOmega = 4 cos^2(angle / 2)
_FARTHEST = math.sin(0.5 * NEAREST) ** -2.5  # of (1 + w^2) / w^(5/2)

# A state of the formulas: x (3), dx/de (9) by rows, |det dx/dmu| without constants, gradient of its
# logarithm by e (3).
STATE = 16


def chart(q: Callable[[int], Any], s: list[Any]) -> list[Any]:
    """Return the state y from Omega (9) by rows; parameters M."""
    m = [q(MEAN + k) for k in range(9)]

    def entry(i: int, j: int) -> Any:  # of MᵀOmega
        return m[i] * s[j] + m[3 + i] * s[3 + j] + m[6 + i] * s[6 + j]

    four_ww = 1.0 + entry(0, 0) + entry(1, 1) + entry(2, 2)
    w = 0.5 * sqrt(four_ww)
    root = sqrt(w)
    k = root / four_ww
    y = [
        k * (entry(2, 1) - entry(1, 2)),
        k * (entry(0, 2) - entry(2, 0)),
        k * (entry(1, 0) - entry(0, 1)),
    ]
    f = 0.5 * root
    n = 0.25 / root
    a = n * y[0]
    b = n * y[1]
    c = n * y[2]
    hx = 0.5 * y[0]
    hy = 0.5 * y[1]
    hz = 0.5 * y[2]
    J = [f + a * y[0], a * y[1] + hz, a * y[2] - hy,
         a * y[1] - hz, f + b * y[1], b * y[2] + hx,
         a * y[2] + hy, b * y[2] - hx, f + c * y[2]]  # fmt: skip
    ww1 = 1.0 + w * w
    g = f * (2.5 / w - 2.0 * w / ww1)  # dw/de = -v/2
    return [*y, *J, ww1 / (w * w * root), g * y[0], g * y[1], g * y[2]]


def _linear(
    q: Callable[[int], Any], at: int, x: list[Any], J: list[Any]
) -> tuple[list[Any], list[Any]]:
    """Return A x + b and A J, with A and b from parameter `at` on."""
    A = [q(at + k) for k in range(9)]
    out = [
        q(at + 9 + r) + A[3 * r] * x[0] + A[3 * r + 1] * x[1] + A[3 * r + 2] * x[2]
        for r in range(3)
    ]
    entries = [(r, c) for r in range(3) for c in range(3)]
    return out, [
        A[3 * r] * J[c] + A[3 * r + 1] * J[3 + c] + A[3 * r + 2] * J[6 + c] for r, c in entries
    ]


def _hidden(q: Callable[[int], Any], at: int, x: list[Any]) -> list[Any]:
    """Return (s, ds/dx.., t, dt/dx..) of the small network whose parameters start at `at`, of one
    or two inputs x.
    """
    n = len(x)
    H = HIDDEN
    out = at + (n + 1) * H
    bias = at + (n + 3) * H
    sums = [[q(bias + r)] + [None] * n for r in range(2)]
    for k in range(H):
        W = [q(at + n * k + i) for i in range(n)]
        u = q(at + n * H + k) + sum(W[i] * x[i] for i in range(n))
        r = 1.0 / (1.0 + u * u)
        tau = u * r
        slope = r * (2.0 * r - 1.0)
        for total, o in zip(sums, (q(out + k), q(out + H + k)), strict=True):
            total[0] = total[0] + o * tau
            d = o * slope
            for i in range(n):
                total[i + 1] = d * W[i] if total[i + 1] is None else total[i + 1] + d * W[i]
    return sums


def layer(q: Callable[[int], Any], s: list[Any]) -> list[Any]:
    """Return the state after one layer, whose parameters are q(0..LAYER_SIZE - 1)."""
    x, J = _linear(q, 0, s[:3], s[3:12])
    J1 = J[:3]
    J2 = J[3:6]
    J3 = J[6:]
    det = s[12]
    G = s[13:16]
    H = HIDDEN
    (a, a1), (t, t1) = _hidden(q, 12, x[:1])
    root = sqrt(1.0 + a * a)
    # rate: d log S / dx_1
    S = a + root
    rate = a1 / root
    x2 = S * x[1] + t
    k1 = S * rate * x[1] + t1
    det = det * S
    G = [G[c] + rate * J1[c] for c in range(3)]
    old2 = J2
    J2 = [S * J2[c] + k1 * J1[c] for c in range(3)]
    (a, a1, a2), (t, t1, t2) = _hidden(q, 14 + 4 * H, x[:2])
    root = sqrt(1.0 + a * a)
    S = a + root
    inverse = 1.0 / root
    rate1 = a1 * inverse
    rate2 = a2 * inverse
    x3 = S * x[2] + t
    k1 = S * rate1 * x[2] + t1
    k2 = S * rate2 * x[2] + t2
    det = det * S
    G = [G[c] + rate1 * J1[c] + rate2 * old2[c] for c in range(3)]
    J3 = [S * J3[c] + k1 * J1[c] + k2 * old2[c] for c in range(3)]
    out = []
    rows = []
    for k, (value, row) in enumerate(((x[0], J1), (x2, J2), (x3, J3))):
        beta = q(LAYER_SIZE - 3 + k)
        root = sqrt(1.0 + value * value)
        inverse = 1.0 / root
        slope = 1.0 + beta * value * inverse
        out.append(value + beta * root)
        bend = beta * inverse * inverse * inverse / slope
        det = det * slope
        G = [G[c] + bend * row[c] for c in range(3)]
        rows += [slope * row[c] for c in range(3)]
    return [*out, *rows, det, *G]


def finish(q: Callable[[int], Any], s: list[Any]) -> list[Any]:
    """Return the state z with derivatives in the parent's axes in place of M's."""
    z, J = _linear(q, LAST, s[:3], s[3:12])
    m = [q(MEAN + k) for k in range(9)]

    def turned(row: list[Any]) -> list[Any]:  # (M row) for a row of derivatives in M's axes
        return [m[3 * r] * row[0] + m[3 * r + 1] * row[1] + m[3 * r + 2] * row[2] for r in range(3)]

    return [*z, *turned(J[:3]), *turned(J[3:6]), *turned(J[6:]), s[12], *turned(s[13:16])]


def normal(q: Callable[[int], Any], s: list[Any]) -> list[Any]:
    """Return JᵀJ (6, upper), Jᵀz (3), |z|^2, then what `finish` left from entry 10 on: state[12:16]
    stays.
    """
    J = [s[3:6], s[6:9], s[9:12]]

    def dot(a: int, b: int) -> Any:
        return J[0][a] * J[0][b] + J[1][a] * J[1][b] + J[2][a] * J[2][b]

    H = [dot(0, 0), dot(0, 1), dot(0, 2), dot(1, 1), dot(1, 2), dot(2, 2)]
    g = [J[0][a] * s[0] + J[1][a] * s[1] + J[2][a] * s[2] for a in range(3)]
    return [*H, *g, s[0] * s[0] + s[1] * s[1] + s[2] * s[2]]


_chart, _layer, _finish, _normal = (
    vectorized(formula, reads)
    for formula, reads in ((chart, 9), (layer, STATE), (finish, STATE), (normal, 12))
)


@kernel
def _gather(pose, ints, k, state):  # type: ignore[no-untyped-def]
    """Write the states of the joints of row k side by side."""
    for lane in range(WIDTH):
        Om = pose.Omega[ints[k, lane]]
        for r in range(3):
            state[3 * r * WIDTH + lane] = Om[r, 0]
            state[(3 * r + 1) * WIDTH + lane] = Om[r, 1]
            state[(3 * r + 2) * WIDTH + lane] = Om[r, 2]


@allocating_kernel
def _keep_off_half_turns(floats, k, state):  # type: ignore[no-untyped-def]
    """Take the joints of row k in `state` that are nearly a half turn from their M back to pi -
    `NEAREST`.
    """
    M = np.empty((3, 3))
    R = np.empty((3, 3))
    for lane in range(WIDTH):
        for e in range(9):
            M[e // 3, e % 3] = floats[k, (MEAN + e) * WIDTH + lane]
        trace = 0.0
        for r in range(3):
            for c in range(3):
                R[r, c] = 0.0
                for i in range(3):
                    R[r, c] += M[i, r] * state[(3 * i + c) * WIDTH + lane]
            trace += R[r, r]
        if 1.0 + trace > _MIN_TRACE:
            continue
        x, y, z = log3(
            R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2], R[2, 0], R[2, 1], R[2, 2]
        )
        scale = (math.pi - NEAREST) / math.sqrt(x * x + y * y + z * z)
        E = exp3(scale * x, scale * y, scale * z)
        for r in range(3):
            for c in range(3):
                state[(3 * r + c) * WIDTH + lane] = (
                    M[r, 0] * E[c] + M[r, 1] * E[3 + c] + M[r, 2] * E[6 + c]
                )


@allocating_kernel
def accumulate(tree, ints, floats, weight, inv_sigma, triggs, pose, blocks):  # type: ignore[no-untyped-def]
    """Add every joint's H_uu and g_u to the blocks and return the cost. ints (n, WIDTH), floats (n,
    FLOATS).
    """
    cost = 0.0
    if ints.shape[0] == 0 or weight <= 0.0:
        return cost
    state = np.empty(STATE * WIDTH)
    for k in range(ints.shape[0]):
        at = k * FLOATS
        _gather(pose, ints, k, state)
        _chart(floats, at, state)
        near = False
        for lane in range(WIDTH):
            near = near or not state[12 * WIDTH + lane] < _FARTHEST  # or not a number
        if near:
            _gather(pose, ints, k, state)
            _keep_off_half_turns(floats, k, state)
            _chart(floats, at, state)
        for number in range(LAYERS):
            _layer(floats, at + (FIRST_LAYER + number * LAYER_SIZE) * WIDTH, state)
        _finish(floats, at, state)
        _normal(floats, at, state)
        for lane in range(WIDTH):
            i = ints[k, lane]
            w = weight * floats[k, _W * WIDTH + lane]
            h = floats[k, (_W + 1) * WIDTH + lane]
            if i == 0 or w <= 0.0:
                continue
            e = state[lane::WIDTH]
            cost += 0.5 * w * e[9]
            h00 = w * e[0]
            h01 = w * e[1]
            h02 = w * e[2]
            h11 = w * e[3]
            h12 = w * e[4]
            h22 = w * e[5]
            g0 = w * e[6]
            g1 = w * e[7]
            g2 = w * e[8]
            if h > 0.0:
                a = (
                    floats[k, BOUND * WIDTH + lane]
                    - floats[k, CONSTANT * WIDTH + lane]
                    - math.log(e[12])
                )
                root = math.sqrt(a * a + 1.0)
                half = 0.5 * (a + root)  # l^2 / 2
                slope = half / root
                cost += w * h * half
                x = -slope * e[13]
                y = -slope * e[14]
                z = -slope * e[15]
                v = 0.5 * w * h / half
                h00 = h00 + v * x * x
                h01 = h01 + v * x * y
                h02 = h02 + v * x * z
                h11 = h11 + v * y * y
                h12 = h12 + v * y * z
                h22 = h22 + v * z * z
                g0 = g0 + w * h * x
                g1 = g1 + w * h * y
                g2 = g2 + w * h * z
            add_to_joint(tree, pose, blocks, i, h00, h01, h02, h11, h12, h22, g0, g1, g2)
    return cost


def pack(
    joints: Array, parameters: Array, weights: Array, log_det: float = 0.0
) -> tuple[Array, Array]:
    """Return the tables of `accumulate` from joints (n,) in 1..K, parameters (n, SIZE), weights w
    (n,), and h.
    """
    n = len(joints)
    rows = -(-n // WIDTH)
    ints = np.zeros((rows * WIDTH, 1), np.int64)
    floats = np.zeros((rows * WIDTH, SIZE + 2))
    floats[:, MEAN : MEAN + 9] = np.eye(3).ravel()
    ints[:n, 0] = joints
    floats[:n] = np.hstack(
        [np.reshape(parameters, (n, SIZE)), np.c_[weights], np.full((n, 1), log_det)]
    )
    width_last = floats.reshape(rows, WIDTH, SIZE + 2).transpose(0, 2, 1)
    return ints.reshape(rows, WIDTH), np.ascontiguousarray(width_last).reshape(rows, FLOATS)


def transform(parameters: Array, Omega: Array) -> tuple[Array, Array, Array, Array]:
    """Return z (..., 3), dz/dw (..., 3, 3), log |det dz/dmu| (...) and its gradient by w (..., 3).

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
    s = chart(p.__getitem__, s)
    for k in range(LAYERS):
        s = layer(p[FIRST_LAYER + k * LAYER_SIZE :].__getitem__, s)
    s = [np.asarray(v) for v in finish(p.__getitem__, s)]
    J = np.stack(s[3:12], -1).reshape(*s[0].shape, 3, 3)
    return np.stack(s[:3], -1), J, np.log(s[12]) + p[CONSTANT], np.stack(s[13:], -1)


def log_density(parameters: Array, Omega: Array) -> Array:
    """Return log p (...) in nats against the normalized Haar measure, so that the uniform
    distribution has 0.

    :param parameters: (SIZE,) of one joint.
    :param Omega: (..., 3, 3) states of the joint.
    """
    z, _, log_det, _ = transform(parameters, Omega)
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
        q = p[at:].__getitem__
        beta = p[at + LAYER_SIZE - 3 : at + LAYER_SIZE]
        x = (x - beta * np.sqrt(x * x + 1.0 - beta * beta)) / (1.0 - beta * beta)
        (a, _), (t, _) = _hidden(q, 12, [x[..., 0]])
        x2 = (x[..., 1] - t) * (np.sqrt(1.0 + a * a) - a)  # 1 / S(a) = S(-a)
        (a, _, _), (t, _, _) = _hidden(q, 14 + 4 * HIDDEN, [x[..., 0], x2])
        x3 = (x[..., 2] - t) * (np.sqrt(1.0 + a * a) - a)
        x = unmap(at, np.stack([x[..., 0], x2, x3], -1))
    squared = np.sum(x * x, axis=-1, keepdims=True)
    w = 2.0 / (squared + np.sqrt(squared * squared + 4.0))  # |y|^2 = (1 - w^2) / w
    quaternion = np.concatenate([w, x * np.sqrt(w)], axis=-1)
    return p[MEAN : MEAN + 9].reshape(3, 3) @ matrix_from_quaternion(quaternion)


def evaluate(
    part: Part, parameters: Array, weight: float = 1.0, log_det: float = 0.0
) -> Linearization:
    """Return the residual (4 rows) times sqrt(weight) and its derivatives; the last row is sqrt(h)
    l, h = log_det.

    :param parameters: (SIZE,) of the joint.
    """
    z, J, value, gradient = transform(parameters, part.Omega)
    a = parameters[BOUND] - value
    half = 0.5 * (a + np.sqrt(a * a + 1.0))
    last = np.sqrt(2.0 * log_det * half)
    slope = -np.sqrt(0.5 * log_det * half / (a * a + 1.0))
    scale = np.sqrt(weight)
    J_u = scale * np.vstack([J, slope * gradient]) @ part.R_parent.T
    return Linearization(
        scale * np.append(z, last), np.zeros((4, 6)), J_u, np.zeros((4, len(part.beta)))
    )
