# SPDX-License-Identifier: GPL-3.0-or-later
"""A first pose of the root from the measurements alone, every joint at the prior's mean.

Rotation: the one that best turns the rest pose's points (3D keypoints) or bones (orientation field) onto the measured
ones, the least-squares rotation of Kabsch. Without either, upright and facing the camera.
Position: by 3D keypoints, the difference of centroids; by 2D keypoints, the linear least squares of
    (R v + t)_x - u (R v + t)_z = 0,   (R v + t)_y - v (R v + t)_z = 0.
"""

import numpy as np

from .linearize import place_parts
from .residuals.part import Array
from .state import State
from .terms import HAS_2D, HAS_3D, HAS_DIRECTION, Terms
from .tree import Tree

NEAREST, FARTHEST = 0.3, 100.0  # metres, of the first guess


def _rotation_onto(source: Array, target: Array, weight: Array) -> Array | None:
    """Return R minimizing sum w |R source - target|^2, or None where the vectors do not fix it."""
    u, s, vt = np.linalg.svd((target * weight[:, None]).T @ source)
    if not s[0] > 0 or s[1] < 1e-4 * s[0]:
        return None
    return u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt


def initial_state(tree: Tree, terms: Terms, joint_mean: Array, beta: Array) -> State:
    """Return a first state; finite whatever the measurements are. joint_mean (K, 3, 3), beta (P,)."""
    K, P = len(tree.parents) - 1, tree.shape
    state = State(np.eye(3), np.zeros(3), joint_mean.copy(), beta.copy())
    pose = state.pose(tree)
    place_parts(tree, pose)
    part = np.repeat(np.arange(K + 1), np.diff(terms.starts))
    lever = np.einsum("nij,nj->ni", pose.R[part], terms.rest + terms.V[:, :, :P] @ beta)
    point = lever + pose.t[part]
    in_image, in_space = (terms.flags & HAS_2D) > 0, (terms.flags & HAS_3D) > 0
    directed = (terms.flags & HAS_DIRECTION) > 0
    frontal = State.rest(K, P)
    R, t = None, None
    if in_space.any():
        weight = terms.point[in_space, 3]
        source, target = point[in_space], terms.point[in_space, :3]
        center = np.average(source, axis=0, weights=weight), np.average(target, axis=0, weights=weight)
        R = _rotation_onto(source - center[0], target - center[1], weight)
    if R is None and directed.any():
        R = _rotation_onto(lever[directed], terms.direction[directed, :3], terms.direction[directed, 3])
    if R is None:
        R = frontal.R_camera_root
    if in_space.any():
        t = center[1] - R @ center[0]
    elif in_image.any():
        t = _position_in_image(point[in_image] @ R.T, terms.image[in_image])
    if t is None or not np.isfinite(t).all():
        t = frontal.t_camera_root
    return State(R, t, joint_mean.copy(), beta.copy())


def _position_in_image(points: Array, image: Array) -> Array | None:
    """Return t (3,) by linear least squares from points (n, 3) and (n, 3) of u, v, confidence; None if behind."""
    u, v, w = image[:, 0], image[:, 1], np.sqrt(image[:, 2])
    zero, one = np.zeros_like(u), np.ones_like(u)
    rows = np.concatenate([np.stack([one, zero, -u], 1) * w[:, None], np.stack([zero, one, -v], 1) * w[:, None]])
    right = np.concatenate([(u * points[:, 2] - points[:, 0]) * w, (v * points[:, 2] - points[:, 1]) * w])
    t = np.linalg.lstsq(rows, right, rcond=None)[0]
    if not NEAREST < t[2] < FARTHEST:
        depth = min(max(3.0, t[2]), FARTHEST)
        return np.array([np.average(u, weights=image[:, 2]) * depth, np.average(v, weights=image[:, 2]) * depth, depth])
    return t
