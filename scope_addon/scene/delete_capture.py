# SPDX-License-Identifier: GPL-3.0-or-later
"""Removing a capture with everything that was made for it, and nothing else."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from .build import MARKERS
from .character.bone_display import remove_if_unused
from .character.root_object import ROOT_TAG
from .datablocks import remove_blocks
from .packed_motion import motion_texts


def delete_capture(scene: bpy.types.Scene, collection: bpy.types.Collection) -> None:
    """Remove a capture's people, camera, footage, actions and markers, and its collection.

    Objects of the user's in the collection stay where they are, in the scene's own collection, and
    so does data that something else uses.
    """
    active = bpy.context.view_layer.objects.active if bpy.context.view_layer else None
    if active is not None and active.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")
    own = [obj for obj in collection.all_objects if _is_ours(obj)]
    used = [*_data_of(own), *motion_texts(own)]
    for child in [child for obj in own for child in obj.children if child not in own]:
        place = child.matrix_world.copy()
        child.parent = None
        child.matrix_world = place
    kept = [obj for obj in collection.all_objects if obj not in own]
    for obj in kept:
        if obj.name not in scene.collection.objects:
            scene.collection.objects.link(obj)
    _remove_markers(scene, collection)
    collections = [collection, *collection.children_recursive]
    remove_blocks(own)
    bpy.data.batch_remove(collections)
    # What the objects used is free now, unless something else uses it too; actions are freed by the
    # data that they animate.
    while unused := [block for block in used if block.users == int(block.use_fake_user)]:
        used = [block for block in used if block not in unused]
        bpy.data.batch_remove(unused)
    remove_if_unused()


def _is_ours(obj: bpy.types.Object) -> bool:
    """Return whether an object of a capture's collection is a person, a root object or a camera: a
    body knows its bones, also after its armature was deleted.
    """
    if obj.type == "MESH":
        return "left_hip" in obj.vertex_groups and "spine1" in obj.vertex_groups
    return "scope_source" in obj or ROOT_TAG in obj or obj.type == "CAMERA"


def _data_of(objects: Iterable[bpy.types.Object]) -> list[bpy.types.ID]:
    """Return the local data that objects use: meshes, armatures, cameras, materials, footage and
    actions.
    """
    found: list[bpy.types.ID | None] = []
    for obj in objects:
        data = obj.data
        found += [data, *(slot.material for slot in obj.material_slots)]
        owners = [obj, data, getattr(data, "shape_keys", None)]
        if obj.type == "CAMERA":
            pictures = [each.image or each.clip for each in data.background_images]
            found += pictures
            owners += pictures
        for owner in owners:
            animation = getattr(owner, "animation_data", None)
            if animation is not None:
                strips = [strip for track in animation.nla_tracks for strip in track.strips]
                found += [animation.action, *(strip.action for strip in strips)]
    return [block for block in dict.fromkeys(found) if block is not None and block.library is None]


def _remove_markers(scene: bpy.types.Scene, collection: bpy.types.Collection) -> None:
    """Remove the markers at a capture's review spans, where the user has left them as they were."""
    names = collection.get(MARKERS)
    for name in names.split("\n") if isinstance(names, str) else ():
        marker = scene.timeline_markers.get(name)
        if marker is not None:
            scene.timeline_markers.remove(marker)
