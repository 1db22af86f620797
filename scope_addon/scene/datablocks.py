# SPDX-License-Identifier: GPL-3.0-or-later
"""Datablocks of Blender: their names, which are no longer than Blender allows, and not unique where
some are linked from another file; finding them again, since undo may have removed or replaced them;
and removing them. And what the custom properties of a captured object say: the user may have put a
camera, a rig or a garment beside those that were made for a capture.

A scene that is linked from another file cannot be changed: Blender refuses, or does not save it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import bpy
from bpy.types import ID, Action, Collection, Key, Object, Scene, ViewLayer

from ..errors import UsageError

_LONGEST = 63 if bpy.app.version < (5, 0) else 255  # bytes
SUFFIX_BYTES = 24  # room for what is appended to a capture's name, such as ``_person12_body.001``
CAPTURE_TAG = "scope_capture"  # custom property that marks a capture's collection
# custom property of a capture's collection: what the names of its objects begin with
NAME_TAG = "scope_name"
# custom property of a capture's collection: the names of its markers on the timeline, by lines
MARKERS = "scope_markers"
SOURCE_TAG = "scope_source"  # custom property of a captured armature: what it was captured from
# custom property of what was made for a capture: a body, a camera, the action of a person
PART_TAG = "scope_part"
# custom property of the empty that carries a person's root motion, or a rig's
ROOT_TAG = "scope_root"
VIEW_TAG = "scope_view"  # custom property of a capture's further cameras: their number, from 0
# Kinds of datablock that a file or a capture may contain, users before the datablocks that they
# use. Shape keys go with their mesh, and ``temporary_scene`` removes scenes.
_KINDS = (
    "collections", "objects", "meshes", "armatures", "curves", "cameras", "lights", "metaballs",
    "lattices", "actions",
    "materials", "node_groups", "textures", "images", "movieclips", "texts", "worlds", "libraries",
)  # fmt: skip


def short_name(name: str) -> str:
    """Return the beginning of a capture's name to which Blender can append a suffix without
    truncating it.

    Blender cuts off the end, so that the names of armature, body and camera would be the same but
    for a number.
    """
    return name.encode("utf-8", "replace")[: _LONGEST - SUFFIX_BYTES].decode("utf-8", "ignore")


def holds(collection: Collection, obj: Object) -> bool:
    """Return whether an object is in a collection or in one below it.

    Looking it up by its name alone would also find an object of that name which is linked from
    another file.
    """
    return _contains(collection.all_objects, obj)


def is_in_layer(view_layer: ViewLayer, obj: Object) -> bool:
    """Return whether an object is in a view layer, found as in `holds`."""
    return _contains(view_layer.objects, obj)


def _contains(objects: bpy.types.bpy_prop_collection, obj: Object) -> bool:
    # the panel asks at every redraw, and only a namesake needs the whole scene
    named = objects.get(obj.name)
    return named == obj or (named is not None and any(each == obj for each in objects))


def captures_of(scene: Scene) -> list[Collection]:
    """Return the collections of a scene that contain captures, the last added last."""
    return [each for each in scene.collection.children_recursive if CAPTURE_TAG in each]


def is_person(obj: Object) -> bool:
    """Return whether an object is the armature of a captured person."""
    return SOURCE_TAG in obj


def is_part(block: ID) -> bool:
    """Return whether a body, camera or action was made for a capture."""
    return PART_TAG in block


def action_of(block: ID) -> Action | None:
    """Return the action that animates a datablock; None without one."""
    animation = getattr(block, "animation_data", None)
    return animation.action if animation is not None else None


def with_data(obj: Object) -> list[ID]:
    """Return an object, its data and the shape keys of that, as far as it has them."""
    found = [obj, obj.data, getattr(obj.data, "shape_keys", None)]
    return [block for block in found if block is not None]


def view_number(camera: Object) -> int | None:
    """Return the number of a capture's further camera; None of its first one."""
    number = camera.get(VIEW_TAG)
    return number if isinstance(number, int) else None


def shape_keys_of(armature: Object) -> list[Key]:
    """Return the shape keys of the meshes below an armature, each once."""
    meshes = [obj.data for obj in armature.children_recursive if obj.type == "MESH"]
    return list(dict.fromkeys(mesh.shape_keys for mesh in meshes if mesh.shape_keys))


def is_deformed_by(obj: Object, rig: Object) -> bool:
    """Return whether a modifier of an object deforms it with an armature."""
    return any(m.type == "ARMATURE" and m.object == rig for m in obj.modifiers)


def enter_object_mode(view_layer: ViewLayer | None) -> None:
    """Leave the mode of a view layer's active object, such as Edit Mode, if there is one: neither
    can such an object be removed, nor another one be selected or edited.
    """
    active = view_layer.objects.active if view_layer else None
    if active is not None and active.mode != "OBJECT":
        bpy.ops.object.mode_set(mode="OBJECT")


def check_local(scene: Scene) -> None:
    """Check that a scene is stored in this file.

    :raises UsageError: it is linked from another one.
    """
    if scene.library is not None:
        raise UsageError(
            f"the scene is linked from {scene.library.filepath}, so nothing can be added to it; "
            "use a scene of this "
            "file"
        )


@contextmanager
def changed(structs: Iterable[Any], **values: Any) -> Iterator[None]:
    """Give properties of Blender's structs other values inside the block."""
    before = [(struct, name, getattr(struct, name)) for struct in structs for name in values]
    try:
        for struct, name, _ in before:
            setattr(struct, name, values[name])
        yield
    finally:
        for struct, name, value in before:
            setattr(struct, name, value)


def modifiers_off(objects: Iterable[Object]) -> AbstractContextManager[None]:
    """Leave out all modifiers of objects but armatures inside the block: evaluating them, as of a
    subdivided mesh, can take longer than everything else in a frame.
    """
    left_out = [m for obj in objects for m in obj.modifiers if m.type != "ARMATURE"]
    return changed(left_out, show_viewport=False)


class NewDatablocks:
    """The datablocks that are new since a moment."""

    def __init__(self) -> None:
        self._before = {
            kind: {block.session_uid for block in getattr(bpy.data, kind)} for kind in _KINDS
        }

    def all(self) -> list[tuple[str, ID]]:
        """Return each with its kind, in the order of the kinds."""
        blocks = ((kind, block) for kind in self._before for block in getattr(bpy.data, kind))
        return [
            (kind, block) for kind, block in blocks if block.session_uid not in self._before[kind]
        ]

    def remove(self) -> None:
        """Remove them."""
        bpy.data.batch_remove([block for _, block in self.all()])

    def remove_unused(self) -> None:
        """Remove those that nothing uses, and then those that only these used. Another add-on may
        make data of its own in every frame, which it goes on using.
        """
        while unused := [
            block
            for _, block in self.all()
            # a fake user that a part of a capture has is Scope's
            if block.users == int(block.use_fake_user and is_part(block))
        ]:
            bpy.data.batch_remove(unused)


@contextmanager
def temporary_datablocks(*, used: bool = True) -> Iterator[None]:
    """Remove the datablocks that the block has added to the file.

    :param used: also those that something uses afterwards, see `NewDatablocks.remove_unused`.
    """
    new = NewDatablocks()
    try:
        yield
    finally:
        if used:
            new.remove()
        else:
            new.remove_unused()


def remove_blocks(blocks: Sequence[ID]) -> None:
    """Remove datablocks, and update the scenes that had the objects among them.

    Blender updates only the scenes that a window shows. The dependency graph of a scene that was
    shown before goes on pointing to removed objects, and Blender 4.3 crashes when it reads them
    there to free unused drawing data.
    """
    scenes = {scene for block in blocks if isinstance(block, Object) for scene in block.users_scene}
    bpy.data.batch_remove(blocks)
    for scene in scenes:
        for layer in scene.view_layers:
            layer.update()


def found(kind: str, name: str, uid: int) -> ID | None:
    """Return the datablock with a session's identifier; None if it was removed.

    :param kind: the collection of ``bpy.data``.
    :param name: which it had last.
    """
    blocks = getattr(bpy.data, kind)
    block = blocks.get(name)
    if block is not None and block.session_uid == uid:
        return block
    return next((block for block in blocks if block.session_uid == uid), None)


def scene_of(uid: int) -> Scene:
    """Return the scene with a session's identifier.

    :raises UsageError: it was removed.
    """
    scene = found("scenes", "", uid)
    if scene is None:
        raise UsageError("the scene was removed during the live capture; start in another scene")
    return scene


def remove(blocks: set[tuple[str, int]]) -> None:
    """Remove those of the datablocks that still exist."""
    if not blocks:
        return
    remove_blocks([block for kind, uid in blocks if (block := found(kind, "", uid)) is not None])
    bpy.context.view_layer.update()  # it would still list removed objects


def tag_part(block: ID) -> None:
    """Mark a body, camera or action as made for the capture whose collection it is in."""
    block[PART_TAG] = True


def cameras_in(collection: Collection) -> list[Object]:
    """Return the cameras of a capture: of the first videos of its clips, and then the further ones
    by their numbers.
    """
    cameras = [obj for obj in collection.all_objects if obj.type == "CAMERA" and is_part(obj)]
    return sorted(cameras, key=_place_of)


def cameras_of_clip(collection: Collection) -> list[Object]:
    """Return the camera of a capture's first video, if it is there, and the further ones."""
    cameras = cameras_in(collection)
    first = [camera for camera in cameras if view_number(camera) is None]
    return [*first[:1], *cameras[len(first) :]]


def parts_of(collection: Collection) -> list[Object]:
    """Return the people of a capture, their bodies and root objects, and its cameras."""
    return [obj for obj in collection.all_objects if _is_of_capture(obj)]


def _place_of(camera: Object) -> int:
    number = view_number(camera)
    return -1 if number is None else number


def _is_of_capture(obj: Object) -> bool:
    if ROOT_TAG in obj:  # which a rig that the motion was retargeted to may have, too
        return not obj.children or any(map(is_person, obj.children_recursive))
    return is_person(obj) or is_part(obj)
