# SPDX-License-Identifier: GPL-3.0-or-later
"""Which objects of a capture's collection were made for it: the user may have put a camera, a rig
or a garment beside them, which are theirs.

Bodies and cameras have a tag since they were built. Captures from before it was stored have none.
"""

from __future__ import annotations

import re

import bpy

from .camera import view_number
from .character.root_object import ROOT_TAG
from .datablocks import PART_TAG, is_part, is_person

# names that bodies and cameras were built with
_BODY_NAME = re.compile(r"_body(\.\d{3,})?$")
_CAMERA_NAME = re.compile(r"_camera\d*(\.\d{3,})?$")


def tag_part(block: bpy.types.ID) -> None:
    """Mark a body, camera or action as made for the capture whose collection it is in."""
    block[PART_TAG] = True


def cameras_in(collection: bpy.types.Collection) -> list[bpy.types.Object]:
    """Return the cameras of a capture: of the first videos of its clips, and then the further ones
    by their numbers. Without any tag, they are all cameras in the collection.
    """
    cameras = [obj for obj in collection.all_objects if obj.type == "CAMERA"]
    if _is_tagged(collection):
        cameras = [camera for camera in cameras if is_part(camera)]
    return sorted(cameras, key=_place_of)


def cameras_of_clip(collection: bpy.types.Collection) -> list[bpy.types.Object]:
    """Return the camera of a capture's first video, if it is there, and the further ones."""
    cameras = cameras_in(collection)
    first = [camera for camera in cameras if view_number(camera) is None]
    return [*first[:1], *cameras[len(first) :]]


def parts_of(collection: bpy.types.Collection) -> list[bpy.types.Object]:
    """Return the people of a capture, their bodies and root objects, and its cameras. Without any
    tag, bodies and cameras are those that still have a name as they were built with.
    """
    tagged = _is_tagged(collection)
    return [obj for obj in collection.all_objects if _is_part(obj, tagged)]


def _place_of(camera: bpy.types.Object) -> int:
    number = view_number(camera)
    return -1 if number is None else number


def _is_tagged(collection: bpy.types.Collection) -> bool:
    return any(is_part(obj) for obj in collection.all_objects)


def _is_part(obj: bpy.types.Object, tagged: bool) -> bool:
    if is_person(obj):
        return True
    if ROOT_TAG in obj:  # which a rig that the motion was retargeted to may have, too
        return not obj.children or any(map(is_person, obj.children_recursive))
    if tagged:
        return is_part(obj)
    if obj.type == "CAMERA":
        return view_number(obj) is not None or bool(_CAMERA_NAME.search(obj.name))
    # A body knows its bones, also after its armature was deleted; so does what was given its
    # weights.
    return (
        obj.type == "MESH"
        and {"left_hip", "spine1"} <= set(obj.vertex_groups.keys())
        and bool(_BODY_NAME.search(obj.name))
    )
