# SPDX-License-Identifier: GPL-3.0-or-later
"""The armature: one bone per joint of the body, in the rest pose of the fitted shape.

The object is at the world's origin without rotation or scale, so armature space is the world: z up,
metres. The rest pose is a T-pose on the floor facing −y. Bone i rests at ``h_i = R_world_model
J_i(β) + lift`` with orientation M_i (Blender: y along the bone). M_i only determines how the bone
is drawn and its local axes; ``animation.py`` converts SMPL's rotations to those axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ....solver.body import Body
from ...kinematics.axes import R_WORLD_MODEL, UP

SHORTEST_BONE = 0.02  # metres; Blender deletes bones of zero length
_FRONT = np.array([0.0, -1.0, 0.0])


@dataclass(frozen=True)
class RestPose:
    """Rest pose of a body of one shape, in the world frame, standing on the floor."""

    joints: NDArray[np.float64]  # (K+1, 3) metres
    tails: NDArray[np.float64]  # (K+1, 3) metres
    # (3,) metres, added to R_world_model · model so that the lowest vertex lies at z = 0
    lift: NDArray[np.float64]


def rest_pose(body: Body, betas: NDArray[np.floating[Any]]) -> RestPose:
    """Return joints, bone tails and lift of the body at shape ``betas`` (P,)."""
    vertices = body.rest_vertices(betas) @ R_WORLD_MODEL.T
    lift = np.array([0.0, 0.0, -vertices[:, 2].min()])
    joints = body.rest_joints(betas) @ R_WORLD_MODEL.T + lift
    return RestPose(joints, _bone_tails(body, joints, vertices + lift), lift)


def _bone_tails(
    body: Body, joints: NDArray[np.float64], vertices: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the tails (K+1, 3) for display: at a child joint, or at the end of the surface that
    the bone moves.
    """
    tails = joints.copy()
    for i, parent in enumerate(body.parents):
        incoming = joints[i] - joints[parent] if parent >= 0 else UP
        length = float(np.linalg.norm(incoming))
        incoming = incoming / length if length > 1e-6 else UP
        children = np.flatnonzero(body.parents == i)
        offsets = joints[children] - joints[i]
        lengths = np.linalg.norm(offsets, axis=1)
        if (lengths > SHORTEST_BONE).any():
            # Of several children, choose the one straight ahead: the spine at the pelvis, the neck
            # at the chest.
            ahead = (offsets @ incoming) / np.maximum(lengths, 1e-9)
            ahead[lengths <= SHORTEST_BONE] = -2.0
            tails[i] = joints[children[ahead.argmax()]]
            continue
        surface = vertices[body.strongest_joints == i] - joints[i]
        reach = float((surface @ incoming).max()) if len(surface) else 0.0
        tails[i] = joints[i] + incoming * max(reach, SHORTEST_BONE)
    return tails


def build_armature(
    name: str, body: Body, rest: RestPose, collection: bpy.types.Collection
) -> bpy.types.Object:
    """Create an armature object in ``collection`` whose pose bones rotate by quaternions.

    The collection must be in the active view layer, because bones can only be created in edit mode.
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
            bone.head = rest.joints[i]
            bone.tail = rest.tails[i]
            along = rest.tails[i] - rest.joints[i]
            points_forward = abs(along @ _FRONT) > 0.8 * np.linalg.norm(along)
            bone.align_roll(UP if points_forward else _FRONT)
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


def rest_orientations(armature: bpy.types.Object, body: Body) -> NDArray[np.float64]:
    """Return M_i (K+1, 3, 3): bone to armature space at rest, as stored by Blender,
    orthonormalized.
    """
    bones = armature.data.bones
    M = np.array([np.array(bones[name].matrix_local)[:3, :3] for name in body.joint_names], float)
    U, _, Vt = np.linalg.svd(M)
    M_i: NDArray[np.float64] = U @ Vt
    return M_i
