# SPDX-License-Identifier: GPL-3.0-or-later
"""How the picture moves while a camera only rotates and zooms: alike at any depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....solver.rotations import exp, log
from ...arrays import BoolArray, Float64Array
from .bundle_adjustment import narrowing_weights, normal_equations, projected

STEPS = 10
PRIOR = (1e-9, 1e-9, 1e-9, 1e-3, 1e-6)  # small rotations do not tell the focal length
_DIFFERENCE = 1e-6


@dataclass(frozen=True)
class Turn:
    """How lines of sight move while a camera only rotates and zooms: p_b ~ D(a g) R D(1 / a) p_a.

    D(a) = diag(a, a, 1); ``focal`` a is the true focal length relative to the assumed one.
    """

    R: Float64Array  # (3, 3)
    focal: float
    zoom: float  # g, of the focal length from the first frame to the second

    @classmethod
    def none(cls, focal: float = 1.0) -> Turn:
        """Return the turn of a camera that neither rotates nor zooms."""
        return cls(np.eye(3), focal, 1.0)

    @property
    def assumed_rotation(self) -> Float64Array:
        """The rotation (3, 3) that moves the picture as much by the assumed focal length."""
        return exp(log(self.R) * [self.focal, self.focal, 1.0])

    @classmethod
    def nearest(cls, H: Float64Array) -> Turn:
        """Return the turn nearest to a homography (3, 3) of lines of sight.

        With the right a and g, D(1 / (a g)) H D(a) has equal singular values.
        """
        focal = 1.0
        zoom = 1.0
        R = np.eye(3)
        for focal_step, zoom_step in ((1.1, 1.08), (1.03, 1.02), (1.008, 1.005)):
            factors = np.arange(-5, 6)
            focals, zooms = np.meshgrid(focal * focal_step**factors, zoom * zoom_step**factors)
            a = focals.ravel()
            g = zooms.ravel()
            one = np.ones(len(a))
            left = np.stack([1.0 / (a * g), 1.0 / (a * g), one], axis=1)
            right = np.stack([a, a, one], axis=1)
            U, s, Vt = np.linalg.svd(left[:, :, None] * H * right[:, None])
            best = int(((s[:, 0] - s[:, 2]) / s[:, 1]).argmin())
            focal = float(a[best])
            zoom = float(g[best])
            R = U[best] @ Vt[best]
        return cls(R * np.sign(np.linalg.det(R)), focal, zoom)

    def residuals(self, rays_a: Float64Array, rays_b: Float64Array) -> Float64Array:
        """Return the (n, 2) differences of lines of sight (n, 2) from where the turn takes them."""
        a = self.focal
        turned = homogeneous(rays_a / a) @ self.R.T
        return projected(turned) * (a * self.zoom) - rays_b

    def explains(self, rays_a: Float64Array, rays_b: Float64Array, tolerance: float) -> BoolArray:
        """Return (n,) whether the turn takes lines of sight (n, 2) to others (n, 2)."""
        return np.linalg.norm(self.residuals(rays_a, rays_b), axis=1) < tolerance

    def refined(
        self, rays_a: Float64Array, rays_b: Float64Array, scale: float, steps: int = STEPS
    ) -> Turn:
        """Return the turn that most lines of sight, (n, 2) and (n, 2), agree with, from this one.

        :param scale: of the robust kernel at the end, radians; it begins eight times as wide.
        :param steps: at least 4, after which the kernel is as narrow.
        """
        turn = self
        for step in range(steps):
            residuals = turn.residuals(rays_a, rays_b)
            weight = narrowing_weights(residuals, scale, step)
            J = np.empty((*residuals.shape, 5))
            for k, direction in enumerate(np.eye(5) * _DIFFERENCE):
                J[..., k] = (turn.moved(direction).residuals(rays_a, rays_b) - residuals) / (
                    _DIFFERENCE
                )
            H, g = normal_equations(J, residuals, weight)
            change = np.linalg.solve(H + np.diag(PRIOR), -g)
            turn = turn.moved(np.clip(change, -0.2, 0.2))
        return turn

    def moved(self, change: Float64Array) -> Turn:
        """Return the turn after a change (5,): rotation, logarithms of focal length and zoom."""
        return Turn(
            exp(change[:3]) @ self.R,
            float(np.clip(self.focal * np.exp(change[3]), 0.4, 2.5)),
            float(self.zoom * np.exp(change[4])),
        )


def homogeneous(rays: Float64Array) -> Float64Array:
    """Return lines of sight (n, 2) as (n, 3) with z = 1."""
    return np.concatenate([rays, np.ones((len(rays), 1))], axis=1)
