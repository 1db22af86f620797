# SPDX-License-Identifier: GPL-3.0-or-later
"""A dense Gauss-Newton step built from scratch: residuals from their definition, Jacobian by
complex steps.
"""

import numpy as np

from .synthetic import INTRINSICS, forward

H = 1e-30


def hat(w):
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def complex_log(R):
    """Rotation vector of a rotation matrix, analytic in its entries; not at 0 and pi."""
    c = (np.trace(R) - 1) / 2
    theta = np.arccos(c + 0j)
    return (
        theta
        / (2 * np.sin(theta))
        * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    )


def moved(body, state, d):
    """The state moved by d = (w, nu, u_1..K, dbeta), to first order and hence exact for a complex
    step.
    """
    R0, t0, Omega, beta = state
    K = len(Omega)
    R, _, _ = forward(body, *state)
    u = d[6 : 6 + 3 * K].reshape(K, 3)
    Omega = np.array(
        [
            R[body.parents[i + 1]].T @ (np.eye(3) + hat(u[i])) @ R[body.parents[i + 1]] @ Omega[i]
            for i in range(K)
        ]
    )
    return (
        (np.eye(3) + hat(d[:3])) @ R0,
        t0 + d[3:6],
        Omega,
        beta + d[6 + 3 * K : 6 + 3 * K + len(beta)],
    )


def jacobian(body, state, residual, extra=0):
    """J (n, 6 + 3K + P + extra) of residual(state, d) at `state`."""
    n = 6 + 3 * len(state[2]) + len(state[3]) + extra
    columns = []
    for k in range(n):
        d = np.zeros(n, complex)
        d[k] = 1j * H
        columns.append(np.imag(residual(moved(body, state, d), d)) / H)
    return np.array(columns).T


def residuals(body, data, focal=False):
    """The function (state, d) -> unweighted residuals of `data`, a list of (n, width) arrays."""
    u = (data["pixels"][:, 0] - INTRINSICS[0, 2]) / INTRINSICS[0, 0]
    v = (data["pixels"][:, 1] - INTRINSICS[1, 2]) / INTRINSICS[1, 1]

    def raw(state, d):
        R, t, p = forward(body, *state)
        f = np.exp(d[-1]) if focal else 1.0
        r2 = np.stack([f * p[:, 0] / p[:, 2] - u, f * p[:, 1] / p[:, 2] - v], 1)
        r3 = p - data["points"]
        bone = p - t[body.keypoint_part]
        rd = bone / np.sqrt((bone**2).sum(1))[:, None] - data["directions"]
        out = [r2, r3, rd]
        if "joint_weights" in data:
            phi = [
                complex_log(M.T @ Om) for M, Om in zip(data["joint_mean"], state[2], strict=True)
            ]
            out.append(np.array(phi))
            out.append(np.array([complex_log(data["R_hat"].T @ R[data["part"]])]))
            out.append((t[data["part"]] - data["t_hat"])[None])
        return out

    return raw


def robust_factors(raw, sigmas, weights):
    """sqrt(weight rho'(|r|^2)) of each residual, and the cost 1/2 sum weight rho."""
    factors = []
    cost = 0.0
    for r, sigma, weight in zip(raw, sigmas, weights, strict=True):
        s = (np.real(r) ** 2).sum(1)
        k = 1.0 / (1.0 + s / sigma)
        factors.append(np.sqrt(weight) * k)
        cost += 0.5 * np.sum(weight * s * k)
    return factors, cost
