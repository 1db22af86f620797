# SPDX-License-Identifier: GPL-3.0-or-later
"""Joint rotations and root motion as keyframes.

With M_i the rest orientation of bone i in armature space (= world), Ω_i = exp(w_i) SMPL's rotation
of joint i and R_0 the rotation of the root part to the world, Blender's pose channels are

    i > 0:  B_i = C_i Ω_i C_iᵀ,  C_i = M_iᵀ R_world_model          (so B_i = exp(C_i w_i))
    root:   B_0 = C_0 (R_world_modelᵀ R_0) C_0ᵀ,
    location = J_0(β) + trans − h_0, along the world's axes

Then the armature deforms bone i by exactly T_i · rest_i⁻¹, which is SMPL's linear blend skinning.
"""

from __future__ import annotations

import numpy as np
from bpy.types import Action, Object

from ....solver.body import Body
from ....solver.rotations import quaternion_from_matrix, quaternion_from_rotation_vector
from ...arrays import Float64Array
from ...kinematics.axes import R_WORLD_MODEL, transposed
from ...kinematics.smoothing import on_one_hemisphere
from ...motion import Motion
from ..actions import Channels, bone_path
from .armature import RestPose, rest_orientations


def quaternion_product(a: Float64Array, b: Float64Array) -> Float64Array:
    """Return ``a ⊗ b`` (..., 4) of quaternions (w, x, y, z), a and b (..., 4): the rotation b
    followed by a.
    """
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    w = aw * bw - ax * bx - ay * by - az * bz
    x = aw * bx + ax * bw + ay * bz - az * by
    y = aw * by + ay * bw + az * bx - ax * bz
    z = aw * bz + az * bw + ax * by - ay * bx
    return np.stack([w, x, y, z], axis=-1)


def pose_channels(
    body: Body, motion: Motion, rest: RestPose, M: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Compute Blender's channels for every frame of a motion.

    :param M: (K+1, 3, 3) rest orientations.
    :return: rotations (T, K+1, 4), w first, on one hemisphere; root locations (T, 3) metres, world
        axes.
    """
    w = motion.poses.reshape(len(motion), -1, 3).astype(float)
    C = transposed(M) @ R_WORLD_MODEL
    rotations = quaternion_from_rotation_vector(np.einsum("kij,tkj->tki", C, w))
    turned = quaternion_product(
        quaternion_from_matrix(R_WORLD_MODEL.T), quaternion_from_rotation_vector(w[:, 0])
    )  # R_world_modelᵀ R_0
    rotations[:, 0] = np.concatenate([turned[:, :1], turned[:, 1:] @ C[0].T], axis=1)
    pelvis_world = body.rest_joints(motion.betas)[0] + motion.trans
    return on_one_hemisphere(rotations), pelvis_world - rest.joints[0]


def animate_armature(
    armature: Object,
    action: Action,
    body: Body,
    motion: Motion,
    rest: RestPose,
    frames: Float64Array,
) -> Channels:
    """Key every joint's rotation and the root's location at scene ``frames`` (T,), with linear
    interpolation.
    """
    rotations, locations = pose_channels(body, motion, rest, rest_orientations(armature, body))
    channels = Channels(armature, action)
    root = body.joint_names[0]
    channels.write(bone_path(root, "location"), frames, locations, group=root)
    for i, name in enumerate(body.joint_names):
        channels.write(bone_path(name, "rotation_quaternion"), frames, rotations[:, i], group=name)
    return channels
