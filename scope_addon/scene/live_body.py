# SPDX-License-Identifier: GPL-3.0-or-later
"""A body that is posed as poses come: the armature and mesh of a capture, without keys.

The armature rests at the shape β⁰ that was known first, because bones can only be moved in Edit
Mode, while β settles in the first seconds. With δ_i = R_world_model (J_i(β) − J_i(β⁰)), M_i the
rest orientation of bone i and Ω_i the rotation of joint i, the location channels

    i > 0:  M_iᵀ (I − R_world_model Ω_i R_world_modelᵀ) δ_i
    root:   pelvis − R_0 R_world_modelᵀ δ_0 − h_0, along the world's axes

make Blender deform the mesh of shape β as SMPL does: bone i maps a vertex v to D_i (v − h_i − δ_i)
+ joint_i. The rotation channels are those of ``character/animation.py``.
"""

from __future__ import annotations

import bpy
import numpy as np
from bpy.types import Object, Scene

from ...solver.body import Body
from ...solver.rotations import matrix_from_quaternion, quaternion_from_matrix
from ..arrays import Float64Array, FloatArray
from ..kinematics.axes import R_WORLD_MODEL, rotated, transposed
from .character import armature, body_mesh
from .character.animation import quaternion_product
from .datablocks import NewDatablocks, found, remove, scene_of

_Q_MODEL_WORLD = quaternion_from_matrix(R_WORLD_MODEL.T)
_MIN_CHANGE = 0.01  # of a shape coefficient that changes the mesh: less than half a millimetre


class LiveBody:
    """The objects of one live capture; they are created by the first pose, and again if something
    removes them.
    """

    def __init__(self, scene: Scene, name: str, body: Body) -> None:
        self._scene_uid = scene.session_uid
        self._name = name
        self._body = body
        self._blocks: set[tuple[str, int]] = set()
        self._armature = self._mesh = ("", 0)
        self._betas = np.zeros(body.P)
        self._names = list[str]()

    @property
    def armature(self) -> Object | None:
        """The armature; None if it does not exist, yet or any more."""
        return found("objects", *self._armature)

    @property
    def betas(self) -> Float64Array:
        """The shape (P,) that is shown."""
        return self._betas

    def show(self, rotations: Float64Array, pelvis: Float64Array, betas: FloatArray) -> bool:
        """Pose the body; return whether it was created for this.

        :param rotations: (K+1, 4) w, x, y, z; the root relative to the world, the others to their
            parents.
        :param pelvis: (3,) metres, world.
        :param betas: (P,) shape coefficients, of which Blender can show ±10.
        :raises UsageError: it has to be created, and its scene was removed.
        """
        betas = np.clip(np.asarray(betas, float), -body_mesh.SLIDER_LIMIT, body_mesh.SLIDER_LIMIT)
        rig = self.armature
        mesh = found("objects", *self._mesh)
        if rig is not None and rig.mode == "EDIT":
            return False
        created = False
        if rig is None or mesh is None or [bone.name for bone in rig.pose.bones] != self._names:
            rig, mesh = self._create(betas)
            created = True
        keys = mesh.data.shape_keys
        changed = np.abs(betas - self._betas).max(initial=0.0) > _MIN_CHANGE
        if changed and keys is not None and len(keys.key_blocks) == len(betas) + 1:
            self._betas = betas
            keys.key_blocks.foreach_set("value", np.array([0.0, *betas], np.float32))  # after Basis
            keys.update_tag()
        values, locations = self._channels(rotations, pelvis)
        rig.pose.bones.foreach_set(
            "rotation_quaternion", values[self._order].astype(np.float32).ravel()
        )
        rig.pose.bones.foreach_set("location", locations[self._order].astype(np.float32).ravel())
        rig.update_tag(refresh={"DATA"})
        return created

    def rest_at_shape(self) -> None:
        """Give the armature the rest pose of the shape that is shown, as a capture has it. The pose
        stays the same.

        :raises UsageError: its scene was removed.
        """
        rig = self.armature
        if rig is None:
            return
        shown = self._shown
        layer = bpy.context.view_layer
        was_active = layer.objects.active == rig
        was_selected = rig.select_get(view_layer=layer)
        rig, _ = self._create(self._betas)
        rig.select_set(was_selected, view_layer=layer)
        if was_active:
            layer.objects.active = rig
        self.show(*shown, self._betas)

    def remove(self) -> None:
        """Remove everything that was created, also what redo has brought back."""
        remove(self._blocks)
        self._blocks = set()
        armature.remove_unused_ring()

    def _create(self, betas: Float64Array) -> tuple[Object, Object]:
        """Create the objects, in place of what is left of former ones.

        :raises UsageError: the scene was removed.
        """
        scene = scene_of(self._scene_uid)
        body = self._body
        new = NewDatablocks()
        remove(self._blocks)
        collection = bpy.data.collections.new(self._name)
        scene.collection.children.link(collection)
        rest = armature.rest_pose(body, betas)
        layer = bpy.context.view_layer
        active = layer.objects.active
        rig = armature.build_armature(self._name, body, rest, collection)
        layer.objects.active = active or rig
        vertices = body_mesh.rest_vertices_world(body, rest.lift)
        mesh = body_mesh.build_mesh(f"{self._name}_body", body, vertices, collection)
        armature.show_bones(rig, body, rest, body_mesh.rest_vertices_world(body, rest.lift, betas))
        if body.P:
            body_mesh.add_shape_keys(mesh, body, betas)
        body_mesh.skin_to_armature(mesh, rig, body)
        ring = bpy.data.objects[armature.RING]  # which all captures share
        shared = {("objects", ring.session_uid), ("meshes", ring.data.session_uid)}
        # Former ones stay in it, since redo may bring them back.
        self._blocks |= {(kind, block.session_uid) for kind, block in new.all()} - shared
        self._armature = (rig.name, rig.session_uid)
        self._mesh = (mesh.name, mesh.session_uid)
        self._betas = betas
        self._rest_joints = body.rest_joints(betas)
        self._head = rest.joints[0]
        self._M = armature.rest_orientations(rig, body)
        self._names = [bone.name for bone in rig.pose.bones]
        self._order = np.array([body.joint_names.index(name) for name in self._names])
        return rig, mesh

    def _channels(
        self, rotations: Float64Array, pelvis: Float64Array
    ) -> tuple[Float64Array, Float64Array]:
        """Return the quaternions (K+1, 4) and locations (K+1, 3) of the bones, in the order of the
        joints.
        """
        self._shown = rotations, pelvis
        values = rotations.copy()
        values[0] = quaternion_product(_Q_MODEL_WORLD, rotations[0])
        C = transposed(self._M) @ R_WORLD_MODEL
        values[:, 1:] = rotated(C, values[:, 1:])
        offsets = (self._body.rest_joints(self._betas) - self._rest_joints) @ R_WORLD_MODEL.T
        turned = matrix_from_quaternion(rotations) @ R_WORLD_MODEL.T
        turned[1:] = R_WORLD_MODEL @ turned[1:]
        moved = offsets - rotated(turned, offsets)
        locations = rotated(transposed(self._M), moved)
        locations[0] = pelvis - turned[0] @ offsets[0] - self._head
        return values, locations
