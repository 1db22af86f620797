# SPDX-License-Identifier: GPL-3.0-or-later
"""The retarget section's settings: the rig, and which bone is which body part. Kept with the scene."""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)


def offered_parts(_pair: bpy.types.PropertyGroup | None, _context: bpy.types.Context, typed: str) -> list[str]:
    """The body parts that a name may be of, for Blender to offer while it is typed."""
    from ...retarget.bone_map import PARTS

    return [part for part in PARTS if typed.lower() in part]


class SCOPE_PG_bone_pair(bpy.types.PropertyGroup):
    """One bone of the user's rig and the body part that it follows."""

    bone: StringProperty(name="Bone", description="Bone of your rig")
    part: StringProperty(
        name="Body Part", search=offered_parts, description="Part of the captured body that this bone follows"
    )
    confidence: FloatProperty(name="Confidence", min=0.0, max=1.0, description="How sure the guess is")


def _is_armature(_settings: bpy.types.PropertyGroup, obj: bpy.types.Object) -> bool:
    return obj.type == "ARMATURE" and "scope_source" not in obj


class SCOPE_PG_retarget(bpy.types.PropertyGroup):
    """What the user chose."""

    rig: PointerProperty(
        name="Rig", type=bpy.types.Object, poll=_is_armature, description="Your own armature that shall move"
    )
    pairs: CollectionProperty(type=SCOPE_PG_bone_pair)
    active: IntProperty()
    feet: BoolProperty(
        name="Feet on the Floor",
        default=True,
        description="Hold heel or ball where the captured ones stand, scaled to the rig, and never below the floor",
    )
    root: EnumProperty(
        name="Way",
        items=(
            ("bone", "In Bones", "The pelvis moves through the scene", 0),
            ("object", "On Object", "An empty carries the way and the heading, the rig moves on it: root motion", 1),
            ("in-place", "In Place", "No way at all: the character stays on the spot", 2),
        ),
        default="bone",
        description="Where the way over the floor is kept",
    )
    captured: EnumProperty(
        name="Captured Body",
        items=(
            ("hide", "Hide", "Hide the captured person, but when comparing with the footage", 0),
            ("beside", "Beside", "Show both, the rig to the left of the captured person", 1),
            ("keep", "Leave", "Show both in the same place", 2),
        ),
        default="hide",
        description="What becomes of the captured person when the rig moves instead",
    )


CLASSES = (SCOPE_PG_bone_pair, SCOPE_PG_retarget)


def attach() -> None:
    """Give every scene its settings."""
    bpy.types.Scene.scope_retarget = PointerProperty(type=SCOPE_PG_retarget)


def detach() -> None:
    """Take the settings away."""
    del bpy.types.Scene.scope_retarget
