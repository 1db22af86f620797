# SPDX-License-Identifier: GPL-3.0-or-later
"""Every residual once more, in plain numpy, with its Jacobians: what its kernel is compared with.

Each function is named after its residual's module, whose docstring has the equation. It returns the
residual times the root of its weight, without robust kernel, and its derivatives as solver/part.py
defines them. Points are given by `v_bar` (3,) and `V` (3, P), relative to their part's origin, in
metres.
"""

import numpy as np
from scope.solver.part import Linearization
from scope.solver.residuals import joint_flow as flow
from scope.solver.residuals.keypoint2d import Z_MIN
from scope.solver.residuals.orientation_field import SHORTEST
from scope.solver.rotations import left_jacobian_inverse, log


def hat_identity(e):
    """Return dp/dx = [-[e]x, I] (3, 6) of a point at e (3,) from the origin of twists."""
    return np.hstack([np.array([[0, e[2], -e[1]], [-e[2], 0, e[0]], [e[1], -e[0], 0]]), np.eye(3)])


def point_jacobian(part, p, V):
    """Return dp/dx (3, 6) and dp/dbeta (3, P) of a point fixed to a part.

    dp = w x (p - origin) + nu + (R V + D) dbeta
    """
    return hat_identity(p - part.origin), part.R @ V + part.D


def keypoint2d(part, v_bar, V, uv, weight=1.0, focal=1.0):
    """Return r sqrt(weight) (2 rows, or 3 behind z_min), without robust kernel, and its
    derivatives.

    v_bar (3,), V (3, P) of the keypoint in metres; uv (2,) normalized image coordinates.
    """
    p = part.R @ (V @ part.beta + v_bar) + part.t
    front = p[2] > Z_MIN
    z = p[2] if front else Z_MIN
    r = focal * p[:2] / z - uv
    G = np.zeros((2, 3))
    G[0, 0] = G[1, 1] = focal / z
    if front:
        G[:, 2] = -focal * p[:2] / z**2
    else:
        r = np.append(r, (Z_MIN - p[2]) / Z_MIN)
        G = np.vstack([G, [0.0, 0.0, -1.0 / Z_MIN]])
    J_x, J_beta = point_jacobian(part, p, V)
    G = G * np.sqrt(weight)
    return Linearization(r * np.sqrt(weight), G @ J_x, np.zeros((len(r), 3)), G @ J_beta)


def keypoint3d(part, v_bar, V, point, weight=1.0):
    """Return r sqrt(weight) (3 rows), without robust kernel, and its derivatives; of a contact too.

    :param v_bar, V: (3,), (3, P) of the point relative to its part's origin, metres.
    :param point: (3,) where it was measured, metres, camera frame.
    """
    p = part.R @ (V @ part.beta + v_bar) + part.t
    J_x, J_beta = point_jacobian(part, p, V)
    g = np.sqrt(weight)
    return Linearization(g * (p - point), g * J_x, np.zeros((3, 3)), g * J_beta)


def orientation_field(part, v_bar, V, direction, weight=1.0):
    """Return r sqrt(weight) (3 rows), without robust kernel, and its derivatives.

    :param v_bar, V: (3,), (3, P) of the second point relative to the first, metres.
    :param direction: (3,) measured unit vector, camera frame.
    """
    d = part.R @ (V @ part.beta + v_bar)
    length = np.linalg.norm(d)
    zeros = np.zeros((3, 3))
    if length < SHORTEST:
        return Linearization(np.zeros(3), np.zeros((3, 6)), zeros, np.zeros((3, len(part.beta))))
    unit = d / length
    G = np.sqrt(weight) * (np.eye(3) - np.outer(unit, unit)) / length
    return Linearization(
        np.sqrt(weight) * (unit - direction),
        G @ np.hstack([hat_identity(d)[:, :3], zeros]),
        zeros,
        G @ part.R @ V,
    )


def floor(
    part,
    v_bar,
    V,
    normal,
    offset,
    w_below,
    w_above,
    weight=1.0,
):
    """Return the residual (1 row) times sqrt(weight) and its derivatives.

    :param v_bar, V: (3,), (3, P) of the point relative to its part's origin, metres.
    :param normal, offset: of the plane normal^T p = offset in camera axes; (3,), a unit vector
        pointing up, and metres.
    """
    p = part.R @ (V @ part.beta + v_bar) + part.t
    J_x, J_beta = point_jacobian(part, p, V)
    h = float(normal @ p) - offset
    g = np.sqrt(weight * (w_below if h < 0.0 else w_above))
    return Linearization(
        np.array([g * h]), g * (normal @ J_x)[None], np.zeros((1, 3)), g * (normal @ J_beta)[None]
    )


def outline(part, v_bar, V, m, n, weight=1.0):
    """Return the residual (1 row) of one side times sqrt(weight), without robust kernel, and its
    derivatives.

    :param v_bar, V: (3,), (3, P) of the point relative to its part's origin, delta included,
        metres.
    :param m, n: (2,) contour point and (2,) outward normal, normalized image coordinates.
    """
    p = part.R @ (V @ part.beta + v_bar) + part.t
    J_x, J_beta = point_jacobian(part, p, V)
    g = np.sqrt(weight) * np.append(n, -n @ p[:2] / p[2]) / p[2]
    d = float(n @ (p[:2] / p[2] - m))
    return Linearization(
        np.array([np.sqrt(weight) * d]), (g @ J_x)[None], np.zeros((1, 3)), (g @ J_beta)[None]
    )


def pose_prior(part, R_hat, t_hat, w_R, w_t, weight=1.0):
    """Return the residual (6 rows) times sqrt(weight) and its derivatives.

    :param R_hat, t_hat: (3, 3), (3,) the expected pose of the part, metres, camera frame.
    """
    phi = log(R_hat.T @ part.R)
    a = np.sqrt(weight * w_R)
    b = np.sqrt(weight * w_t)
    J_x = np.zeros((6, 6))
    J_x[:3, :3] = a * left_jacobian_inverse(phi) @ R_hat.T
    J_x[3:] = b * hat_identity(part.t - part.origin)
    J_beta = np.vstack([np.zeros_like(part.D), b * part.D])
    return Linearization(
        np.concatenate([a * phi, b * (part.t - t_hat)]), J_x, np.zeros((6, 3)), J_beta
    )


def joint_prior(part, Omega_mean, weight=1.0):
    """Return the residual (3 rows) times sqrt(weight) and its derivatives; `Omega_mean` (3, 3) is a
    joint state.
    """
    phi = log(Omega_mean.T @ part.Omega)
    g = np.sqrt(weight)
    J_u = g * left_jacobian_inverse(phi) @ Omega_mean.T @ part.R_parent.T
    return Linearization(g * phi, np.zeros((3, 6)), J_u, np.zeros((3, len(part.beta))))


def joint_flow(part, parameters, weight=1.0):
    """Return the residual (3 rows) times sqrt(weight) and its derivatives.

    :param parameters: (SIZE,) of the joint.
    """
    z, J, _ = flow.transform(parameters, part.Omega)
    scale = np.sqrt(weight)
    J_u = scale * J @ part.R_parent.T
    return Linearization(scale * z, np.zeros((3, 6)), J_u, np.zeros((3, len(part.beta))))


def joint_limits(
    part,
    axis,
    lower,
    upper,
    swing_limit,
    w,
    w_swing,
    weight=1.0,
):
    """Return the residual (4 rows) times sqrt(weight) and its derivatives.

    :param axis: (3,) a unit vector, in the parent's rest axes.
    :param lower, upper, swing_limit: radians.
    """
    phi = log(part.Omega)
    J = left_jacobian_inverse(phi) @ part.R_parent.T
    angle = float(axis @ phi)
    s = phi - angle * axis
    swing = np.linalg.norm(s)
    r = np.zeros(4)
    J_u = np.zeros((4, 3))
    r[0] = max(0.0, angle - upper) - max(0.0, lower - angle)
    if r[0] != 0.0:
        J_u[0] = axis @ J
    if swing > swing_limit:
        share = 1.0 - swing_limit / swing
        unit = s / swing
        r[1:] = share * s
        J_u[1:] = (
            (share * np.eye(3) + (1.0 - share) * np.outer(unit, unit))
            @ (np.eye(3) - np.outer(axis, axis))
            @ J
        )
    scale = np.sqrt(weight * np.array([w, w_swing, w_swing, w_swing]))
    return Linearization(
        scale * r, np.zeros((4, 6)), scale[:, None] * J_u, np.zeros((4, len(part.beta)))
    )


def shape_prior(part, mean, information, weight=1.0):
    """Return the residual (P rows) and its derivatives for `mean` (P,) and `information` (P, P),
    positive definite.
    """
    root = np.sqrt(weight) * np.linalg.cholesky(information).T
    n = len(part.beta)
    return Linearization(root @ (part.beta - mean), np.zeros((n, 6)), np.zeros((n, 3)), root)
