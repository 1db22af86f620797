# SPDX-License-Identifier: GPL-3.0-or-later
r"""Points in space from their keypoints in several calibrated cameras, some of which are wrong.

    X* = argmin over X of Σ_c w_c ρ(|f_c (π(T_c X) − x_c)|),
    ρ(e) = s² e² / (s² + e²)   (Geman-McClure)

with the keypoints x_c in normalized image coordinates (undistorted, focal length 1), confidences
w_c and focal lengths f_c. The start is the best of the points that two cameras give linearly
(Hartley and Sturm 1997); a few Gauss-Newton steps with the weights of ρ follow.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...solver.rotations import exp, log

SCALE_PX = 15.0  # s of ρ, about the error of a keypoint that is right
GOOD_PX = 30.0  # the most that a keypoint may be off in a view that counts
GOOD_CONFIDENCE = 0.3  # the least confidence of one
GOOD_VIEWS = 3  # that a point needs
_STEPS = 10
_BEHIND = 1e3  # reprojection error, in focal lengths, of a point behind the camera


@dataclass(frozen=True)
class Triangulated:
    """N points: ``points`` (N, 3) metres, NaN without enough good views; ``error_px`` and ``good``
    (C, N).
    """

    points: NDArray[np.float64]
    error_px: NDArray[np.float64]
    good: NDArray[np.bool_]


def triangulate(
    x: NDArray[np.float64],
    confidence: NDArray[np.float64],
    T_camera_world: NDArray[np.float64],
    focal_px: NDArray[np.float64],
    views: int = GOOD_VIEWS,
) -> Triangulated:
    """Triangulate N points robustly.

    :param x: (C, N, 2) normalized image coordinates.
    :param confidence: (C, N), 0..1; 0 where a camera does not see the point.
    :param T_camera_world: (C, 4, 4).
    :param focal_px: (C,).
    :param views: good ones that a point needs; the others are NaN.
    """
    weight = _weight(confidence)
    seen = _Views(x, weight, T_camera_world, focal_px)
    best = np.full((x.shape[1], 3), np.nan)
    least = np.full(x.shape[1], np.inf)
    for pair in combinations(range(len(x)), 2):
        X = from_views(x[list(pair)], T_camera_world[list(pair)])
        cost = seen.cost(X)
        better = (weight[list(pair)] > 0).all(0) & (cost < least)
        best[better] = X[better]
        least[better] = cost[better]
    for _ in range(_STEPS):
        best = seen.step(best)
    error_px = seen.error_px(best)
    good = (weight > 0) & (error_px <= GOOD_PX)
    return Triangulated(np.where((good.sum(0) >= views)[:, None], best, np.nan), error_px, good)


def from_views(x: NDArray[np.float64], T_camera_world: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the points (N, 3), world, that solve x × (T X) = 0 in all views with the least
    algebraic error.

    :param x: (C, N, 2) normalized image coordinates.
    :param T_camera_world: (C, 4, 4).
    """
    T = T_camera_world[:, None, :3]
    # (2C, N, 4)
    rows = np.concatenate(
        [x[..., :1] * T[:, :, 2] - T[:, :, 0], x[..., 1:] * T[:, :, 2] - T[:, :, 1]]
    )
    h = np.linalg.svd(rows.transpose(1, 0, 2))[2][:, -1]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(h[:, :3] / h[:, 3:])


def project(X: NDArray[np.float64], T_camera_world: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the normalized image coordinates (C, N, 2) of points (N, 3); far outside for those
    behind a camera.
    """
    p = _in_cameras(X, T_camera_world)
    ahead = p[..., 2:] > 1e-6
    return np.asarray(np.where(ahead, p[..., :2] / np.where(ahead, p[..., 2:], 1.0), _BEHIND))


@dataclass(frozen=True)
class _Views:
    """What C cameras see of N points, in the notation of `triangulate`; ``weight`` (C, N) is w."""

    x: NDArray[np.float64]
    weight: NDArray[np.float64]
    T: NDArray[np.float64]
    focal_px: NDArray[np.float64]

    def error_px(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the errors e (C, N) of points (N, 3)."""
        return np.asarray(
            self.focal_px[:, None] * np.linalg.norm(project(X, self.T) - self.x, axis=-1)
        )

    def cost(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the cost (N,) of each point; infinite for NaN."""
        e2 = self.error_px(X) ** 2
        return np.asarray(
            np.nan_to_num(self.weight * SCALE_PX**2 * e2 / (SCALE_PX**2 + e2), nan=np.inf).sum(0)
        )

    def step(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the points after one Gauss-Newton step."""
        R = self.T[:, None, :3, :3]
        q = project(X, self.T)
        depth = np.maximum(_in_cameras(X, self.T)[..., 2, None, None], 1e-6)
        r = self.focal_px[:, None, None] * (q - self.x)
        J = (
            self.focal_px[:, None, None, None]
            * (R[..., :2, :] - q[..., None] * R[..., 2:, :])
            / depth
        )
        w = self.weight * _robust(r)
        H = np.einsum("cn,cnij,cnik->njk", w, J, J) + 1e-6 * np.eye(3)
        g = np.einsum("cn,cnij,cni->nj", w, J, r)
        known = np.isfinite(X).all(-1) & np.isfinite(H).all((1, 2))
        moved = X.copy()
        moved[known] -= np.linalg.solve(H[known], g[known][..., None])[..., 0]
        return moved


def _in_cameras(X: NDArray[np.float64], T_camera_world: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (N, 3), world, in the axes of each camera, (C, N, 3)."""
    return np.asarray(
        X @ T_camera_world[:, :3, :3].transpose(0, 2, 1) + T_camera_world[:, None, :3, 3]
    )


def _weight(confidence: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return w: the confidences, 0 for those that are too small."""
    return np.where(confidence >= GOOD_CONFIDENCE, confidence, 0.0)


def _robust(r: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the factor s⁴ / (s² + e²)² of ρ on the weights of errors (..., 2), pixels."""
    return np.asarray((SCALE_PX**2 / (SCALE_PX**2 + (r**2).sum(-1))) ** 2)


def adjust_cameras(
    x: NDArray[np.float64],
    confidence: NDArray[np.float64],
    T_camera_world: NDArray[np.float64],
    focal_px: NDArray[np.float64],
    sigma_rad: float,
    sigma_m: float,
    steps: int = 30,
) -> NDArray[np.float64]:
    """Return the cameras (C, 4, 4) in which N points are most consistent: bundle adjustment of
    points and poses.

    The cost is that of `triangulate` over all points with enough views, plus |ω_c|² / σ_r² + |t_c|²
    / σ_t² for each camera's correction T_c ← exp(ω_c, t_c) T_c in its own axes, which also
    determines the scale. The points are eliminated (Schur complement), so each step solves for 6 C
    unknowns.

    :param x: (C, N, 2) normalized image coordinates.
    :param confidence: (C, N), 0..1.
    :param T_camera_world: (C, 4, 4), where the corrections begin.
    :param focal_px: (C,).
    :param sigma_rad: σ_r, standard deviation of a camera's rotation about each axis.
    :param sigma_m: σ_t, that of its position along each axis, metres.
    """
    C = len(x)
    start = T_camera_world
    T = T_camera_world.copy()
    weight = _weight(confidence)
    inverse_variance = np.tile([sigma_rad**-2.0] * 3 + [sigma_m**-2.0] * 3, C) * SCALE_PX**2
    for _ in range(steps):
        X = triangulate(x, confidence, T, focal_px, views=2).points
        known = np.isfinite(X).all(-1) & ((weight > 0).sum(0) >= GOOD_VIEWS)
        p = _in_cameras(X[known], T)
        q = p[..., :2] / p[..., 2:]
        f = focal_px[:, None, None]
        r = f * (q - x[:, known])
        J_camera = (
            f[..., None]
            * np.concatenate([np.eye(2) + 0 * q[..., None], -q[..., None]], -1)
            / p[..., 2:, None]
        )
        w = weight[:, known] * _robust(r)
        J_point = J_camera @ T[:, None, :3, :3]
        # (C, N, 2, 6): dp = ω × p + t
        J_pose = np.concatenate([J_camera @ -_cross(p), J_camera], -1)
        H_points = np.einsum("cn,cnij,cnik->njk", w, J_point, J_point) + 1e-6 * np.eye(3)
        g_points = np.einsum("cn,cnij,cni->nj", w, J_point, r)
        mixed = np.einsum("cn,cnij,cnik->ncjk", w, J_pose, J_point).reshape(len(p[0]), 6 * C, 3)
        H = np.zeros((6 * C, 6 * C))
        for c, block in enumerate(np.einsum("cn,cnij,cnik->cjk", w, J_pose, J_pose)):
            H[6 * c : 6 * c + 6, 6 * c : 6 * c + 6] = block
        g = np.einsum("cn,cnij,cni->cj", w, J_pose, r).ravel()
        inverse = np.linalg.inv(H_points)
        H -= np.einsum("nij,njk,nlk->il", mixed, inverse, mixed)
        g -= np.einsum("nij,njk,nk->i", mixed, inverse, g_points)
        so_far = np.concatenate([_correction(a, b) for a, b in zip(T, start, strict=True)])
        change = -np.linalg.solve(
            H + np.diag(inverse_variance), g + inverse_variance * so_far
        ).reshape(C, 6)
        for c in range(C):
            R = exp(change[c, :3])
            T[c, :3] = R @ T[c, :3]
            T[c, :3, 3] += change[c, 3:]
        if np.abs(change).max() < 1e-7:
            break
    return T


def _correction(T: NDArray[np.float64], start: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rotation vector and translation (6,) that lead from one pose of a camera to the
    other.
    """
    D = T @ np.linalg.inv(start)
    return np.concatenate([log(D[:3, :3]), D[:3, 3]])


def _cross(p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrices [p]× (..., 3, 3)."""
    x, y, z = np.moveaxis(p, -1, 0)
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], -1).reshape(*p.shape, 3)
