# SPDX-License-Identifier: GPL-3.0-or-later
"""Bundle adjustment: frames and places of corners that agree best with where the corners are seen.

    minimize  Σ_i ρ(|π(R_f(i) p_c(i) + t_f(i)) − r_i|²)      π(x, y, z) = (x / z, y / z)

over the poses (R, t) of the frames f and the places p of the corners c, with a Cauchy kernel ρ, by
damped Gauss-Newton steps. A pose moves as R ← exp(ω) R, t ← exp(ω) t + v. Each corner's place is
eliminated first (Schur complement), so a step costs what the poses do: some tens of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ....solver.rotations import exp, hat
from ...arrays import Float64Array, IndexArray

STEPS = 8
POSE_STEPS = 8
_NEAREST = 1e-3  # depth of a corner, in units of the path
_TOLERANCE = 1e-4  # relative decrease of the cost by the last step
_LARGEST_DAMPING = 1e3
_State = TypeVar("_State")


@dataclass(frozen=True)
class Bundle:
    """F frames, C corners, and n rays of corners that frames see."""

    R: Float64Array  # (F, 3, 3) p_camera = R p + t
    t: Float64Array  # (F, 3)
    places: Float64Array  # (C, 3)
    frame: IndexArray  # (n,)
    corner: IndexArray  # (n,)
    rays: Float64Array  # (n, 2) x / z and y / z

    def points(self) -> Float64Array:
        """Return the (n, 3) seen corners in their frames' axes."""
        seen: Float64Array = np.einsum("nij,nj->ni", self.R[self.frame], self.places[self.corner])
        return seen + self.t[self.frame]

    def residuals(self) -> Float64Array:
        """Return the (n, 2) differences between where corners are and where they are seen."""
        return projected(self.points()) - self.rays


def adjust(bundle: Bundle, fixed: int, scale: float) -> Bundle:
    """Return the bundle adjusted.

    :param fixed: how many of the first frames stay as they are; at least 1, and with only one the
        size of the whole is free as well, so that damping decides on it.
    :param scale: of the robust kernel, radians.
    """
    adjusted, _ = damped_steps(
        bundle,
        lambda now: _cost(now.residuals(), scale),
        lambda now: lambda damping: _step(now, fixed, scale, damping),
        1e-4,
        STEPS,
    )
    return adjusted


def damped_steps(
    start: _State,
    cost_of: Callable[[_State], float],
    linearize: Callable[[_State], Callable[[float], _State | None]],
    damping: float,
    most_trials: int,
    rise: float = 20.0,
    least_damping: float = 1e-8,
) -> tuple[_State, float]:
    """Return the best state that Gauss-Newton steps find, and its cost. A step that raises the cost
    is tried again with more damping (Levenberg-Marquardt).

    :param linearize: returns, for a state, a function that gives the state after a step with some
        damping; None where its equations cannot be solved.
    :param damping: of the first step. :param most_trials: steps, also those that are not kept.
    :param rise: of the damping after a step that is not kept. :param least_damping: of all steps.
    """
    now = start
    cost = cost_of(now)
    step = linearize(now)
    for _ in range(most_trials):
        after = step(damping)
        cost_after = np.inf if after is None else cost_of(after)
        if after is not None and cost_after < cost:
            is_done = cost_after > (1.0 - _TOLERANCE) * cost
            now = after
            cost = cost_after
            damping = max(damping * 0.2, least_damping)
            if is_done:
                break
            step = linearize(now)
        else:
            damping *= rise
            if damping > _LARGEST_DAMPING:
                break
    return now, cost


def _step(bundle: Bundle, fixed: int, scale: float, damping: float) -> Bundle | None:
    """Return the bundle after one step; None where its equations cannot be solved."""
    frames = len(bundle.R)
    corners = len(bundle.places)
    points = bundle.points()
    residuals = projected(points) - bundle.rays
    weight = 1.0 / (1.0 + (residuals**2).sum(axis=1) / scale**2)
    by_point = projection_jacobian(points)  # (n, 2, 3)
    by_pose = pose_jacobian(points, by_point)  # (n, 2, 6)
    by_place = by_point @ bundle.R[bundle.frame]  # (n, 2, 3)
    weighted_pose = by_pose * weight[:, None, None]
    weighted_place = by_place * weight[:, None, None]

    poses = np.zeros((frames, 6, 6))
    np.add.at(poses, bundle.frame, np.einsum("nki,nkj->nij", weighted_pose, by_pose))
    places = np.zeros((corners, 3, 3))
    np.add.at(places, bundle.corner, np.einsum("nki,nkj->nij", weighted_place, by_place))
    mixed = np.zeros((frames, corners, 6, 3))
    mixed[bundle.frame, bundle.corner] = np.einsum("nki,nkj->nij", weighted_pose, by_place)
    g_pose = np.zeros((frames, 6))
    np.add.at(g_pose, bundle.frame, np.einsum("nki,nk->ni", weighted_pose, residuals))
    g_place = np.zeros((corners, 3))
    np.add.at(g_place, bundle.corner, np.einsum("nki,nk->ni", weighted_place, residuals))

    index = np.arange(6)
    poses[:, index, index] *= 1.0 + damping
    poses[:, index, index] += 1e-9
    places[:, index[:3], index[:3]] *= 1.0 + damping
    places[:, index[:3], index[:3]] += 1e-12
    inverse = np.linalg.inv(places)
    W = mixed[fixed:].transpose(0, 2, 1, 3).reshape(-1, corners, 3)
    WV = np.einsum("acj,cjk->ack", W, inverse).reshape(len(W), -1)
    S = -WV @ W.reshape(len(W), -1).T
    for k in range(fixed, frames):
        begin = 6 * (k - fixed)
        S[begin : begin + 6, begin : begin + 6] += poses[k]
    right = -g_pose[fixed:].ravel() + WV @ g_place.ravel()
    try:
        step = np.linalg.solve(S, right).reshape(-1, 6)
    except np.linalg.LinAlgError:
        return None
    moved = np.einsum("fcij,fi->cj", mixed[fixed:], step)
    change = -np.einsum("cij,cj->ci", inverse, g_place + moved)
    if not (np.isfinite(step).all() and np.isfinite(change).all()):
        return None
    R = bundle.R.copy()
    t = bundle.t.copy()
    turn = exp(step[:, :3])
    R[fixed:] = turn @ R[fixed:]
    t[fixed:] = np.einsum("fij,fj->fi", turn, t[fixed:]) + step[:, 3:]
    return replace(bundle, R=R, t=t, places=bundle.places + change)


def refine_pose(
    places: Float64Array, rays: Float64Array, R: Float64Array, t: Float64Array, scale: float
) -> tuple[Float64Array, Float64Array]:
    """Return the pose of one frame by known places (n, 3) and their rays (n, 2), from a guess.

    :param R, t: (3, 3), (3,) the guess.
    :param scale: of the robust kernel at the end, radians; it begins eight times as wide.
    """
    for step in range(POSE_STEPS):
        points = places @ R.T + t
        residuals = projected(points) - rays
        weight = narrowing_weights(residuals, scale, step) * (points[:, 2] > _NEAREST)
        by_pose = pose_jacobian(points, projection_jacobian(points))
        H, g = normal_equations(by_pose, residuals, weight)
        H[np.arange(6), np.arange(6)] *= 1.0 + 1e-6
        H[np.arange(6), np.arange(6)] += 1e-9
        change = -np.linalg.solve(H, g)
        turn = exp(change[:3])
        R = turn @ R
        t = turn @ t + change[3:]
    return R, t


def narrowing_weights(residuals: Float64Array, scale: float, step: int) -> Float64Array:
    """Return the (n,) weights of residuals (n, 2) by a robust kernel (Geman and McClure), which is
    eight times as wide as ``scale`` in the first step, and half as wide in each further one.
    """
    width = scale * max(1.0, 8.0 * 0.5**step)
    return 1.0 / (1.0 + (residuals**2).sum(axis=1) / width**2) ** 2


def projected(points: Float64Array) -> Float64Array:
    """Return x / z and y / z of points (..., 3); those behind the camera count as near it."""
    return points[..., :2] / np.maximum(points[..., 2:], _NEAREST)


def projection_jacobian(points: Float64Array) -> Float64Array:
    """Return the (n, 2, 3) derivatives of `projected` with respect to points (n, 3)."""
    x, y, z = points.T
    z = np.maximum(z, _NEAREST)
    zero = np.zeros(len(points))
    rows = [np.stack([1.0 / z, zero, -x / z**2], 1), np.stack([zero, 1.0 / z, -y / z**2], 1)]
    return np.stack(rows, axis=1)


def pose_jacobian(points: Float64Array, by_point: Float64Array) -> Float64Array:
    """Return the (n, 2, 6) derivatives with respect to a step of the pose: rotation, then position.

    :param points: (n, 3) in the camera's axes, which the rotation moves by w x p.
    :param by_point: (n, 2, 3) derivatives with respect to them.
    """
    return np.concatenate([-by_point @ hat(points), by_point], axis=2)


def normal_equations(
    J: Float64Array, residuals: Float64Array, weight: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return Jᵀ W J (m, m) and Jᵀ W r (m,), of derivatives (n, 2, m), residuals (n, 2) and weights
    (n,).
    """
    weighted = J * weight[:, None, None]
    H: Float64Array = np.einsum("nki,nkj->ij", weighted, J)
    g: Float64Array = np.einsum("nki,nk->i", weighted, residuals)
    return H, g


def _cost(residuals: Float64Array, scale: float) -> float:
    return float(np.log1p((residuals**2).sum(axis=1) / scale**2).sum())
