# SPDX-License-Identifier: Apache-2.0
"""A first pose of the root from the measurements alone, every joint at the prior's mean.

Rotation: the one that best turns the rest pose's points (3D keypoints) or bones (orientation field)
onto the measured ones, the least-squares rotation of Kabsch. Without either, upright and facing the
camera, or where 2D keypoints do not say where a person faces, each of 24 headings. Position: by
3D keypoints, the difference of centroids; by 2D keypoints, the linear least squares of
    (R v + t)_x - u (R v + t)_z = 0,   (R v + t)_y - v (R v + t)_z = 0.
"""

import math

import numpy as np

from ..gauss_newton.linearize import make_pose, place_parts
from ..gauss_newton.terms import HAS_2D, HAS_3D, HAS_DIRECTION, Terms
from ..part import Array, Pose
from ..rotations import exp, nearest_rotation
from ..state import State
from ..tree import Tree

# metres, of the first guess
NEAREST = 0.3
FARTHEST = 100.0
FRONTAL = np.diag([1.0, -1.0, -1.0])  # upright and facing the camera
DISTANCE = 3.0
STEP = 2.0**-30  # to which first states are rounded
# Radians from where the body faces first. Of 1,000 random people seen with errors of 2 px as
# stated, 25 end in another minimum from twelve headings, and 19 from these.
_HEADINGS = tuple(k * math.pi / 12.0 for k in range(24))


def _place_slots(tree: Tree, terms: Terms, pose: Pose) -> tuple[Array, Array]:
    """Place the parts; return every slot's point, or difference of points, from the origin of its
    part and from the camera (n, 3).
    """
    place_parts(tree, pose)
    part = np.repeat(np.arange(len(tree.parents)), np.diff(terms.starts))
    P = tree.shape_count
    rest = terms.rest + terms.V[:, :, :P] @ pose.beta[:P]
    levers: Array = np.einsum("nij,nj->ni", pose.R[part], rest)
    return levers, levers + pose.t[part]


def _rotation_onto(products: Array) -> Array | None:
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


def _rounded(values: Array) -> Array:
    """Return values without their last bits, which differ between versions of LAPACK, and which a
    first fit amplifies by many orders of magnitude.
    """
    rounded: Array = np.round(values / STEP) * STEP
    return rounded


def initial_states(
    tree: Tree,
    terms: Terms,
    joint_mean: Array,
    beta: Array,
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
    pose.beta[: tree.shape_count] = beta
    levers, points = _place_slots(tree, terms, pose)
    is_3d = terms.flags & HAS_3D > 0
    measured = terms.point[is_3d, :3]
    weight = terms.point[is_3d, 3]
    total = weight.sum()
    R = None
    if total > 0.0:
        source = weight @ points[is_3d] / total
        target = weight @ measured / total
        products = (weight[:, None] * measured).T @ points[is_3d]
        R = _rotation_onto(products - total * np.outer(target, source))
    is_directed = terms.flags & HAS_DIRECTION > 0
    if R is None and is_directed.any():
        directions = terms.direction[is_directed]
        R = _rotation_onto((directions[:, 3:] * directions[:, :3]).T @ levers[is_directed])
    if R is None:
        R = FRONTAL
        several = several or bool((terms.flags & HAS_2D).any())
    states = []
    for heading in _HEADINGS if several else _HEADINGS[:1]:
        turned = R @ exp([0.0, heading, 0.0]) if heading != 0.0 else R
        if total > 0.0:
            t = target - turned @ source
        else:
            t = _position_in_image(terms, points @ turned.T)
        if t is None or not np.isfinite(t).all():
            t = np.array([0.0, 0.0, DISTANCE])
        states.append(State(turned.copy(), _rounded(t), joint_mean.copy(), beta.copy()))
    return states


def _position_in_image(terms: Terms, turned: Array) -> Array | None:
    """Return t (3,) by linear least squares; where it is not in front of the camera, at a distance
    on the mean ray.

    :param turned: R v (n, 3) of every slot.
    """
    is_2d = terms.flags & HAS_2D > 0
    image = terms.image[is_2d, :2]
    weight = terms.image[is_2d, 2]
    if not is_2d.any():
        return None
    # The rows of A t = b, one for each of the two equations of a keypoint.
    A = np.zeros((len(image), 2, 3))
    A[:, :, :2] = np.eye(2)
    A[:, :, 2] = -image
    b = image * turned[is_2d, 2:] - turned[is_2d, :2]
    H = np.einsum("n,nki,nkj->ij", weight, A, A)
    g = np.einsum("n,nki,nk->i", weight, A, b)
    if not np.isfinite(H).all() or not np.isfinite(g).all():
        return None
    t: Array = np.linalg.lstsq(H, g, rcond=None)[0]
    if not NEAREST < t[2] < FARTHEST:
        depth = min(max(DISTANCE, t[2]), FARTHEST)
        mean = weight @ image / weight.sum()
        return np.array([mean[0] * depth, mean[1] * depth, depth])
    return t
