# SPDX-License-Identifier: GPL-3.0-or-later
"""The modifiers of a rig's meshes in exported files: Blender's exporters leave them out, or leave
out the shape keys.

Each mesh is replaced by what its modifiers make of it at rest, as if all came before the Armature
modifier, which remains; and each shape key by what they make of the mesh with that key. So a file
holds what the viewport shows, except for a modifier that follows the motion itself, such as a
lattice, and a shape key with which they make other faces than without it, such as a decimation, or
a mirror that merges the halves of a mouth only while it is closed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np
from bpy.types import Key, Mesh, Object, Scene
from numpy.typing import NDArray

from ...arrays import Float32Array
from ...notices import Notice, notice
from .. import actions
from ..datablocks import changed
from ..timing import current_frame_kept
from .export_states import in_position, replaced_meshes

# Modifiers whose effect depends on the pose or the time; after the Armature modifier, also those
# whose effect depends on where the mesh is in its object.
_MOVING = frozenset(
    ("BUILD", "CLOTH", "CORRECTIVE_SMOOTH", "CURVE", "DYNAMIC_PAINT", "EXPLODE", "HOOK")
    + ("LAPLACIANDEFORM", "LATTICE", "MESH_CACHE", "MESH_DEFORM", "MESH_SEQUENCE_CACHE", "OCEAN")
    + ("SHRINKWRAP", "SOFT_BODY", "SURFACE_DEFORM", "WARP", "WAVE")
)
_SAMPLES = 9  # frames in which the values of keyed and driven modifiers are compared
_PLACED = frozenset(("ARRAY", "CAST", "MIRROR", "SCREW", "SIMPLE_DEFORM"))


@contextmanager
def modifiers_applied(scene: Scene, file_name: str) -> Iterator[list[Notice]]:
    """Replace meshes by what their modifiers make of them inside the block, with their shape keys
    and the values of these at the scene's frames.

    :param file_name: of the file that is written, for the notices.
    :return: a notice for each mesh that the file does not hold as the viewport shows it.
    """
    meshes = [obj for obj in scene.objects if obj.type == "MESH"]
    shown = {obj: modifiers for obj in meshes if (modifiers := _shown_modifiers(obj))}
    shaped = {obj: obj.data.shape_keys for obj in shown if obj.data.shape_keys}
    animated = {keys for keys in shaped.values() if keys.animation_data}
    frames = range(scene.frame_start, scene.frame_end + 1)
    modified: dict[Object, Mesh] = {}
    notices: list[Notice] = []
    in_motion = _modifiers_in_motion(scene, list(shown))
    with in_position(scene.objects, "REST"):
        for obj, modifiers in shown.items():
            modified[obj], keys_left_out = _modified_mesh(scene, obj)
            values = {"file": file_name, "mesh": obj.name}
            if moving := [m.name for m in modifiers if m in in_motion]:
                notices.append(notice("modifiers_left_out", **values, modifiers=moving))
            if keys_left_out:
                notices.append(notice("shape_keys_left_out", **values, keys=keys_left_out))
    applied = [modifier for each in shown.values() for modifier in each]
    with changed(applied, show_viewport=False, show_render=False):
        shown_values = actions.shape_key_values(scene, animated, frames)
        with replaced_meshes(modified):
            for obj, mesh in modified.items():
                if mesh.shape_keys is not None and shaped[obj] in animated:
                    names = shaped[obj].key_blocks.keys()[1:]
                    columns = [names.index(name) for name in mesh.shape_keys.key_blocks.keys()[1:]]
                    kept = shown_values[shaped[obj]][:, columns]
                    actions.key_shape_keys(mesh.shape_keys, frames, kept)
            bpy.context.view_layer.update()
            yield notices


def _shown_modifiers(obj: Object) -> list[bpy.types.Modifier]:
    return [m for m in obj.modifiers if m.show_viewport and m.type != "ARMATURE"]


def _modifiers_in_motion(scene: Scene, objects: Sequence[Object]) -> set[bpy.types.Modifier]:
    """Return the modifiers of objects whose effect is another one in every frame: by their kind,
    by their place after the Armature modifier, or because they are keyed or driven.
    """
    found = set()
    values: dict[tuple[bpy.types.Modifier, str], list[object]] = {}
    for obj in objects:
        kinds = [modifier.type for modifier in obj.modifiers]
        drivers = obj.animation_data.drivers if obj.animation_data else ()
        curves = [*actions.fcurves(obj), *actions.nla_fcurves(obj), *drivers]
        for position, modifier in enumerate(obj.modifiers):
            if modifier.type in (_MOVING | _PLACED if "ARMATURE" in kinds[:position] else _MOVING):
                found.add(modifier)
            own = f'modifiers["{bpy.utils.escape_identifier(modifier.name)}"]'
            for curve in curves:
                if curve.data_path.startswith(own) and _leads_to_a_value(obj, curve.data_path):
                    values[modifier, curve.data_path] = []
    with current_frame_kept(scene):
        for frame in np.linspace(scene.frame_start, scene.frame_end, _SAMPLES) if values else ():
            scene.frame_set(round(frame))
            graph = bpy.context.evaluated_depsgraph_get()
            for (modifier, path), seen in values.items():
                value = modifier.id_data.evaluated_get(graph).path_resolve(path)
                seen.append(np.ravel(value).tolist())
    return found.union(modifier for (modifier, _), seen in values.items() if seen[1:] != seen[:-1])


def _leads_to_a_value(obj: Object, data_path: str) -> bool:
    """Return whether an object has a property, which its curves may outlive."""
    try:
        obj.path_resolve(data_path)
    except ValueError:
        return False
    return True


def _modified_mesh(scene: Scene, obj: Object) -> tuple[Mesh, list[str]]:
    """Return what the modifiers of an object make of its mesh, with its shape keys, and the names
    of those that it lacks, because with them the modifiers make other faces.
    """
    copy = obj.copy()
    copy.data = obj.data.copy()
    scene.collection.objects.link(copy)
    copy.show_only_shape_key = False
    for modifier in [m for m in copy.modifiers if m.type == "ARMATURE"]:
        copy.modifiers.remove(modifier)
    blocks = _keys_at_zero(copy.data)
    graph = bpy.context.evaluated_depsgraph_get()
    mesh = bpy.data.meshes.new_from_object(
        copy.evaluated_get(graph), preserve_all_data_layers=True, depsgraph=graph
    )
    places: dict[str, Float32Array] = {}
    try:
        corners = _corners(mesh)
        for block in blocks[1:]:
            block.value = 1.0
            evaluated = copy.evaluated_get(bpy.context.evaluated_depsgraph_get())
            block.value = 0.0
            keyed = evaluated.to_mesh()
            has_same_vertices = len(keyed.vertices) == len(mesh.vertices)
            if has_same_vertices and np.array_equal(_corners(keyed), corners):
                places[block.name] = _vertices(keyed)
            evaluated.to_mesh_clear()
        left_out = [block.name for block in blocks[1:] if block.name not in places]
    finally:
        bpy.data.batch_remove([copy, copy.data])
    if places:
        _add_keys(mesh, obj.data.shape_keys, places)
    return mesh, left_out


def _keys_at_zero(mesh: Mesh) -> list[bpy.types.ShapeKey]:
    """Let the shape keys of a mesh take values from 0 to 1, set them to 0, and return them."""
    if mesh.shape_keys is None:
        return []
    mesh.shape_keys.animation_data_clear()
    for block in mesh.shape_keys.key_blocks:
        block.slider_min = -1.0
        block.slider_max = 1.0
        block.value = 0.0
        block.mute = False
    return list(mesh.shape_keys.key_blocks)


def _add_keys(mesh: Mesh, source: Key, places: dict[str, Float32Array]) -> None:
    """Give a mesh a basis, and shape keys with the names, ranges and values of another one's.

    :param places: (V, 3) of each key but the basis, by its name.
    """
    obj = bpy.data.objects.new(mesh.name, mesh)
    basis = source.key_blocks[0].name
    for name, vertices in {basis: _vertices(mesh), **places}.items():
        block = source.key_blocks[name]
        key = obj.shape_key_add(name=name, from_mix=False)
        key.data.foreach_set("co", vertices.ravel())
        key.slider_min = block.slider_min
        key.slider_max = block.slider_max
        key.value = block.value
        key.mute = block.mute
    bpy.data.objects.remove(obj)


def _vertices(mesh: Mesh) -> Float32Array:
    """Return the vertices (V, 3) of a mesh."""
    vertices = np.empty((len(mesh.vertices), 3), np.float32)
    mesh.attributes["position"].data.foreach_get("vector", vertices.ravel())
    return vertices


def _corners(mesh: Mesh) -> NDArray[np.int32]:
    """Return the vertex at each corner of the faces."""
    corners = np.empty(len(mesh.loops), np.int32)
    mesh.attributes[".corner_vert"].data.foreach_get("value", corners)
    return corners
