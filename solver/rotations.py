# SPDX-License-Identifier: Apache-2.0
"""Rotations: so(3) and SO(3) exponential, logarithm, left Jacobian; unit quaternions.

Conventions: a rotation vector phi (3,) in radians is angle times unit axis; exp(phi) turns
right-handed about it; quaternions are (w, x, y, z). Perturbations are on the left, R <- exp(w) R,
and the left Jacobian J satisfies exp(phi + d) = exp(J(phi) d) exp(phi) to first order, so
log(exp(w) R) = log(R) + J^-1(log R) w.

The upper half are scalar functions for compiled kernels: they take and return plain numbers, so
that nothing is allocated. The lower half does the same on numpy arrays with any leading dimensions.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from .arrays import as_arrays
from .errors import UnitsWarning, warn_caller
from .kernel import kernel
from .matrices import MINUS_EYE, add9, determinant, entries, product, transposed
from .part import Array

# above cos(angle) = -1 + this, the antisymmetric part of R still fixes the axis accurately
_PI_MARGIN = 1e-4
_SEVERAL_TURNS = 6.0 * math.pi  # radians, of a rotation vector


@kernel
def exp3(x: float, y: float, z: float) -> tuple[float, ...]:
    """Return the nine entries of exp((x, y, z)), row by row.

    R = I + a [phi]x + b [phi]x^2 with a = sin(th)/th, b = (1 - cos(th))/th^2; below half a radian
    both are summed as series to the last digit, which needs no trigonometric call.
    """
    s = x * x + y * y + z * z
    if s < 0.25:
        a = 1.0 - s / 72.0 * (1.0 - s / 110.0 * (1.0 - s / 156.0))
        a = 1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0 * a))
        b = 0.5 * (
            1.0
            - s / 12.0 * (1.0 - s / 30.0 * (1.0 - s / 56.0 * (1.0 - s / 90.0 * (1.0 - s / 132.0))))
        )
    else:
        th = math.sqrt(s)
        a = math.sin(th) / th
        h = math.sin(0.5 * th)
        b = 2.0 * h * h / s
    return (
        1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y,
        b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x,
        b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y),
    )  # fmt: skip


@kernel
def log3(  # type: ignore[no-untyped-def]
    r00, r01, r02, r10, r11, r12, r20, r21, r22
) -> tuple[float, ...]:
    """Return the rotation vector (3 numbers) of the rotation matrix given row by row, of angle in
    [0, pi].

    Near pi, where the antisymmetric part vanishes, the axis is the largest column of the symmetric
    part; exactly at pi the sign is arbitrary.
    """
    # sin(th) axis
    x = 0.5 * (r21 - r12)
    y = 0.5 * (r02 - r20)
    z = 0.5 * (r10 - r01)
    c = 0.5 * (r00 + r11 + r22 - 1.0)
    s2 = x * x + y * y + z * z
    if c > 0.9:
        # th / sin(th) = asin(s)/s as a series in s^2; here s^2 < 0.19
        if s2 < 1e-3:
            k = 3.0 / 40.0 + s2 * (15.0 / 336.0 + s2 * (105.0 / 3456.0 + s2 * 945.0 / 42240.0))
            k = 1.0 + s2 * (1.0 / 6.0 + s2 * k)
        else:
            s = math.sqrt(s2)
            k = math.atan2(s, c) / s
        return x * k, y * k, z * k
    s = math.sqrt(s2)
    th = math.atan2(s, c)
    if c > -1.0 + _PI_MARGIN:
        k = th / s
        return x * k, y * k, z * k
    # R + R^T = 2 cos(th) I + 2 (1 - cos(th)) a a^T: take the column of the largest diagonal entry
    # of a a^T
    if r00 >= r11 and r00 >= r22:
        ax = r00 - c
        ay = 0.5 * (r01 + r10)
        az = 0.5 * (r02 + r20)
    elif r11 >= r22:
        ax = 0.5 * (r01 + r10)
        ay = r11 - c
        az = 0.5 * (r12 + r21)
    else:
        ax = 0.5 * (r02 + r20)
        ay = 0.5 * (r12 + r21)
        az = r22 - c
    k = th / math.sqrt(ax * ax + ay * ay + az * az)
    if ax * x + ay * y + az * z < 0.0:
        k = -k
    return ax * k, ay * k, az * k


@kernel
def left_jacobian_inverse3(x: float, y: float, z: float) -> tuple[float, ...]:
    """Return the nine entries of J^-1 = I - [phi]x / 2 + k [phi]x^2, k = (1 - th/2 cot(th/2)) /
    th^2; finite at pi.
    """
    s = x * x + y * y + z * z
    if s < 1e-2:
        k = (1.0 + s * (1.0 / 60.0 + s * (1.0 / 2520.0 + s / 100800.0))) / 12.0
    else:
        h = 0.5 * math.sqrt(s)
        k = (1.0 - h * math.cos(h) / math.sin(h)) / s
    hx = 0.5 * x
    hy = 0.5 * y
    hz = 0.5 * z
    return (
        1.0 - k * (y * y + z * z), k * x * y + hz, k * x * z - hy,
        k * x * y - hz, 1.0 - k * (x * x + z * z), k * y * z + hx,
        k * x * z + hy, k * y * z - hx, 1.0 - k * (x * x + y * y),
    )  # fmt: skip


def hat(phi: ArrayLike) -> Array:
    """Return [phi]x, shape (..., 3, 3), with [phi]x p = phi x p.

    :raises ShapeError: the vectors have another shape.
    """
    phi = as_arrays(phi, (3,), "A rotation vector")
    out = np.zeros((*phi.shape, 3))
    out[..., 0, 1] = -phi[..., 2]
    out[..., 0, 2] = phi[..., 1]
    out[..., 1, 2] = -phi[..., 0]
    return out - np.swapaxes(out, -1, -2)


def exp(phi: ArrayLike) -> Array:
    """Return the rotation matrices (..., 3, 3) of rotation vectors (..., 3), radians.

    Vectors of several turns are probably in degrees, and give a `UnitsWarning`.

    :raises ShapeError: the vectors have another shape.
    """
    phi = as_arrays(phi, (3,), "A rotation vector")
    if (np.abs(phi) > _SEVERAL_TURNS).any():
        warn_caller(
            f"A rotation vector turns by {np.abs(phi).max():.6g} radians, several turns; convert "
            "degrees by numpy.radians.",
            UnitsWarning,
        )
    # numpy's sinc(x) is sin(pi x) / (pi x)
    turns = np.linalg.norm(phi, axis=-1)[..., None, None] / np.pi
    cross = hat(phi)
    return np.eye(3) + np.sinc(turns) * cross + 0.5 * np.sinc(0.5 * turns) ** 2 * (cross @ cross)


def log(rotation: ArrayLike) -> Array:
    """Return the rotation vectors (..., 3), of angle in [0, pi], of rotation matrices (..., 3, 3).

    :raises ShapeError: the matrices have another shape.
    """
    quaternion = quaternion_from_matrix(rotation)
    w = quaternion[..., :1]
    v = quaternion[..., 1:]
    n = np.linalg.norm(v, axis=-1, keepdims=True)
    small = n < 1e-6
    # w >= 0, so a small n means w = 1 to rounding: 2 atan(n / w) / n = 2 - 2 n^2 / 3
    phi: Array = v * np.where(
        small, 2.0 - 2.0 / 3.0 * n * n, 2.0 * np.arctan2(n, w) / np.where(small, 1.0, n)
    )
    return phi


def quaternion_from_rotation_vector(phi: ArrayLike) -> Array:
    """Return unit quaternions (..., 4), w first, of rotation vectors (..., 3), radians.

    :raises ShapeError: the vectors have another shape.
    """
    v = as_arrays(phi, (3,), "A rotation vector")
    half = 0.5 * np.linalg.norm(v, axis=-1, keepdims=True)
    # numpy's sinc(x) is sin(πx)/(πx): smooth at zero, where sin(half)/angle would divide by zero
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * v], axis=-1)


def quaternion_from_matrix(rotation: ArrayLike) -> Array:
    """Return unit quaternions (..., 4), w >= 0, of rotation matrices (..., 3, 3).

    Each matrix is divided by the largest component of its quaternion, which is never below 1/2.

    :raises ShapeError: the matrices have another shape.
    """
    r = as_arrays(rotation, (3, 3), "A rotation matrix")
    d = np.diagonal(r, axis1=-2, axis2=-1)
    squares = np.concatenate(
        [1.0 + d.sum(-1, keepdims=True), 1.0 + 2.0 * d - d.sum(-1, keepdims=True)], axis=-1
    )
    antisymmetric = [
        r[..., 2, 1] - r[..., 1, 2],
        r[..., 0, 2] - r[..., 2, 0],
        r[..., 1, 0] - r[..., 0, 1],
    ]
    outer = np.empty((*r.shape[:-2], 4, 4))  # 4 q q^T
    for i in range(4):
        outer[..., i, i] = squares[..., i]
    for i in range(3):
        outer[..., 0, i + 1] = outer[..., i + 1, 0] = antisymmetric[i]
        for j in range(i):
            outer[..., i + 1, j + 1] = outer[..., j + 1, i + 1] = r[..., i, j] + r[..., j, i]
    best = np.argmax(squares, axis=-1)
    q = np.take_along_axis(outer, best[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0.0, -q, q)


def matrix_from_quaternion(quaternion: ArrayLike) -> Array:
    """Return the rotation matrices (..., 3, 3) of quaternions (..., 4), which need not be
    normalized.

    :raises ShapeError: the quaternions have another shape.
    """
    q = as_arrays(quaternion, (4,), "A quaternion")
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    cross = hat(q[..., 1:])
    R: Array = np.eye(3) + 2.0 * q[..., :1, None] * cross + 2.0 * (cross @ cross)
    return R


@kernel
def orthonormalize(R) -> bool:  # type: ignore[no-untyped-def]
    """Make nearly orthonormal matrices (n, 3, 3) so to rounding, R <- R (3 I - RᵀR) / 2; False at
    one that is not.
    """
    for k in range(R.shape[0]):
        M = entries(R[k])
        off = add9(product(transposed(M), M), MINUS_EYE)
        worst = 0.0
        for e in off:
            worst = max(worst, abs(e))
        if not (worst < 1e-7 and determinant(M) > 0.0):
            return False
        more = product(M, off)
        for r in range(3):
            for c in range(3):
                R[k, r, c] -= 0.5 * more[3 * r + c]
    return True


def nearest_rotation(matrix: ArrayLike) -> Array:
    """Return the rotations (..., 3, 3) nearest to matrices in the Frobenius norm; the identity for
    non-finite ones.

    :raises ShapeError: the matrices have another shape.
    """
    m = np.array(as_arrays(matrix, (3, 3), "A matrix"), order="C")
    if orthonormalize(m.reshape(-1, 3, 3)):
        return m
    m = np.where(np.isfinite(m).all(axis=(-2, -1), keepdims=True), m, np.eye(3))
    u, _, vt = np.linalg.svd(m)
    u[..., :, 2] *= np.linalg.det(u @ vt)[..., None]
    R: Array = u @ vt
    return R


def shortest_turn(a: Array, b: Array) -> Array:
    """Return the smallest rotations (..., 3, 3) that take directions a (..., 3) to b (..., 3); half
    a turn if opposite.

    :raises ShapeError: the directions have another shape.
    """
    a = as_arrays(a, (3,), "A direction")
    b = as_arrays(b, (3,), "A direction")
    a = a / np.maximum(np.linalg.norm(a, axis=-1, keepdims=True), 1e-12)
    b = b / np.maximum(np.linalg.norm(b, axis=-1, keepdims=True), 1e-12)
    axis = np.cross(a, b)
    cosine = (a * b).sum(axis=-1)
    sine = np.linalg.norm(axis, axis=-1)
    # for opposite directions any perpendicular axis
    aside = np.cross(a, np.eye(3)[np.abs(a).argmin(axis=-1)])
    axis = np.where(((sine < 1e-9) & (cosine < 0))[..., None], aside, axis)
    length = np.maximum(np.linalg.norm(axis, axis=-1), 1e-12)
    return exp(axis * (np.arctan2(sine, cosine) / length)[..., None])
