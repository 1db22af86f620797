# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations of dense steps: analytic, so that complex steps differentiate them."""

import numpy as np

from .synthetic import forward

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
