# SPDX-License-Identifier: GPL-3.0-or-later
"""The world of a static camera: which way is up, where the floor is, and when the feet stand on it."""

from __future__ import annotations

import numpy as np

from ...solver.body import Body
from ...solver.frames import transform_points, world_from_level_camera

STANDING_KNEE_COS = np.cos(np.radians(30.0))  # thigh and shank within 30 degrees of one line
FLOOR_NOISE_M = 0.05  # scatter of a supporting foot's depth-borne height
UP_NOISE_RAD = np.radians(5.0)  # scatter of the body's own up direction over a clip
CONTACT_SPEED_M_S = 0.35
CONTACT_HEIGHT_M = 0.06
FOOT_PARTS = ("left_ankle", "left_foot", "right_ankle", "right_foot")


def up_from_standing(body: Body, joints_cam: np.ndarray) -> np.ndarray:
    """Up direction in the camera frame from the body itself: ankles to neck while the person stands.

    Frames count by how straight legs and trunk are; without any such frame the trunk alone decides, and a prior of one
    frame's weight says that cameras are held level.

    :param joints_cam: (T, K+1, 3) metres, camera frame, valid frames only.
    :return: (3,) unit vector.
    """
    at = {name: i for i, name in enumerate(body.joint_names)}

    def unit(a: str, b: str) -> np.ndarray:
        d = joints_cam[:, at[b]] - joints_cam[:, at[a]]
        return d / np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-9)

    trunk = unit("pelvis", "neck")
    weight = np.ones(len(joints_cam))
    legs = np.zeros_like(trunk)
    for side in ("left", "right"):
        shank, thigh = unit(f"{side}_ankle", f"{side}_knee"), unit(f"{side}_knee", f"{side}_hip")
        straight = (shank * thigh).sum(1)
        weight *= np.clip((straight - STANDING_KNEE_COS) / (1 - STANDING_KNEE_COS), 0, 1)
        legs += 0.5 * (shank + thigh)
    body_up = legs + trunk
    body_up /= np.maximum(np.linalg.norm(body_up, axis=1, keepdims=True), 1e-9)
    weight *= np.clip(((legs / 2) * trunk).sum(1), 0, 1) ** 8
    level = np.array([0.0, -1.0, 0.0])
    if weight.sum() < 1.0:
        total = level + trunk.mean(0)
    else:
        total = level + (weight[:, None] * body_up).sum(0)
    if np.linalg.norm(total) < 1e-6:
        total = level
    return total / np.linalg.norm(total)


def up_from_floor(feet_cam: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Turns ``up`` so that the supporting feet lie in one level plane, as far as they are spread over the floor.

    Minimizes Σ_k (n·p̃_k)²/σ_floor² + N ‖n − up‖²/σ_up² over n, p̃ the lowest foot point of each frame less their mean.

    :param feet_cam: (T, F, 3) points of the soles in the camera frame.
    """
    heights = feet_cam @ up
    lowest = feet_cam[np.arange(len(feet_cam)), heights.argmin(1)]
    p = lowest - np.median(lowest, axis=0)
    off = np.abs(p @ up)
    p = p[off <= max(3 * np.median(off), 1e-3)]  # jumps and misses do not support anybody
    kappa = len(p) * (FLOOR_NOISE_M / UP_NOISE_RAD) ** 2
    n = np.linalg.solve(p.T @ p + kappa * np.eye(3), kappa * up)
    return n / np.linalg.norm(n)


def sole_points(body: Body, R: np.ndarray, t: np.ndarray, betas: np.ndarray) -> np.ndarray:
    """(T, 4, 3) lowest points in the rest pose of left heel, left toe, right heel, right toe, moved with their parts.

    :param R, t: (T, K+1, 3, 3), (T, K+1, 3) part poses in any frame; the result is in that frame.
    """
    v, J = body.rest_vertices(betas), body.rest_joints(betas)
    strongest = body.skin_joints[np.arange(len(v)), body.skin_weights.argmax(1)]
    out = np.empty((len(R), 4, 3))
    for k, name in enumerate(FOOT_PARTS):
        part = body.joint_names.index(name)
        own = v[strongest == part] if (strongest == part).any() else J[part : part + 1]
        # The sole: the part's lowest centimetre at rest; its centre is where the part presses on the floor.
        sole = own[own[:, 1] <= own[:, 1].min() + 0.01].mean(0)
        sole[1] = own[:, 1].min()
        out[:, k] = np.einsum("tij,j->ti", R[:, part], sole - J[part]) + t[:, part]
    return out


def estimate_world(body: Body, joints_cam: np.ndarray, soles_cam: np.ndarray) -> np.ndarray:
    """World of a static camera: z up, the floor at z = 0, the person's first position above the origin.

    :param joints_cam, soles_cam: (T, K+1, 3) and (T, 4, 3) of the valid frames.
    :return: (4, 4) world_from_camera.
    """
    up = up_from_floor(soles_cam, up_from_standing(body, joints_cam))
    lowest = (soles_cam @ up).min(1)
    T_world_camera = world_from_level_camera(up, height=-float(np.median(lowest)))
    start = transform_points(T_world_camera, joints_cam[:1, 0])[0]
    T_world_camera[:2, 3] -= start[:2]
    return T_world_camera


def foot_contact(soles_world: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(T, 4) probability that left heel, left toe, right heel, right toe stand: slow and near the floor.

    p = s((v₀ − v)/(v₀/4)) · s((h₀ − h)/(h₀/4)) with the logistic function s; v over neighbouring frames.

    :param soles_world: (T, 4, 3) metres, world frame;  times: (T,) seconds.
    """
    if len(times) > 1:
        speed = np.linalg.norm(np.gradient(soles_world, times, axis=0), axis=-1)
    else:
        speed = np.zeros(soles_world.shape[:2])

    def logistic(x: np.ndarray) -> np.ndarray:
        return 1 / (1 + np.exp(-np.clip(x, -30, 30)))

    slow = logistic(4 * (1 - speed / CONTACT_SPEED_M_S))
    low = logistic(4 * (1 - soles_world[..., 2] / CONTACT_HEIGHT_M))
    return slow * low
