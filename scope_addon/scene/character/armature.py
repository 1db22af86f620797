# SPDX-License-Identifier: GPL-3.0-or-later
"""The armature: one bone per joint of the body, in the rest pose of the fitted shape, and how its
bones are shown.

The object is at the world's origin without rotation or scale, so armature space is the world: z up,
metres. The rest pose is a T-pose on the floor facing −y. Bone i rests at ``h_i = R_world_model
J_i(β) + lift`` with orientation M_i (Blender: y along the bone). M_i only determines how the bone
is drawn and its local axes; ``animation.py`` converts SMPL's rotations to those axes.

Bones are shown as rings around the body in a colour for each side, and in a bone collection for
each side. A ring is a custom shape, so an animator can select a bone outside the body. Exporters
ignore it, because the ring's object is in no scene. Blender puts it into one with an armature that
is appended, and `unlink_rings` takes it out again.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from bpy.types import Collection, Object

from ....solver.body import Body
from ...arrays import Float64Array, FloatArray
from ...kinematics.axes import R_WORLD_MODEL, UP, unscaled
from ..datablocks import enter_object_mode

SHORTEST_BONE = 0.02  # metres; Blender deletes bones of zero length
_FRONT = np.array([0.0, -1.0, 0.0])
RING = "scope_bone_ring"  # name of the ring's object and mesh
# Left blue, right red, as is conventional; brighter than Blender's palettes, which are hard to see
# on the dark suit.
SIDES = {"Left": (0.12, 0.56, 1.0), "Right": (1.0, 0.22, 0.16), "Middle": (1.0, 0.76, 0.1)}
# shares of white in the colours of selected and active bones
_SELECTED = 0.5
_ACTIVE = 0.8
_RING_POINTS = 32
_CLEARANCE = 1.12  # ratio of the ring's radius to that of the body's surface
_MIN_RADIUS = 0.008  # metres
_WIRE_WIDTH = 2.0  # pixels


@dataclass(frozen=True)
class RestPose:
    """Rest pose of a body of one shape, in the world frame, standing on the floor."""

    joints: Float64Array  # (K+1, 3) metres
    tails: Float64Array  # (K+1, 3) metres
    # (3,) metres, added to R_world_model · model so that the lowest vertex lies at z = 0
    lift: Float64Array


def rest_pose(body: Body, betas: FloatArray) -> RestPose:
    """Return joints, bone tails and lift of the body at shape ``betas`` (P,)."""
    vertices = body.rest_vertices(betas) @ R_WORLD_MODEL.T
    lift = np.array([0.0, 0.0, -vertices[:, 2].min()])
    joints = body.rest_joints(betas) @ R_WORLD_MODEL.T + lift
    return RestPose(joints, _bone_tails(body, joints, vertices + lift), lift)


def _bone_tails(body: Body, joints: Float64Array, vertices: Float64Array) -> Float64Array:
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


def build_armature(name: str, body: Body, rest: RestPose, collection: Collection) -> Object:
    """Create an armature object in ``collection`` whose pose bones rotate by quaternions.

    The collection must be in the active view layer, because bones can only be created in edit mode.
    """
    data = bpy.data.armatures.new(name)
    obj = bpy.data.objects.new(name, data)
    collection.objects.link(obj)
    view_layer = bpy.context.view_layer
    enter_object_mode(view_layer)
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


def rest_orientations(armature: Object, body: Body) -> Float64Array:
    """Return M_i (K+1, 3, 3): bone to armature space at rest, as stored by Blender,
    orthonormalized.
    """
    bones = armature.data.bones
    return unscaled(
        np.array([bones[name].matrix_local.to_3x3() for name in body.joint_names], float)
    )


def side_of(joint_name: str) -> str:
    """Return ``Left``, ``Right`` or ``Middle``."""
    head = joint_name.split("_", 1)[0].title()
    return head if head in SIDES else "Middle"


def show_bones(armature: Object, body: Body, rest: RestPose, vertices: Float64Array) -> None:
    """Give every bone the colour and collection of its side, and a ring around the surface that it
    moves.

    :param vertices: (V, 3) metres, the rest mesh of the fitted shape, world frame.
    """
    ring = _ring()
    collections = {side: armature.data.collections.new(side) for side in SIDES}
    radii = surface_radii(body, rest, rest_orientations(armature, body), vertices)
    for i, name in enumerate(body.joint_names):
        side = side_of(name)
        bone = armature.data.bones[name]
        posed = armature.pose.bones[name]
        collections[side].assign(bone)
        _color(bone, SIDES[side])
        radius = _CLEARANCE * float(radii[i])
        posed.custom_shape = ring
        posed.use_custom_shape_bone_size = False
        posed.custom_shape_scale_xyz = (radius, radius, radius)
        posed.custom_shape_translation = (0.0, 0.5 * bone.length, 0.0)
        posed.custom_shape_wire_width = _WIRE_WIDTH
        bone.show_wire = True


def surface_radii(
    body: Body, rest: RestPose, M: Float64Array, vertices: Float64Array
) -> Float64Array:
    """Measure the distance of the body's surface from each bone's axis, in the middle of the bone.

    It is the 90 % quantile over the vertices that the bone moves most, in the middle half of its
    length.

    :param M: (K+1, 3, 3) rest orientations, y along the bone.
    :param vertices: (V, 3) metres, the rest mesh of the fitted shape, world frame.
    :return: (K+1,) metres.
    """
    lengths = np.linalg.norm(rest.tails - rest.joints, axis=1)
    radii = np.empty(len(rest.joints))
    for i, length in enumerate(lengths):
        local = (vertices[body.strongest_joints == i] - rest.joints[i]) @ M[i]
        middle = local[np.abs(local[:, 1] - 0.5 * length) <= 0.25 * length] if len(local) else local
        reach = np.linalg.norm((middle if len(middle) else local)[:, [0, 2]], axis=1)
        radii[i] = max(float(np.quantile(reach, 0.9)) if len(reach) else 0.3 * length, _MIN_RADIUS)
    return radii


def unlink_rings() -> None:
    """Take rings out of all collections of this file, where bones still show them."""
    for obj in bpy.data.objects:
        is_ring = obj.name == RING or obj.name.startswith(f"{RING}.")
        for collection in obj.users_collection if is_ring and obj.library is None else ():
            if collection.library is None:
                collection.objects.unlink(obj)


def remove_unused_ring() -> None:
    """Remove the ring from the file if no bone uses it."""
    ring = bpy.data.objects.get(RING)
    if ring is not None and ring.users == 0:
        mesh = ring.data
        bpy.data.batch_remove([ring, mesh])


def _color(bone: bpy.types.Bone, color: tuple[float, float, float]) -> None:
    bone.color.palette = "CUSTOM"
    custom = bone.color.custom
    custom.normal, custom.select, custom.active = (
        tuple(c + white * (1.0 - c) for c in color) for white in (0.0, _SELECTED, _ACTIVE)
    )


def _ring() -> Object:
    """Return a circle of radius 1 normal to the bone's y axis, shared by all captures in the
    file.
    """
    ring = bpy.data.objects.get(RING)
    if ring is not None and ring.type == "MESH" and ring.library is None:
        return ring
    angle = np.linspace(0.0, 2.0 * np.pi, _RING_POINTS, endpoint=False)
    points = [(float(np.cos(a)), 0.0, float(np.sin(a))) for a in angle]
    mesh = bpy.data.meshes.new(RING)
    mesh.from_pydata(points, [(i, (i + 1) % _RING_POINTS) for i in range(_RING_POINTS)], [])
    return bpy.data.objects.new(RING, mesh)
