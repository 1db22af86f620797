# SPDX-License-Identifier: Apache-2.0
"""A first pose of the root from the measurements alone, every joint at the prior's mean.

Rotation: the one that best turns the rest pose's points (3D keypoints) or bones (orientation field)
onto the measured ones, the least-squares rotation of Kabsch. Without either, upright and facing the
camera, or where 2D keypoints do not say where a person faces, each of twelve headings. Position: by
3D keypoints, the difference of centroids; by 2D keypoints, the linear least squares of
    (R v + t)_x - u (R v + t)_z = 0,   (R v + t)_y - v (R v + t)_z = 0.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ..gauss_newton.linearize import make_pose, place_parts, point_at_rest
from ..gauss_newton.terms import HAS_2D, HAS_3D, HAS_DIRECTION, Terms
from ..kernel import kernel
from ..rotations import exp, nearest_rotation
from ..state import State
from ..tree import Tree

# metres, of the first guess
NEAREST = 0.3
FARTHEST = 100.0
FRONTAL = np.diag([1.0, -1.0, -1.0])  # upright and facing the camera
DISTANCE = 3.0
STEP = 2.0**-30  # to which first states are rounded
_HEADINGS = tuple(k * math.pi / 6.0 for k in range(12))  # radians from where the body faces first


@kernel
def _moments(tree, terms, pose, points, space, directed) -> None:  # type: ignore[no-untyped-def]
    """Place the parts; write every slot's point (n, 3), and sums w, w s (3), w m (3), w m sᵀ (9) of
    two kinds.

    space: s the points and m where they were measured; directed: s the levers and m the measured
    directions.
    """
    place_parts(tree, pose)
    for i in range(tree.parents.shape[0]):
        for j in range(terms.starts[i], terms.starts[i + 1]):
            x, y, z = point_at_rest(terms, pose.beta, j, tree.shape)
            flags = terms.flags[j]
            for r in range(3):
                e = pose.R[i, r, 0] * x + pose.R[i, r, 1] * y + pose.R[i, r, 2] * z
                points[j, r] = e + pose.t[i, r]
                if flags & HAS_DIRECTION:
                    w = terms.direction[j, 3]
                    directed[1 + r] += w * e
                    for k in range(3):
                        directed[7 + 3 * k + r] += w * terms.direction[j, k] * e
                if flags & HAS_3D:
                    w = terms.point[j, 3]
                    space[1 + r] += w * points[j, r]
                    space[4 + r] += w * terms.point[j, r]
                    for k in range(3):
                        space[7 + 3 * k + r] += w * terms.point[j, k] * points[j, r]
            if flags & HAS_3D:
                space[0] += terms.point[j, 3]
            if flags & HAS_DIRECTION:
                directed[0] += terms.direction[j, 3]


@kernel
def _image_system(terms, points, R, H, g, mean) -> None:  # type: ignore[no-untyped-def]
    """Add the normal equations H t = g of the module's two rows for each 2D keypoint; mean: sums of
    w, w u, w v.
    """
    for j in range(points.shape[0]):
        if not terms.flags[j] & HAS_2D:
            continue
        u = terms.image[j, 0]
        v = terms.image[j, 1]
        w = terms.image[j, 2]
        x = R[0, 0] * points[j, 0] + R[0, 1] * points[j, 1] + R[0, 2] * points[j, 2]
        y = R[1, 0] * points[j, 0] + R[1, 1] * points[j, 1] + R[1, 2] * points[j, 2]
        z = R[2, 0] * points[j, 0] + R[2, 1] * points[j, 1] + R[2, 2] * points[j, 2]
        a = u * z - x
        b = v * z - y
        H[0, 0] += w
        H[1, 1] += w
        H[0, 2] -= w * u
        H[2, 0] -= w * u
        H[1, 2] -= w * v
        H[2, 1] -= w * v
        H[2, 2] += w * (u * u + v * v)
        g[0] += w * a
        g[1] += w * b
        g[2] -= w * (u * a + v * b)
        mean[0] += w
        mean[1] += w * u
        mean[2] += w * v


def _rotation_onto(products: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return R maximizing tr(Rᵀ B) for B = sum w target sourceᵀ (3, 3), or None where B does not
    fix it.
    """
    if not np.isfinite(products).all():
        return None
    u, s, vt = np.linalg.svd(products)
    if not s[0] > 0 or s[1] < 1e-4 * s[0]:
        return None
    u[:, 2] *= np.linalg.det(u @ vt)
    return nearest_rotation(_rounded(u @ vt))


def _rounded(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values without their last bits, which differ between versions of LAPACK, and which a
    first fit amplifies by many orders of magnitude.
    """
    rounded: NDArray[np.float64] = np.round(values / STEP) * STEP
    return rounded


def initial_states(
    tree: Tree,
    terms: Terms,
    joint_mean: NDArray[np.float64],
    beta: NDArray[np.float64],
    *,
    several: bool = False,
) -> list[State]:
    """Return first states in the camera frame, metres; finite whatever the measurements are.

    :param joint_mean: (K, 3, 3) states of joints 1..K.
    :param beta: (P,)
    :param several: whether to turn the body about its own vertical axis to all of `_HEADINGS`,
        although more than the image says where it faces.
    """
    pose = make_pose(tree)
    pose.Omega[1:] = joint_mean
    pose.beta[: tree.shape] = beta
    points = np.empty((len(terms.flags), 3))
    space = np.zeros(16)
    directed = np.zeros(16)
    _moments(tree, terms, pose, points, space, directed)
    R = None
    if space[0] > 0.0:
        products = space[7:].reshape(3, 3) - np.outer(space[4:7], space[1:4] / space[0])
        R = _rotation_onto(products)
    if R is None and directed[0] > 0.0:
        R = _rotation_onto(directed[7:].reshape(3, 3))
    if R is None:
        R = FRONTAL
        several = several or bool((terms.flags & HAS_2D).any())
    states = []
    for heading in _HEADINGS if several else _HEADINGS[:1]:
        turned = R @ exp([0.0, heading, 0.0]) if heading != 0.0 else R
        t = None
        if space[0] > 0.0:
            t = (space[4:7] - turned @ space[1:4]) / space[0]
        else:
            t = _position_in_image(terms, points, np.ascontiguousarray(turned))
        if t is None or not np.isfinite(t).all():
            t = np.array([0.0, 0.0, DISTANCE])
        states.append(State(turned.copy(), _rounded(t), joint_mean.copy(), beta.copy()))
    return states


def _position_in_image(
    terms: Terms, points: NDArray[np.float64], R: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return t (3,) by linear least squares; where it is not in front of the camera, at a distance
    on the mean ray.
    """
    H = np.zeros((3, 3))
    g = np.zeros(3)
    mean = np.zeros(3)
    _image_system(terms, points, R, H, g, mean)
    if not mean[0] > 0.0 or not np.isfinite(H).all() or not np.isfinite(g).all():
        return None
    t = np.linalg.lstsq(H, g, rcond=None)[0]
    if not NEAREST < t[2] < FARTHEST:
        depth = min(max(DISTANCE, t[2]), FARTHEST)
        return np.array([mean[1] / mean[0] * depth, mean[2] / mean[0] * depth, depth])
    return t
