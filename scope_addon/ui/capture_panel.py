# SPDX-License-Identifier: GPL-3.0-or-later
"""The capture panels in the sidebar of the 3D viewport, tab Scope. Presets of the capture
settings are chosen, added and removed in the header of the first one.

The settings are stored with each scene, and results with each capture's collection.
"""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
from bl_operators.presets import AddPresetBase
from bl_ui.utils import PresetPanel
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)
from bpy.types import Collection, Context, Object, Operator, Panel, PropertyGroup, UILayout

from ..footage import display_text
from ..options import Place, Section, options_at
from ..scene.stored_values import parse_spans
from . import warm_up
from .capture_operators import CAPTURING, DONE, FAILED, NO_FILES, WAITING, state
from .captured_person import has_captured_person
from .captures import (
    draw_captures,
    people_of,
    people_text,
    show_index,
    shown_capture,
    shown_index,
    unit_text,
)
from .comparison import camera_of, cameras_of, is_looking_through, side_area
from .declared_properties import PATH_OPTIONS, draw_section, property_name, split, with_options
from .export_operators import FORMATS, is_available
from .file_field import draw_file, path_text
from .frame_rate_operators import differs, keyed_for
from .job_operator import preview_icon
from .reporting import iface_, stored_warning, warning_text
from .translations import CONTEXT

if TYPE_CHECKING:
    from ..job.job_progress import JobProgress

_PIXELS_PER_CHARACTER = 7.0
# Formats with a button of their own: more leave no room for their names in a sidebar of the default
# width. A menu beside them has all.
_EXPORT_BUTTONS = 4
_STATUS_ICONS = {WAITING: "TIME", CAPTURING: "PLAY", DONE: "CHECKMARK", FAILED: "ERROR"}
# What belongs to one clip, or to one person, is no preset.
_OF_THE_CLIP = ("take", "person", "crop", "use_range", "start", "end", "heights_m")
_VIEW = {"name": "View", "description": "Video of the same moment, by another camera"}
_FOOTAGE = {"name": "Footage", "description": "Video or image of a person to capture"}


class Tab:
    """Location of Scope's panels."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Scope"
    bl_order = 2  # below Capture and Live
    bl_translation_context = CONTEXT


class PersonTab(Tab):
    """A panel about a captured person."""

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a captured person."""
        return has_captured_person(context)


class SCOPE_PT_capture(Tab, Panel):
    """Footage, the capture button, progress."""

    bl_idname = "SCOPE_PT_capture"
    bl_label = "Capture"
    bl_order = 0

    def draw_header_preset(self, _context: Context) -> None:
        """Draw the buttons of the guide and the presets in the header."""
        self.layout.operator("scope.documentation", text="", icon="HELP", emboss=False)
        SCOPE_PT_capture_presets.draw_panel_header(self.layout)

    def draw(self, context: Context) -> None:
        """Draw the panel."""
        layout = self.layout
        settings = context.scene.scope
        column = layout.column()
        column.enabled = state.job is None
        if not settings.footage:
            row = column.row()
            row.scale_y = 1.6
            row.operator("scope.choose_footage", text="Choose Video or Image", icon="FILE_MOVIE")
            column.operator("scope.use_sample", icon="PLAY")
            column.operator("scope.import_motion", icon="IMPORT")
            return
        row = draw_file(column, settings, "footage", text="", icon="FILE_MOVIE")
        row.operator("scope.add_view", text="", icon="ADD")
        row.operator("scope.import_motion", text="", icon="IMPORT")
        for index, view in enumerate(settings.views):
            _draw_view(column, view, index)
        if settings.queue:
            _draw_queue(context, column.box(), settings)
        column.row(align=True).prop(settings, "quality", expand=True)
        if state.job is not None:
            _draw_progress(context, layout, state.job.progress)
        else:
            row = layout.row()
            row.scale_y = 1.6
            name = "scope.capture_queue" if settings.queue else "scope.capture"
            row.operator(name, icon="ARMATURE_DATA")
            warm_up.draw(layout)
        if message := state.message_in(context.scene):
            draw_text(context, layout.box(), message, "ERROR")


def _draw_view(layout: UILayout, view: PropertyGroup, index: int) -> None:
    """Draw a further video, and its offset if it is known."""
    row = layout.row(align=True)
    row.prop(view, "footage_text", text="", icon="VIEW_CAMERA")
    row.prop(view, "use_offset", text="", icon="TIME")
    row.operator("scope.remove_view", text="", icon="X").index = index
    if view.use_offset:
        layout.prop(view, "offset_s")


def _draw_queue(context: Context, layout: UILayout, settings: PropertyGroup) -> None:
    """Draw the clips that are captured one after the other, why some were not, and which files are
    written.
    """
    column = layout.column(align=True)
    for index, clip in enumerate(settings.queue):
        row = column.row(align=True)
        name = display_text(Path(clip.footage).name)
        row.label(text=name, icon=_STATUS_ICONS.get(clip.status, "DOT"), translate=False)
        row.operator("scope.remove_clip", text="", icon="X", emboss=False).index = index
        if clip.message:
            draw_text(context, column, clip.message, "BLANK1")
    row = layout.row(align=True)
    row.prop(settings, "queue_format", text="", icon="EXPORT")
    if settings.queue_format != NO_FILES:
        row.prop(settings, "queue_folder", text="", placeholder=iface_("Folder"))


def _draw_progress(context: Context, layout: UILayout, progress: JobProgress) -> None:
    layout.progress(text=f"{100 * progress.fraction:.0f} %", factor=progress.fraction)
    if icon := preview_icon():
        layout.template_icon(icon_value=icon, scale=10.0)
    for part in progress.lines(iface_):
        draw_text(context, layout, part)
    row = layout.row()
    row.scale_y = 1.6
    row.operator("scope.cancel", text="Cancel", icon="CANCEL")


class SCOPE_PT_person(Tab, Panel):
    """People, body, lens, and the part of the video."""

    bl_idname = "SCOPE_PT_person"
    bl_parent_id = "SCOPE_PT_capture"
    bl_label = "Options"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        """Draw the panel."""
        layout = split(self.layout)
        settings = context.scene.scope
        layout.enabled = state.job is None
        layout.prop(settings, "take")
        layout.prop(settings, "people")
        if settings.people == "COUNT":
            layout.prop(settings, "people_count", text="Number")
        row = layout.row(align=True)
        row.prop(settings, "person")
        row.operator("scope.pick_person", text="", icon="EYEDROPPER")
        layout.prop(settings, "body")
        if settings.body == "FILE":
            draw_file(layout, settings, "body_file", text="File")
        layout.prop(settings, "height_cm")
        draw_section(layout, settings, Section.PERSON)
        layout.prop(settings, "shape")
        layout.prop(settings, "lens")
        if settings.lens == "FOCAL":
            layout.prop(settings, "focal_mm", text="35 mm Equivalent")
        elif settings.lens == "FOV":
            layout.prop(settings, "fov", text="Angle")
        elif settings.lens == "FILE":
            draw_file(layout, settings, "calibration_file", text="File")
        elif settings.lens == "CAMERA":
            layout.prop(settings, "scene_camera", text="Camera")
        draw_section(layout, settings, Section.MOTION)
        draw_section(layout, settings, Section.FOOTAGE)
        layout.prop(settings, "use_range")
        if settings.use_range:
            column = layout.column(align=True)
            column.prop(settings, "range_start")
            column.prop(settings, "range_end")


class SCOPE_PT_scene(Tab, Panel):
    """Settings of the scene that a capture may change."""

    bl_idname = "SCOPE_PT_scene"
    bl_parent_id = "SCOPE_PT_capture"
    bl_label = "Scene"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: Context) -> None:
        """Draw the panel."""
        layout = split(self.layout)
        settings = context.scene.scope
        layout.enabled = state.job is None
        draw_section(layout, settings, Section.SCENE)


class SCOPE_PT_result(Tab, Panel):
    """The captures of the scene, the result of the selected one, and its export."""

    bl_idname = "SCOPE_PT_result"
    bl_label = "Result"

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a capture in this scene, or a person without one at another frame rate: copied
        settings may refer to another scene's.
        """
        return shown_capture(context.scene) is not None or keyed_for(context.scene) > 0

    def draw(self, context: Context) -> None:
        """Draw the panel."""
        layout = self.layout
        if shown_capture(context.scene) is None:  # a person was appended without the collection
            _draw_frame_rate(context, layout)
            return
        draw_captures(layout, context)
        if text := unit_text(context.scene):
            draw_text(context, layout.box(), text, "ERROR")
        camera = camera_of(context.scene)
        if camera is not None:
            back = is_looking_through(context)
            text = "Back to the Scene" if back else "Compare with Footage"
            row = layout.row(align=True)
            row.operator("scope.look_through", text=text, icon="VIEW_CAMERA", depress=back)
            if back:
                shown = side_area(context.window.screen) is not None
                row.operator("scope.side_view", text="", icon="SPLIT_VERTICAL", depress=shown)
            row.operator("scope.footage_to_sequencer", text="", icon="SEQUENCE")
            if back:
                _draw_compared(context, layout)
        _draw_frame_rate(context, layout)
        row = layout.row(align=True)
        row.label(text="", icon="EXPORT")
        for key, label, _, _ in FORMATS[:_EXPORT_BUTTONS]:
            cell = row.column()
            cell.enabled = is_available(key)
            cell.operator("scope.export", text=label).format = key
        row.menu("SCOPE_MT_export", text="", icon="DOWNARROW_HLT")
        row = layout.row(align=True)
        row.operator("scope.mark_asset", icon="ASSET_MANAGER")
        row.operator("scope.delete_capture", text="", icon="TRASH")


def _draw_compared(context: Context, layout: UILayout) -> None:
    """Draw how opaque the compared footage is, and the choice among several cameras."""
    cameras = cameras_of(context.scene)
    compared = context.scene.camera
    if len(cameras) > 1:
        row = layout.row(align=True)
        for index, camera in enumerate(cameras):
            button = row.operator(
                "scope.compare_view", text=str(index + 1), depress=camera == compared
            )
            button.index = index
    for background in compared.data.background_images[:1]:
        layout.prop(background, "alpha", text="Footage Opacity", slider=True)


def _draw_frame_rate(context: Context, layout: UILayout) -> None:
    """Draw what is to be known of the scene's frame rate, and the button that sets it."""
    scene = context.scene
    was = keyed_for(scene)
    if was:
        text = iface_(
            "The motion's keys are for {was:.5g} frames/s, and the scene has {now:.5g}: it plays "
            "at another speed",
            was=was,
            now=scene.render.fps / scene.render.fps_base,
        )
        draw_text(context, layout.box(), text, "ERROR")
    if was or differs(scene):
        layout.operator("scope.match_frame_rate", icon="TIME")


class SCOPE_PT_warnings(Tab, Panel):
    """Warnings about the shown capture."""

    bl_idname = "SCOPE_PT_warnings"
    bl_parent_id = "SCOPE_PT_result"
    bl_label = "Warnings"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require warnings."""
        return len(context.scene.scope.result.warnings) > 0

    def draw_header_preset(self, context: Context) -> None:
        """Draw their number in the header, which is visible while the panel is closed."""
        self.layout.label(text=str(len(context.scene.scope.result.warnings)), icon="ERROR")

    def draw(self, context: Context) -> None:
        """Draw the panel."""
        for warning in context.scene.scope.result.warnings:
            _draw_warning(context, self.layout.box(), warning)


class SCOPE_PT_figures(Tab, Panel):
    """People, frames, error and lens of the shown capture."""

    bl_idname = "SCOPE_PT_figures"
    bl_parent_id = "SCOPE_PT_result"
    bl_label = "Details"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: Context) -> bool:
        """Require a capture."""
        return shown_capture(context.scene) is not None

    def draw(self, context: Context) -> None:
        """Draw the panel."""
        _draw_figures(context, self.layout, context.scene.scope.result)
        if len(cameras_of(context.scene)) > 1:
            self.layout.operator("scope.save_calibration", icon="FILE_TICK")


def _draw_figures(context: Context, layout: UILayout, result: PropertyGroup) -> None:
    """Draw footage, people, frames and error. A .blend file written by the command line has no
    figures.
    """
    column = layout.column(align=True)
    column.label(
        text=display_text(Path(result.footage).name) or result.collection.name, icon="FILE_MOVIE"
    )
    people = people_of(result.collection)
    column.label(
        text=people_text(len(people)) if people else "The captured person was deleted",
        icon="OUTLINER_OB_ARMATURE" if people else "GHOST_DISABLED",
    )
    if not result.frames:
        return
    seconds = result.frames / result.frames_per_second if result.frames_per_second else 0.0
    frames = iface_(
        "{count} frame" if result.frames == 1 else "{count} frames", count=result.frames
    )
    if seconds:
        from ..job.job_progress import duration

        frames = iface_("{frames}, captured in {time}", frames=frames, time=duration(seconds))
    draw_text(context, column, frames, "TIME")
    if result.camera:
        error = iface_("Reprojection error {pixels:.1f} px", pixels=result.reprojection_px)
        draw_text(context, column, error, "CON_CAMERASOLVER")
        if result.sigma_cm > 0.0:
            sigma = iface_(
                "Joints ± {sigma:.1f} cm (standard deviation, median)", sigma=result.sigma_cm
            )
            draw_text(context, column, sigma, "EMPTY_ARROWS")
        if result.heights:
            draw_text(context, column, iface_("Height {heights}", heights=result.heights), "USER")
        draw_text(context, column, iface_("Lens: {lens}", lens=result.camera), "CAMERA_DATA")
    if result.execution:
        draw_text(
            context, column, iface_("Networks on {processor}", processor=result.execution), "MEMORY"
        )


def _draw_warning(context: Context, box: UILayout, warning: PropertyGroup) -> None:
    """Draw a warning, and for each of its spans a button that goes to the first frame."""
    draw_text(context, box, warning_text(stored_warning(warning)), "ERROR")
    if warning.spans:
        grid = box.grid_flow(columns=4, even_columns=True, align=True, row_major=True)
        for span in parse_spans(warning.spans):
            grid.operator("scope.go_to_frame", text=str(span)).frame = span.first


def draw_text(context: Context, layout: UILayout, text: str, icon: str = "NONE") -> None:
    """Draw a sentence, wrapped to the width of the sidebar."""
    import textwrap  # not while Blender starts

    scale = context.preferences.system.ui_scale
    width = (
        max(20, int((context.region.width / scale - 60) / _PIXELS_PER_CHARACTER))
        if context.region
        else 40
    )
    column = layout.column(align=True)
    for index, line in enumerate(textwrap.wrap(text, width)):
        column.label(text=line, icon=icon if index == 0 or icon == "NONE" else "BLANK1")


class SCOPE_PT_capture_presets(PresetPanel, Panel):
    """Presets of the capture settings."""

    bl_label = "Capture Presets"
    preset_subdir = "scope/capture"
    preset_operator = "script.execute_preset"
    preset_add_operator = "scope.add_capture_preset"

    def draw(self, context: Context) -> None:
        """Draw the presets. Without a folder for them, Blender would complain of missing paths
        before the first one.
        """
        if not bpy.utils.preset_paths(self.preset_subdir):
            with contextlib.suppress(OSError):
                bpy.utils.user_resource(
                    "SCRIPTS", path=f"presets/{self.preset_subdir}", create=True
                )
        PresetPanel.draw(self, context)


class SCOPE_OT_add_capture_preset(AddPresetBase, Operator):
    """Add the capture settings as a preset, or remove a preset"""

    bl_idname = "scope.add_capture_preset"
    bl_label = "Add Capture Preset"
    preset_menu = "SCOPE_PT_capture_presets"
    preset_subdir = "scope/capture"
    # Whole paths: a Blender before 4.4 does not find what ``preset_defines`` defines if its Python
    # is 3.13.
    preset_values = [
        f"bpy.context.scene.scope.{property_name(option)}"
        for option in options_at(Place.PANEL)
        if option.name not in _OF_THE_CLIP
    ]


def _clear_message(_settings: PropertyGroup, _context: Context) -> None:
    """Clear the error message, which was about other footage."""
    state.message = ""


def _english_text(stored: PropertyGroup) -> str:
    return warning_text(stored_warning(stored), str)


class SCOPE_PG_warning(PropertyGroup):
    """A warning about the result."""

    record: StringProperty()  # JSON of the notice
    text: StringProperty(get=_english_text)
    spans: StringProperty()  # scene frames; see `stored_values`


class SCOPE_PG_result(PropertyGroup):
    """Result of a capture, stored with its collection."""

    footage: StringProperty(subtype="FILE_PATH")
    people: IntProperty()
    frames: IntProperty()
    reprojection_px: FloatProperty()
    # standard deviation of the joints' positions, median; 0 where it is not known
    sigma_cm: FloatProperty()
    heights: StringProperty()  # of the people, such as "1.74 m ± 0.09"
    frames_per_second: FloatProperty()
    footage_rate: FloatProperty()  # frames per second of the footage; 0 for a picture
    camera: StringProperty()
    execution: StringProperty()
    resolution: IntVectorProperty(size=2)
    warnings: CollectionProperty(type=SCOPE_PG_warning)

    @property
    def collection(self) -> Collection | None:
        """The capture; None if this is the empty result of a scene without captures."""
        return self.id_data if isinstance(self.id_data, Collection) else None


class SCOPE_PG_view(PropertyGroup):
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


class SCOPE_PG_clip(PropertyGroup):
    """A clip of several that are captured one after the other."""

    footage: StringProperty(subtype="FILE_PATH", options=PATH_OPTIONS, **_FOOTAGE)
    status: StringProperty(default=WAITING)
    message: StringProperty()  # why it failed


@with_options(Place.PANEL)
class SCOPE_PG_settings(PropertyGroup):
    """The settings of a capture: the footage, the declared options of the panel, and the capture
    that is shown.
    """

    footage: StringProperty(
        subtype="FILE_PATH", options=PATH_OPTIONS, update=_clear_message, **_FOOTAGE
    )
    footage_text: path_text("footage", typed=lambda settings: settings.forget_places(), **_FOOTAGE)
    views: CollectionProperty(
        type=SCOPE_PG_view, description="Further videos of the same moment, by other cameras"
    )
    queue: CollectionProperty(
        type=SCOPE_PG_clip, description="Clips that are captured one after the other"
    )
    queue_format: EnumProperty(
        name="Files",
        items=(
            (NO_FILES, "No Files", "The captures stay in the scene alone", 0),
            *((key, label, text, number + 1) for key, label, text, number in FORMATS),
        ),
        default=NO_FILES,
        description="Format in which each clip of the list is written as well, once it is captured",
    )
    queue_folder: StringProperty(
        name="Folder",
        subtype="DIR_PATH",
        options=PATH_OPTIONS,
        description="Folder for the files of the clips; existing files stay",
    )
    capture: PointerProperty(
        name="Capture",
        type=Collection,
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
        type=Object,
        poll=lambda _, owner: owner.type == "CAMERA",
        description="Camera whose lens and motion are those of the camera that filmed the footage",
    )
    smooth_everyone: BoolProperty(
        name="All People",
        description="Raw, Normal and Strong act on everybody of the capture",
    )
    no_result: PointerProperty(type=SCOPE_PG_result)  # stays empty

    def forget_places(self) -> None:
        """Forget what is a place in a picture that is no longer shown: the person to capture, and
        the part in which people are looked for.
        """
        self.person = ""
        self.crop = ""

    @property
    def result(self) -> SCOPE_PG_result:
        """Result of the capture that is selected in the list; empty in a scene without captures."""
        capture = shown_capture(self.id_data)
        return capture.scope_result if capture else self.no_result


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


CLASSES = (
    SCOPE_PT_capture,
    SCOPE_PT_person,
    SCOPE_PT_scene,
    SCOPE_PT_result,
    SCOPE_PT_warnings,
    SCOPE_PT_figures,
    SCOPE_PT_capture_presets,
    SCOPE_OT_add_capture_preset,
    SCOPE_PG_warning,
    SCOPE_PG_result,
    SCOPE_PG_view,
    SCOPE_PG_clip,
    SCOPE_PG_settings,
)
