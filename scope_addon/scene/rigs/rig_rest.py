# SPDX-License-Identifier: GPL-3.0-or-later
"""Reading a rig's rest pose: its bones, and the skin that each of them moves."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ....solver.errors import InputError
from ...retarget.bone_map import check_bone_count
from ...retarget.rest_pose import RestPose


def rest_pose(rig: bpy.types.Object, *, with_skin: bool = False) -> RestPose:
    """Return all bones of a rig at rest, in the world.

    :param with_skin: read the meshes that the rig deforms, too; the rig must be ``at_rest``.
    :raises InputError: when the rig has no bones, or too many.
    """
    bones = list(rig.data.bones)
    if not bones:
        raise InputError(f"'{rig.name}' has no bones; choose another armature as the rig")
    check_bone_count(f"'{rig.name}'", len(bones))
    names = [bone.name for bone in bones]
    row = {name: index for index, name in enumerate(names)}
    parents = np.array([row[bone.parent.name] if bone.parent else -1 for bone in bones], int)
    matrix = np.array(rig.matrix_world, float)
    heads = _placed(np.array([bone.head_local for bone in bones], float), matrix)
    tails = _placed(np.array([bone.tail_local for bone in bones], float), matrix)
    if not with_skin:
        return RestPose(names, parents, heads, tails)
    bpy.context.view_layer.update()  # Rigid parts follow bones that were just posed.
    points = [np.empty((0, 3))]
    owners = [np.empty(0, int)]
    for mesh in bpy.context.scene.objects:
        if mesh.type == "MESH" and (owned := _owners(mesh, rig, row)) is not None:
            of_mesh = np.empty(3 * len(mesh.data.vertices), np.float32)
            mesh.data.vertices.foreach_get("co", of_mesh)
            # Mesh and rig may move with a common parent: what counts is how one lies in the other.
            here = matrix @ np.array(rig.matrix_world.inverted_safe() @ mesh.matrix_world, float)
            points.append(_placed(of_mesh.reshape(-1, 3).astype(float), here)[owned >= 0])
            owners.append(owned[owned >= 0])
    return RestPose(names, parents, heads, tails, np.concatenate(points), np.concatenate(owners))


def _placed(points: NDArray[np.float64], matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return points (n, 3) under a matrix (4, 4)."""
    placed: NDArray[np.float64] = points @ matrix[:3, :3].T + matrix[:3, 3]
    return placed


def _owners(
    mesh: bpy.types.Object, rig: bpy.types.Object, row: dict[str, int]
) -> NDArray[np.intp] | None:
    """Return the bone that moves each vertex most (V,), -1 for none; None if the rig does not move
    the mesh.
    """
    vertices = mesh.data.vertices
    if mesh.parent == rig and mesh.parent_type == "BONE":
        return np.full(len(vertices), row.get(mesh.parent_bone, -1), int)
    if not any(m.type == "ARMATURE" and m.object == rig for m in mesh.modifiers):
        return None
    bone_of = [row.get(group.name, -1) for group in mesh.vertex_groups]
    owners = np.full(len(vertices), -1, int)
    for index, vertex in enumerate(vertices):
        most = 0.0
        for element in vertex.groups:
            if element.weight > most and bone_of[element.group] >= 0:
                most = element.weight
                owners[index] = bone_of[element.group]
    return owners
