# SPDX-License-Identifier: GPL-3.0-or-later
"""Which objects of a capture's collection were made for it: the user may have put a camera, a rig
or a garment beside them, which are theirs.
"""

from __future__ import annotations

import bpy

from .camera import view_number
from .character.root_object import ROOT_TAG
from .datablocks import PART_TAG, is_part, is_person


def tag_part(block: bpy.types.ID) -> None:
    """Mark a body, camera or action as made for the capture whose collection it is in."""
    block[PART_TAG] = True


def cameras_in(collection: bpy.types.Collection) -> list[bpy.types.Object]:
    """Return the cameras of a capture: of the first videos of its clips, and then the further ones
    by their numbers.
    """
    cameras = [obj for obj in collection.all_objects if obj.type == "CAMERA" and is_part(obj)]
    return sorted(cameras, key=_place_of)


def cameras_of_clip(collection: bpy.types.Collection) -> list[bpy.types.Object]:
    """Return the camera of a capture's first video, if it is there, and the further ones."""
    cameras = cameras_in(collection)
    first = [camera for camera in cameras if view_number(camera) is None]
    return [*first[:1], *cameras[len(first) :]]


def parts_of(collection: bpy.types.Collection) -> list[bpy.types.Object]:
    """Return the people of a capture, their bodies and root objects, and its cameras."""
    return [obj for obj in collection.all_objects if _is_of_capture(obj)]


def _place_of(camera: bpy.types.Object) -> int:
    number = view_number(camera)
    return -1 if number is None else number


def _is_of_capture(obj: bpy.types.Object) -> bool:
    if ROOT_TAG in obj:  # which a rig that the motion was retargeted to may have, too
        return not obj.children or any(map(is_person, obj.children_recursive))
    return is_person(obj) or is_part(obj)
