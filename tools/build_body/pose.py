# SPDX-License-Identifier: GPL-3.0-or-later
"""From the source's A-pose with bent elbows to the T-pose, by a map that is linear in vertices and
joints.

Each body part has one fixed global rotation R_i, taken from the mean shape. Joints follow the tree
and vertices turn about a fixed mean c_v of the joints between the parts that move them:

    J'_i = J'_par + R_par (J_i − J_par)
    v'   = Q_v (v − c_v) + Σ_i w_vi (R_i (c_v − J_i) + J'_i),      c_v = Σ_i a_vi J_i

Q_v is the blended rotation itself (a quaternion mean), not the blend of matrices, so that nothing
collapses at the bends. All of R, Q, w and a are constants: what is linear in β before is linear in
β after.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .joints import Skeleton

MIRROR = np.diag([-1.0, 1.0, 1.0])


def part_rotations(
    skeleton: Skeleton, J: NDArray[np.float64], across_hand: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (K+1, 3, 3) global rotations that take the mean shape's parts into the T-pose.

    :param J: (K+1, 3) joints of the mean shape.
    :param across_hand: (3,) direction from the left little to the left index knuckle.
    """

    def joint(name: str) -> NDArray[np.float64]:
        return J[skeleton.index(name)]

    leg = joint("left_ankle") - joint("left_hip")
    angle = np.arctan2(leg[0], -leg[1])
    upper = joint("left_elbow") - joint("left_shoulder")
    fore = joint("left_wrist") - joint("left_elbow")
    hand = np.mean([joint(name) for name in _knuckles(skeleton)], axis=0) - joint("left_wrist")
    hinge = np.cross(upper, fore)  # the elbow's axis: down once the arm is straight
    left = {
        "hip": _about_z(-angle),
        "knee": _about_z(-angle),
        "shoulder": _align((upper, hinge), ([1.0, 0.0, 0.0], [0.0, -1.0, 0.0])),
        "elbow": _align((fore, hinge), ([1.0, 0.0, 0.0], [0.0, -1.0, 0.0])),
        "wrist": _align((hand, across_hand), ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0])),
    }
    R = np.tile(np.eye(3), (len(J), 1, 1))
    for i, name in enumerate(skeleton.joint_names):
        part = name.removeprefix("left_").removeprefix("right_")
        is_finger = name != part and part not in left and i > skeleton.index("right_wrist")
        rotation = left.get("wrist" if is_finger else part)
        if rotation is not None:
            R[i] = rotation if name.startswith("left_") else MIRROR @ rotation @ MIRROR
    return R


def pose_joints(
    skeleton: Skeleton, R: NDArray[np.float64], J: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return J' of a stack of joint sets J (B, K+1, 3): the mean and each component."""
    posed = J.copy()
    for i, parent in enumerate(skeleton.parents):
        if parent >= 0:
            posed[:, i] = posed[:, parent] + (J[:, i] - J[:, parent]) @ R[parent].T
    return posed


def pose_vertices(
    skeleton: Skeleton,
    R: NDArray[np.float64],
    W: NDArray[np.float64],
    J: NDArray[np.float64],
    posed_J: NDArray[np.float64],
    basis: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return v' of a stack of vertex sets ``basis`` (B, V, 3); ``J`` (B, K+1, 3), ``posed_J`` as in
    ``pose_joints``.
    """
    A = _centre_weights(skeleton, W)
    Q = _blend_rotations(R, W)
    centre = np.einsum("vi,bix->bvx", A, J)
    # The blended positions to which the parts move the centre: Σ w (R_i c + d_i), d_i = J'_i − R_i
    # J_i.
    shift = posed_J - np.einsum("ixy,biy->bix", R, J)
    blended = np.einsum("vi,ixy->vxy", W, R)
    moved_centre = np.einsum("vxy,bvy->bvx", blended, centre) + np.einsum("vi,bix->bvx", W, shift)
    return np.einsum("vxy,bvy->bvx", Q, basis - centre) + moved_centre


def _knuckles(skeleton: Skeleton) -> tuple[str, ...]:
    if "left_hand" in skeleton.joint_names:
        return ("left_hand",)
    return ("left_index1", "left_middle1", "left_ring1", "left_pinky1")


def _about_z(angle: float) -> NDArray[np.float64]:
    c = np.cos(angle)
    s = np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _align(
    source: tuple[ArrayLike, ArrayLike], target: tuple[ArrayLike, ArrayLike]
) -> NDArray[np.float64]:
    """Return the rotation that takes source[0] to target[0] and source[1] as near to target[1] as
    possible.
    """

    def frame(first: ArrayLike, second: ArrayLike) -> NDArray[np.float64]:
        x = np.asarray(first, float) / np.linalg.norm(first)
        z = np.cross(x, np.asarray(second, float))
        z /= np.linalg.norm(z)
        return np.stack([x, np.cross(z, x), z], axis=1)

    return frame(*target) @ frame(*source).T


def _centre_weights(skeleton: Skeleton, W: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a_vi (V, K+1): products of the weights of a joint's part and its parent's; rows sum to
    one.
    """
    A = 1e-9 * W
    for i, parent in enumerate(skeleton.parents):
        if parent >= 0:
            A[:, i] += W[:, i] * W[:, parent]
    return A / A.sum(axis=1, keepdims=True)


def _blend_rotations(R: NDArray[np.float64], W: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (V, 3, 3), the weighted quaternion mean of the part rotations (all less than 180°
    apart).
    """
    q = np.array([_quaternion(each) for each in R])
    mean = W @ q
    w, x, y, z = (mean / np.linalg.norm(mean, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)


def _quaternion(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (w, x, y, z) with w > 0; the rotations here are far from 180°."""
    w = 0.5 * np.sqrt(1.0 + np.trace(R))
    return np.array(
        [w, *(np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4.0 * w))]
    )
