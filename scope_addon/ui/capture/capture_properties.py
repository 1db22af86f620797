# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings and the result that the panel shows, stored with each scene in the .blend file."""

from __future__ import annotations

import bpy
from bpy.props import (
    CollectionProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

from ...options import Place
from ..declared_properties import PATH_OPTIONS, with_options
from .capture_operators import state


def _clear_message(_settings: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    """Clear the error message, which was about other footage."""
    state.message = ""


class SCOPE_PG_warning(bpy.types.PropertyGroup):
    """A warning about the result."""

    text: StringProperty()
    spans: StringProperty()  # scene frames, such as "12-18,40"


class SCOPE_PG_result(bpy.types.PropertyGroup):
    """Result of the last capture of this scene."""

    footage: StringProperty(subtype="FILE_PATH")
    collection: PointerProperty(type=bpy.types.Collection)
    people: IntProperty()
    frames: IntProperty()
    valid_frames: IntProperty()
    reprojection_px: FloatProperty()
    frames_per_second: FloatProperty()
    camera: StringProperty()
    execution: StringProperty()
    resolution: IntVectorProperty(size=2)
    pixel_aspect: FloatVectorProperty(size=2)
    warnings: CollectionProperty(type=SCOPE_PG_warning)


@with_options(Place.PANEL)
class SCOPE_PG_settings(bpy.types.PropertyGroup):
    """The settings of a capture: the footage, the declared options of the panel, and the last result."""

    footage: StringProperty(
        name="Footage",
        subtype="FILE_PATH",
        options=PATH_OPTIONS,
        update=_clear_message,
        description="Video or image of a person to capture",
    )
    result: PointerProperty(type=SCOPE_PG_result)


CLASSES = (SCOPE_PG_warning, SCOPE_PG_result, SCOPE_PG_settings)


def attach() -> None:
    """Add the settings to every scene."""
    bpy.types.Scene.scope = PointerProperty(type=SCOPE_PG_settings)


def detach() -> None:
    """Remove the settings; their values stay in a .blend file until it is saved without the extension."""
    del bpy.types.Scene.scope
