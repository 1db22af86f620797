# SPDX-License-Identifier: GPL-3.0-or-later
"""A stack of small normalizing flows z = f(Omega) on SO(3), one for each model, in PyTorch.

Chart. With M a mean rotation and (w, v) the unit quaternion of MᵀOmega, w >= 0,
    y = v / sqrt(w)
is a diffeomorphism of SO(3) without the half turns from M (a set of measure zero) onto all of R^3:
|y| grows with the angle from M and tends to infinity at pi, as (pi - angle)^-1/2. The normalized
Haar measure is
    dmu = 2/pi^2 w^(5/2) / (1 + w^2) d^3y.
Layers. Each maps R^3 onto R^3, with a triangular derivative after a linear map:
    x <- A x + b
    x_2 <- S(s_2(x_1)) x_2 + t_2(x_1),   x_3 <- S(s_3(x_1, x_2)) x_3 + t_3(x_1, x_2),
    S(a) = a + sqrt(1 + a^2) > 0
    x_k <- x_k + beta_k sqrt(1 + x_k^2),  |beta_k| < 1
where s and t are linear in H hidden values tau(u) = u / (1 + u^2) of linear functions u. A last
linear map follows. Everything is algebraic and smooth, and each step has an inverse in closed form.
Likelihood, of density against Haar:
    log p(Omega) = -1/2 |z|^2 - 3/2 log 2 pi + log |det dz/dy|
                   - log(2/pi^2) - 5/2 log w + log(1 + w^2).

The layout of the parameters, `SIZES`, is that of solver/residuals/joint_flow.py.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

STEEPEST = 0.95  # bound of |beta|: slopes between 1/20 and 39/20


def chart(rotations: Tensor, mean: Tensor) -> tuple[Tensor, Tensor]:
    """Return y (..., 3) and log dmu/dy (...) of rotations (..., 3, 3) about means (..., 3, 3)."""
    R = mean.transpose(-1, -2) @ rotations
    four_ww = (1.0 + R.diagonal(dim1=-2, dim2=-1).sum(-1)).clamp_min(1e-12)
    four_wv = torch.stack(
        [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1
    )
    w = 0.5 * four_ww.sqrt()
    y = four_wv / four_ww[..., None] * w.sqrt()[..., None]
    return y, math.log(2.0 / math.pi**2) + 2.5 * w.log() - (1.0 + w * w).log()


def tau(u: Tensor) -> Tensor:
    """Return u / (1 + u²), which vanishes for large |u|: far from the data, the layers become
    linear.
    """
    return u / (1.0 + u * u)


class Flow(torch.nn.Module):
    """Flows of G models, evaluated in parallel; tensors are (G, n, 3)."""

    def __init__(self, means: Tensor, layers: int, hidden: int, seed: int) -> None:
        """Set up near the identity. means (G, 3, 3)."""
        super().__init__()
        g = torch.Generator().manual_seed(seed)
        G = len(means)
        H = hidden
        self.layers = layers
        self.hidden = hidden
        self.register_buffer("means", means)

        def small(*shape: int, scale: float) -> torch.nn.Parameter:
            return torch.nn.Parameter(scale * torch.randn(G, layers, *shape, generator=g))

        turns = torch.linalg.qr(torch.randn(G, layers, 3, 3, generator=g))[0]
        turns[:, 0] = torch.eye(3)
        self.A = torch.nn.Parameter(turns)
        self.b = small(3, scale=0.3)
        self.W2 = small(H, scale=1.0)
        self.c2 = small(H, scale=1.0)
        self.out2 = small(2, H, scale=0.02)
        self.W3 = small(H, 2, scale=0.7)
        self.c3 = small(H, scale=1.0)
        self.out3 = small(2, H, scale=0.02)
        self.bias2 = small(2, scale=0.0)
        self.bias3 = small(2, scale=0.0)
        self.beta = small(3, scale=0.1)  # through STEEPEST tanh
        self.A_last = torch.nn.Parameter(torch.eye(3).repeat(G, 1, 1))
        self.b_last = torch.nn.Parameter(torch.zeros(G, 3))

    def whiten(self, y: Tensor) -> None:
        """Make the first layer's linear map the one that gives samples y (G, n, 3) unit
        covariance.
        """
        with torch.no_grad():
            for k, sample in enumerate(y):
                mean = sample.mean(0)
                cov = sample.T.cov()
                self.A[k, 0] = torch.linalg.inv(torch.linalg.cholesky(cov))
                self.b[k, 0] = -self.A[k, 0] @ mean

    def row(self, k: int) -> dict[str, NDArray[np.float64]]:
        """Return the parameters of flow k as float64 arrays, beta itself in place of what it is
        computed from.
        """
        tensors = {"mean": self.means, **dict(self.named_parameters()), "beta": self.slopes()}
        return {name: t[k].detach().double().numpy().copy() for name, t in tensors.items()}

    def slopes(self) -> Tensor:
        """Return beta, (G, layers, 3)."""
        return STEEPEST * torch.tanh(self.beta)

    def forward(self, y: Tensor) -> tuple[Tensor, Tensor]:
        """Return z (G, n, 3) and log |det dz/dy| (G, n)."""
        x = y
        logdet = torch.zeros(y.shape[:-1])
        slope = self.slopes()
        for k in range(self.layers):
            x = x @ self.A[:, k].transpose(-1, -2) + self.b[:, None, k]
            x1, x2, x3 = x.unbind(-1)
            h = tau(x1[..., None] * self.W2[:, None, k] + self.c2[:, None, k])
            a, t = (h @ self.out2[:, k].transpose(-1, -2) + self.bias2[:, None, k]).unbind(-1)
            root = (1.0 + a * a).sqrt()
            scaled2 = (a + root) * x2 + t
            h = tau(
                torch.stack([x1, x2], -1) @ self.W3[:, k].transpose(-1, -2) + self.c3[:, None, k]
            )
            e, t = (h @ self.out3[:, k].transpose(-1, -2) + self.bias3[:, None, k]).unbind(-1)
            x3 = (e + (1.0 + e * e).sqrt()) * x3 + t
            x = torch.stack([x1, scaled2, x3], -1)
            root = (1.0 + x * x).sqrt()
            logdet = (
                logdet
                + torch.asinh(a)
                + torch.asinh(e)
                + torch.log1p(slope[:, None, k] * x / root).sum(-1)
            )
            x = x + slope[:, None, k] * root
        logdet = (
            logdet
            + (torch.linalg.slogdet(self.A)[1].sum(1) + torch.linalg.slogdet(self.A_last)[1])[
                :, None
            ]
        )
        return x @ self.A_last.transpose(-1, -2) + self.b_last[:, None], logdet

    def log_likelihood(self, rotations: Tensor) -> Tensor:
        """Return the log density (G, n) against the normalized Haar measure, of rotations (G, n, 3,
        3).
        """
        y, log_measure = chart(rotations, self.means[:, None])
        z, logdet = self(y)
        return -0.5 * (z * z).sum(-1) - 1.5 * math.log(2.0 * math.pi) + logdet - log_measure
