# SPDX-License-Identifier: GPL-3.0-or-later
"""Depth corrected by the floor, for a camera that sees directions well and depth badly.

Where a foot stands, the floor and the foot's own stillness determine how far away the person is, so the depth of every
frame is corrected by both. Not everything that carries a foot is the floor: people climb stairs and jump off walls. A
foot that stands at height h stands on the floor with the probability s(4(1 − |h|/h_l)), s the logistic function:
within the noise of depth nearly 1, beyond nearly 0.
"""

from __future__ import annotations

import numpy as np

from ...kinematics.standing import LEVEL_M, line_of_sight, logistic

FLOOR_SIGMA_M = 0.03
DEPTH_SIGMA_M = 0.1  # how wrong a depth that fits the image may be
DEPTH_RATE_SIGMA = 0.3  # and how fast that error changes, m/s
SLIDE_SIGMA_M_S = 0.1  # a standing foot's horizontal speed


def correct_depth(
    root_cam: np.ndarray, points_cam: np.ndarray, contact: np.ndarray, T_world_camera: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """(T,) metres by which to move each frame's body along its root's line of sight.

    With the ray's upward and horizontal parts g and d (world), heights h and horizontal steps s of the points,
    minimizes over δ
        Σ_t max(2 c_t − 1, 0) f_t (h_t + g_t δ_t)²/σ_h² + δ_t²/σ_δ²
        + Σ_t c_t |s_t + d_t (δ_t+1 − δ_t)|²/(σ_s Δt)² + (δ_t+1 − δ_t)²/(σ_r Δt)²,
    c_t the contact (of a step, the smaller one of its ends), f_t the share with which this height is the floor's: a
    tridiagonal system, solved in O(T).

    :param root_cam: (T, 3), about the camera's centre;  points_cam: (T, F, 3);  contact: (T, F);  times: (T,).
    """
    T = len(times)
    R, height0 = T_world_camera[:3, :3], T_world_camera[2, 3]
    ray_world = line_of_sight(root_cam) @ R.T
    points_world = points_cam @ R.T
    height = points_world[..., 2] + height0
    # A foot in the air, doubtful as it may be, says nothing about the floor.
    sure = np.clip(2 * contact - 1, 0, 1) * on_floor(height)
    g, d = ray_world[:, 2], ray_world[:, :2]

    diagonal = np.full(T, 1 / DEPTH_SIGMA_M**2) + sure.sum(1) * g**2 / FLOOR_SIGMA_M**2
    right = -(sure * height).sum(1) * g / FLOOR_SIGMA_M**2
    off = np.zeros(max(T - 1, 0))
    if T > 1:
        step = np.maximum(np.diff(times), 1e-6)
        pair = np.minimum(contact[1:], contact[:-1])
        moved = np.diff(points_world[..., :2], axis=0)
        along = 0.5 * (d[1:] + d[:-1])
        slide = 1 / (SLIDE_SIGMA_M_S * step) ** 2
        stiffness = 1 / (DEPTH_RATE_SIGMA * step) ** 2 + slide * pair.sum(1) * (along**2).sum(1)
        pull = slide * (pair[..., None] * moved * along[:, None]).sum((1, 2))
        diagonal[:-1] += stiffness
        diagonal[1:] += stiffness
        off -= stiffness
        right[:-1] += pull
        right[1:] -= pull
    return _solve_tridiagonal(diagonal, off, right)


def _solve_tridiagonal(diagonal: np.ndarray, off: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Thomas's algorithm for a symmetric positive definite tridiagonal matrix."""
    n = len(diagonal)
    c, x = np.zeros(n), np.zeros(n)
    pivot = diagonal[0]
    x[0] = right[0] / pivot
    for k in range(1, n):
        c[k - 1] = off[k - 1] / pivot
        pivot = diagonal[k] - off[k - 1] * c[k - 1]
        x[k] = (right[k] - off[k - 1] * x[k - 1]) / pivot
    for k in range(n - 2, -1, -1):
        x[k] -= c[k] * x[k + 1]
    return x


def on_floor(height: np.ndarray) -> np.ndarray:
    """The share with which a foot that stands at these heights stands on the floor, see above."""
    return logistic(4 * (1 - np.abs(height) / LEVEL_M))
