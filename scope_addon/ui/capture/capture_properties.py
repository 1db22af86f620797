# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings that the panel shows, stored with each scene, and results, stored with each
capture's collection.
"""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
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
from ..file_field import path_text
from .capture_operators import WAITING, state
from .captures import show_index, shown_capture, shown_index

_VIEW = {"name": "View", "description": "Video of the same moment, by another camera"}
_FOOTAGE = {"name": "Footage", "description": "Video or image of a person to capture"}


def _clear_message(_settings: bpy.types.PropertyGroup, _context: bpy.types.Context) -> None:
    """Clear the error message, which was about other footage."""
    state.message = ""


class SCOPE_PG_warning(bpy.types.PropertyGroup):
    """A warning about the result."""

    text: StringProperty()  # in English
    record: StringProperty()  # JSON of the notice, from which it is shown in other languages
    spans: StringProperty()  # scene frames; see `stored_values`


class SCOPE_PG_result(bpy.types.PropertyGroup):
    """Result of a capture, stored with its collection."""

    footage: StringProperty(subtype="FILE_PATH")
    people: IntProperty()
    frames: IntProperty()
    valid_frames: IntProperty()
    reprojection_px: FloatProperty()
    # standard deviation of the joints' positions, median; 0 where it is not known
    sigma_cm: FloatProperty()
    heights: StringProperty()  # of the people, such as "1.74 m ± 0.09"
    frames_per_second: FloatProperty()
    footage_rate: FloatProperty()  # frames per second of the footage; 0 for a picture
    camera: StringProperty()
    execution: StringProperty()
    resolution: IntVectorProperty(size=2)
    pixel_aspect: FloatVectorProperty(size=2)
    warnings: CollectionProperty(type=SCOPE_PG_warning)

    @property
    def collection(self) -> bpy.types.Collection | None:
        """The capture; None if this is the empty result of a scene without captures."""
        return self.id_data if isinstance(self.id_data, bpy.types.Collection) else None


class SCOPE_PG_view(bpy.types.PropertyGroup):
    """A further video of the same moment, and the offset of its clock."""

    footage: StringProperty(
        subtype="FILE_PATH", options=PATH_OPTIONS, update=_clear_message, **_VIEW
    )
    footage_text: path_text("footage", **_VIEW)
    use_offset: BoolProperty(
        name="Known Offset",
        description="Enter the offset between the clocks of the cameras, which is otherwise found "
        "from the people",
        options=set(),
    )
    offset_s: FloatProperty(
        name="Offset",
        description="Time in this video less that in the first one, of the same moment, in seconds",
        precision=3,
        step=1,
        soft_min=-60.0,
        soft_max=60.0,
        min=-86400.0,
        max=86400.0,
        options=set(),
    )


class SCOPE_PG_clip(bpy.types.PropertyGroup):
    """A clip of several that are captured one after the other."""

    footage: StringProperty(subtype="FILE_PATH", options=PATH_OPTIONS, **_FOOTAGE)
    status: StringProperty(default=WAITING)
    message: StringProperty()  # why it failed


@with_options(Place.PANEL)
class SCOPE_PG_settings(bpy.types.PropertyGroup):
    """The settings of a capture: the footage, the declared options of the panel, and the capture
    that is shown.
    """

    footage: StringProperty(
        subtype="FILE_PATH", options=PATH_OPTIONS, update=_clear_message, **_FOOTAGE
    )
    footage_text: path_text("footage", **_FOOTAGE)
    views: CollectionProperty(
        type=SCOPE_PG_view, description="Further videos of the same moment, by other cameras"
    )
    queue: CollectionProperty(
        type=SCOPE_PG_clip, description="Clips that are captured one after the other"
    )
    capture: PointerProperty(
        name="Capture",
        type=bpy.types.Collection,
        description="Capture whose result the panel shows",
    )
    capture_index: IntProperty(
        name="Capture",
        get=shown_index,
        set=show_index,
        description="Capture whose result the panel shows",
    )
    scene_camera: PointerProperty(
        name="Scene Camera",
        type=bpy.types.Object,
        poll=lambda _, owner: owner.type == "CAMERA",
        description="Camera whose lens and motion are those of the camera that filmed the footage",
    )
    smooth_everyone: BoolProperty(
        name="All People",
        description="Raw, Normal and Strong act on everybody of the capture",
    )
    no_result: PointerProperty(type=SCOPE_PG_result)  # stays empty

    @property
    def result(self) -> SCOPE_PG_result:
        """Result of the capture that is selected in the list; empty in a scene without captures."""
        capture = shown_capture(self.id_data)
        result: SCOPE_PG_result = capture.scope_result if capture else self.no_result
        return result


CLASSES = (SCOPE_PG_warning, SCOPE_PG_result, SCOPE_PG_view, SCOPE_PG_clip, SCOPE_PG_settings)


def attach() -> None:
    """Add the settings to every scene, and a result to every collection."""
    bpy.types.Collection.scope_result = PointerProperty(type=SCOPE_PG_result)
    bpy.types.Scene.scope = PointerProperty(type=SCOPE_PG_settings)


def detach() -> None:
    """Remove the settings and results; their values stay in a .blend file until it is saved without
    the extension.
    """
    del bpy.types.Scene.scope
    del bpy.types.Collection.scope_result
