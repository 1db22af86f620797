# SPDX-License-Identifier: GPL-3.0-or-later
"""The armature: one bone per joint of the body, its rest pose that of the fitted shape.

The object stands at the world's origin with no rotation or scale, so armature space is the world: z up, metres, the
rest pose a T-pose on the floor facing −y. Bone i rests at ``h_i = R_world_model J_i(β) + lift`` with orientation M_i
(Blender: y along the bone). M_i only decides how the bone looks and what its local axes are; ``animation.py``
carries SMPL's rotations into those axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from ....solver.body import Body
from ...kinematics.axes import R_WORLD_MODEL

SHORTEST_BONE = 0.02  # metres; Blender deletes bones of no length
_UP, _FRONT = np.array([0.0, 0.0, 1.0]), np.array([0.0, -1.0, 0.0])


@dataclass(frozen=True)
class RestPose:
    """Rest pose of a body of one shape, in the world frame, standing on the floor."""

    joints: np.ndarray  # (K+1, 3) metres
    tails: np.ndarray  # (K+1, 3) metres
    lift: np.ndarray  # (3,) metres, added to R_world_model · model so that the lowest vertex lies at z = 0


def rest_pose(body: Body, betas: np.ndarray) -> RestPose:
    """Joints, bone tails and lift of the body at shape ``betas`` (P,)."""
    vertices = body.rest_vertices(betas) @ R_WORLD_MODEL.T
    lift = np.array([0.0, 0.0, -vertices[:, 2].min()])
    joints = body.rest_joints(betas) @ R_WORLD_MODEL.T + lift
    return RestPose(joints, _bone_tails(body, joints, vertices + lift), lift)


def _bone_tails(body: Body, joints: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Where each bone ends, for display: at a child joint, or at the end of the flesh it moves."""
    owner = np.take_along_axis(body.skin_joints, body.skin_weights.argmax(axis=1)[:, None], axis=1)[:, 0]
    tails = joints.copy()
    for i, parent in enumerate(body.parents):
        incoming = joints[i] - joints[parent] if parent >= 0 else _UP
        length = float(np.linalg.norm(incoming))
        incoming = incoming / length if length > 1e-6 else _UP
        children = np.flatnonzero(body.parents == i)
        offsets = joints[children] - joints[i]
        lengths = np.linalg.norm(offsets, axis=1)
        if (lengths > SHORTEST_BONE).any():
            # Of several children the one straight ahead: the spine from the pelvis, the neck from the chest.
            ahead = (offsets @ incoming) / np.maximum(lengths, 1e-9)
            ahead[lengths <= SHORTEST_BONE] = -2.0
            tails[i] = joints[children[ahead.argmax()]]
            continue
        flesh = vertices[owner == i] - joints[i]
        reach = float((flesh @ incoming).max()) if len(flesh) else 0.0
        tails[i] = joints[i] + incoming * max(reach, SHORTEST_BONE)
    return tails


def build_armature(name: str, body: Body, rest: RestPose, collection: bpy.types.Collection) -> bpy.types.Object:
    """An armature object in ``collection``, in object mode, its pose bones rotating by quaternions.

    The collection must be in the active view layer: bones can only be made in edit mode.
    """
    data = bpy.data.armatures.new(name)
    obj = bpy.data.objects.new(name, data)
    collection.objects.link(obj)
    view_layer = bpy.context.view_layer
    active = view_layer.objects.active
    if active is not None and active.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        for i, joint_name in enumerate(body.joint_names):
            bone = data.edit_bones.new(joint_name)
            bone.head, bone.tail = rest.joints[i], rest.tails[i]
            along = rest.tails[i] - rest.joints[i]
            lying_forward = abs(along @ _FRONT) > 0.8 * np.linalg.norm(along)
            bone.align_roll(_UP if lying_forward else _FRONT)
            bone.use_connect = False
            if body.parents[i] >= 0:
                bone.parent = data.edit_bones[body.joint_names[body.parents[i]]]
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")
    # The root's location channels are then metres along the world's axes, not along the bone's.
    data.bones[body.joint_names[0]].use_local_location = False
    for bone in obj.pose.bones:
        bone.rotation_mode = "QUATERNION"
    data.display_type = "STICK"
    obj.show_in_front = True
    return obj


def rest_orientations(armature: bpy.types.Object, body: Body) -> np.ndarray:
    """(K+1, 3, 3) M_i: bone to armature space at rest, as Blender stored it, made exactly orthonormal."""
    bones = armature.data.bones
    M = np.array([np.array(bones[name].matrix_local)[:3, :3] for name in body.joint_names], float)
    U, _, Vt = np.linalg.svd(M)
    return U @ Vt
