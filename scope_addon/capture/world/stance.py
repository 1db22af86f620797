# SPDX-License-Identifier: GPL-3.0-or-later
"""Distance and lean of a body, corrected by floor, feet and balance.

A camera observes directions accurately and depth poorly. When a foot is in contact, its distance
follows from the floor and from its being at rest, so both correct the depth of every frame. A foot
may also stand on something else: people climb stairs and jump off walls. A foot in contact at
height h stands on the floor with probability s(4(1 − |h|/h_l)), with the logistic function s:
nearly 1 within the noise of depth, nearly 0 beyond.
"""

from __future__ import annotations

import numpy as np

from ...arrays import Float64Array, FloatArray, unit_vectors
from ...kinematics.standing import LEVEL_M, logistic
from ..fitting.prepared_track import Stance
from .balance import balancing_rotations
from .placement import PlacedTrack

FLOOR_SIGMA_M = 0.03  # σ_h, height of a foot on the floor
DEPTH_SIGMA_M = 0.1  # σ_δ, error of the depth
DEPTH_RATE_SIGMA_M_S = 0.3  # σ_r, rate of change of this error
SLIDE_SIGMA_M_S = 0.1  # σ_s, horizontal speed of a foot in contact


def stance_on_ground(placed: PlacedTrack, T_floor_camera: Float64Array) -> Stance:
    """Estimate the distance and lean of a body, in the first frame's camera axes.

    The lean puts the zero moment point between the contact points (`balance`). On uneven ground,
    the distance follows from feet at rest alone, and no foot is pulled to the
    floor.

    :param T_floor_camera: (4, 4) camera to world, with this person's floor at z = 0.
    """
    root = placed.root
    up = T_floor_camera[2, :3]
    contact = placed.contact(up)
    one_floor = not placed.uneven_ground
    shift_m = correct_depth(
        root - placed.center,
        placed.contact_points,
        contact,
        T_floor_camera,
        placed.times,
        one_floor,
    )
    shift = shift_m[:, None] * unit_vectors(root - placed.center)
    turn, pivot = balancing_rotations(placed, contact, up)
    root = pivot + np.einsum("tij,tj->ti", turn, root - pivot)
    height = (placed.contact_points + shift[:, None]) @ up + T_floor_camera[2, 3]
    on_floor = contact * floor_probability(height) if one_floor else np.zeros_like(contact)
    T_frames = np.broadcast_to(T_floor_camera, (len(root), 4, 4))
    return Stance(root + shift, turn, T_frames[:, 2, :3], -T_frames[:, 2, 3], on_floor, contact)


def correct_depth(
    root_cam: FloatArray,
    points_cam: FloatArray,
    contact: FloatArray,
    T_world_camera: Float64Array,
    times: Float64Array,
    one_floor: bool,
) -> Float64Array:
    """Return the (T,) displacement of each frame's body along its root's line of sight, metres.

    With the upward and horizontal components g and d of the line of sight in the world, and heights
    h and horizontal steps s of the points, it minimizes over δ
        Σ_t max(2 c_t − 1, 0) f_t (h_t + g_t δ_t)²/σ_h² + δ_t²/σ_δ²
        + Σ_t c_t |s_t + d_t (δ_t+1 − δ_t)|²/(σ_s Δt)² + (δ_t+1 − δ_t)²/(σ_r Δt)²,
    where c_t is the contact probability (of a step, the smaller one of its ends) and f_t the
    probability that a point at this height stands on the floor. The system is tridiagonal and
    solved in O(T).

    :param root_cam: (T, 3) metres, relative to the camera's centre.
    :param points_cam: (T, F, 3) metres, in the same axes.
    :param contact: (T, F) contact probability of each point.
    :param T_world_camera: (4, 4) camera to world, the floor at z = 0.
    :param times: (T,) seconds.
    :param one_floor: False: f_t = 0, as on stairs.
    """
    T = len(times)
    R = T_world_camera[:3, :3]
    height0 = T_world_camera[2, 3]
    ray_world = unit_vectors(root_cam) @ R.T
    points_world = points_cam @ R.T
    height = points_world[..., 2] + height0
    # A foot that is probably in the air says nothing about the floor.
    certainty = np.clip(2 * contact - 1, 0, 1) * floor_probability(height) * one_floor
    g = ray_world[:, 2]
    d = ray_world[:, :2]

    diagonal = np.full(T, 1 / DEPTH_SIGMA_M**2) + certainty.sum(1) * g**2 / FLOOR_SIGMA_M**2
    right = -(certainty * height).sum(1) * g / FLOOR_SIGMA_M**2
    off = np.zeros(max(T - 1, 0))
    if T > 1:
        step = np.maximum(np.diff(times), 1e-6)
        pair = np.minimum(contact[1:], contact[:-1])
        moved = np.diff(points_world[..., :2], axis=0)
        along = 0.5 * (d[1:] + d[:-1])
        slide = 1 / (SLIDE_SIGMA_M_S * step) ** 2
        stiffness = 1 / (DEPTH_RATE_SIGMA_M_S * step) ** 2 + slide * pair.sum(1) * (along**2).sum(1)
        pull = slide * (pair[..., None] * moved * along[:, None]).sum((1, 2))
        diagonal[:-1] += stiffness
        diagonal[1:] += stiffness
        off -= stiffness
        right[:-1] += pull
        right[1:] -= pull
    return _solve_tridiagonal(diagonal, off, right)


def _solve_tridiagonal(
    diagonal: Float64Array, off: Float64Array, right: Float64Array
) -> Float64Array:
    """Solve a symmetric positive definite tridiagonal system by Thomas's algorithm.

    :param diagonal, off, right: (T,) diagonal, (T−1,) off-diagonal and (T,) right-hand side.
    """
    n = len(diagonal)
    c = np.zeros(n)
    x = np.zeros(n)
    pivot = diagonal[0]
    x[0] = right[0] / pivot
    for k in range(1, n):
        c[k - 1] = off[k - 1] / pivot
        pivot = diagonal[k] - off[k - 1] * c[k - 1]
        x[k] = (right[k] - off[k - 1] * x[k - 1]) / pivot
    for k in range(n - 2, -1, -1):
        x[k] -= c[k] * x[k + 1]
    return x


def floor_probability(height: FloatArray) -> FloatArray:
    """Return the probability (...) that feet in contact at the heights (...), metres, stand on the
    floor.
    """
    return logistic(4 * (1 - np.abs(height) / LEVEL_M))
