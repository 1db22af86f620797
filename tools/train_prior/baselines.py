# SPDX-License-Identifier: GPL-3.0-or-later
"""Baselines for the flow, fitted by maximum likelihood: log densities against the normalized Haar
measure.

Gaussian in the tangent space of the mean M, phi = log(MᵀOmega) ~ N(m, C), with the volume factor of
the chart:
    dmu = (1 - cos|phi|) / (4 pi^2 |phi|^2) d^3phi
and divided by its mass within the ball |phi| < pi, by samples. Matrix Fisher, which is Bingham's
distribution of the unit quaternion: p = exp(tr FᵀOmega) / c(s), F = U diag(s) Vᵀ,
    c(s) = int_-1^1 1/2 I_0[(s_i - s_j)(1 - u)/2] I_0[(s_i + s_j)(1 + u)/2] exp(s_k u) du
for any order i, j, k of the proper singular values; found from E[Omega] = U diag(d) Vᵀ by d log c /
ds = d. Source: T. Lee, "Bayesian attitude estimation with the matrix Fisher distribution on SO(3)"
(2018), for c as a 1-D integral.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...solver.rotations import log

# rotations (n, 3, 3) -> log densities (n,)
Density = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def gaussian(
    rotations: NDArray[np.float64], weights: NDArray[np.float64], mean: NDArray[np.float64]
) -> Density:
    """Fit a Gaussian in the tangent space of ``mean`` (3, 3) to rotations (n, 3, 3) with
    probabilities (n,).
    """
    phi = log(mean.T @ rotations)
    m = weights @ phi
    C = np.einsum("n,ni,nj->ij", weights, phi - m, phi - m)
    L = np.linalg.cholesky(C)
    inverse = np.linalg.inv(L)
    constant = -np.log(np.diag(L)).sum() - 1.5 * np.log(2.0 * np.pi)
    inside = np.linalg.norm(m + _normal_grid() @ L.T, axis=1) < np.pi
    mass = inside.mean()

    def density(omega: NDArray[np.float64]) -> NDArray[np.float64]:
        x = log(mean.T @ omega)
        squared = (x * x).sum(-1)
        volume = np.where(
            squared < 1e-6, 0.5, (1.0 - np.cos(np.sqrt(squared))) / np.maximum(squared, 1e-12)
        )
        d = (x - m) @ inverse.T
        return -0.5 * (d * d).sum(-1) + constant - np.log(mass) - np.log(volume / (4.0 * np.pi**2))

    return density


def _normal_grid() -> NDArray[np.float64]:
    return np.random.default_rng(0).standard_normal((200_000, 3))


def log_i0e(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return log(I_0(x) exp(-|x|)) of the modified Bessel function."""
    a = np.abs(x)
    far = np.maximum(a, 100.0)
    series = 1.0 + (1.0 + (9.0 + 75.0 / (8.0 * far)) / (16.0 * far)) / (8.0 * far)
    near = np.minimum(a, 100.0)
    return np.where(
        a > 100.0, np.log(series) - 0.5 * np.log(2.0 * np.pi * far), np.log(np.i0(near)) - near
    )


_NODES = tuple(
    0.5 * (a + b) for a, b in zip(np.polynomial.legendre.leggauss(200), (1.0, 0.0), strict=True)
)


def log_fisher_constant(s: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Return log c(s) and its gradient (3,), for proper singular values s_1 >= s_2 >= |s_3|.

    u is integrated by Gauss-Legendre in sqrt(1 - u): the mass is within 1 / (s_2 + s_3) of u = 1.
    """
    return _log_c(s), np.array([_slope(s, k) for k in range(3)])


def _log_c(s: NDArray[np.float64]) -> float:
    x, w = _NODES
    scale = min(1.0, 6.0 / np.sqrt(1.0 + max(s[0] + s[2], 1.0)))  # of sqrt((1 - u) / 2)
    total = []
    for low, high in ((0.0, scale), (scale, 1.0))[: 1 if scale == 1.0 else 2]:
        v = low + (high - low) * x
        u = 1.0 - 2.0 * v * v
        # i, j, k = 2, 3, 1: both Bessel arguments and the exponent, peak at u = 1 taken out
        a = 0.5 * (s[1] - s[2]) * (1.0 - u)
        b = 0.5 * (s[1] + s[2]) * (1.0 + u)
        exponent = np.abs(a) + np.abs(b) + s[0] * u - (s[0] + s[1] + s[2])
        total.append(log_i0e(a) + log_i0e(b) + exponent + np.log(2.0 * w * (high - low) * v))
    all_terms = np.concatenate(total)
    top = all_terms.max()
    return float(s.sum() + top + np.log(np.exp(all_terms - top).sum()))


def _slope(s: NDArray[np.float64], k: int) -> float:
    h = 1e-4 * max(1.0, abs(s[k]))
    step = h * np.eye(3)[k]
    return (_log_c(s + step) - _log_c(s - step)) / (2.0 * h)


def matrix_fisher(rotations: NDArray[np.float64], weights: NDArray[np.float64]) -> Density:
    """Fit a matrix Fisher distribution to rotations (n, 3, 3) with probabilities (n,)."""
    U, d, Vt = np.linalg.svd(np.einsum("n,nij->ij", weights, rotations))
    if np.linalg.det(U) < 0:
        U[:, 2] = -U[:, 2]
        d[2] = -d[2]
    if np.linalg.det(Vt) < 0:
        Vt[2] = -Vt[2]
        d[2] = -d[2]
    s = _from_moments(d)
    F = U @ np.diag(s) @ Vt
    constant = _log_c(s)
    return lambda omega: np.einsum("ij,nij->n", F, omega) - constant


def _from_moments(d: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve d log c / ds = d by damped Newton steps on the convex log c(s) - s d, from the
    concentrated limit.

    There 1 - d_k = (1/(s_k + s_i) + 1/(s_k + s_j)) / 2.
    """
    gaps = np.maximum(1.0 - d, 1e-9)
    pair = 1.0 / np.maximum(gaps.sum() - 2.0 * gaps, 1e-6)  # s_i + s_j from the gap of the third
    s = 0.5 * pair.sum() - pair
    s = np.sort(s)[::-1]
    best = _log_c(s) - s @ d
    for _ in range(200):
        g = np.array([_slope(s, k) for k in range(3)]) - d
        h = 1e-3 * np.maximum(1.0, np.abs(s))
        H = np.array(
            [
                [
                    (_slope(s + h[j] * np.eye(3)[j], k) - _slope(s - h[j] * np.eye(3)[j], k))
                    / (2 * h[j])
                    for j in range(3)
                ]
                for k in range(3)
            ]
        )
        step = np.linalg.solve(0.5 * (H + H.T) + 1e-12 * np.eye(3), g)
        size = 1.0
        while size > 1e-6:
            trial = np.sort(s - size * step)[::-1]
            value = _log_c(trial) - trial @ d
            if np.isfinite(value) and value < best:
                break
            size *= 0.5
        else:
            return s
        s = trial
        gain = best - value
        best = value
        if gain < 1e-10:
            return s
    return s
