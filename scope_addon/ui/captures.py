# SPDX-License-Identifier: GPL-3.0-or-later
"""The captures of a scene: its collections with a capture's mark, each of which stores its own
result.

The result is stored with the collection, so it is saved, undone, appended, linked, renamed and
deleted with it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import bpy
from bpy.props import StringProperty
from bpy.types import Context, Object, Operator, PropertyGroup, Scene, UILayout, UIList

from ..notices import notice
from ..scene.datablocks import captures_of, is_in_layer, is_person, with_data
from ..scene.visibility import select_only
from .captured_person import captured_armature
from .reporting import iface_, sentence, tip_

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

_HIDDEN = "scope_hidden"  # custom property of a collection that was hidden here, not by the user
# Widths in pixels at a scale of 1: what surrounds a row of the list in the sidebar, an icon, and
# what the text may be.
_AROUND = 62.0
_ICON = 22.0
_DEFAULT_WIDTH = 260.0
_SAME_SIZE = 0.01
# of a text; of a sidebar with room for the words beside the number of people
_PADDING = 10.0
_WIDE = 340.0


def shown_capture(scene: Scene) -> bpy.types.Collection | None:
    """Return the capture that is selected in the list; the last one if the selected one was
    removed.
    """
    found = captures_of(scene)
    if scene.scope.capture in found:
        return scene.scope.capture
    return found[-1] if found else None


def hide_others(
    scene: Scene, shown: Collection[bpy.types.Collection]
) -> list[bpy.types.Collection]:
    """Hide all captures but the new ones, in whose place they are, in viewports and renders; return
    those that were shown.

    Whoever selects one in the list shows it again. One that another scene has too stays shown, as
    it would be hidden there as well.
    """
    elsewhere = {
        each
        for other in bpy.data.scenes
        if other != scene
        for each in other.collection.children_recursive
    }
    hidden = []
    for capture in captures_of(scene):
        is_local = capture.library is None and not capture.hide_viewport
        if capture not in shown and capture not in elsewhere and is_local:
            capture.hide_viewport = capture.hide_render = True
            capture[_HIDDEN] = True
            hidden.append(capture)
    return hidden


def show_again(capture: bpy.types.Collection) -> None:
    """Show a capture that `hide_others` has hidden."""
    if capture.library is None and _HIDDEN in capture:
        del capture[_HIDDEN]
        capture.hide_viewport = capture.hide_render = False
        _evaluate_animation(capture)


def _evaluate_animation(capture: bpy.types.Collection) -> None:
    """Let Blender evaluate a capture's animation at the current frame: on its own, it would show
    the pose from before the capture was hidden until the frame changes.
    """
    for obj in capture.all_objects:
        for block in with_data(obj):
            if block.library is None:
                block.update_tag(refresh={"TIME"})


def people_of(capture: bpy.types.Collection) -> list[Object]:
    """Return the captured armatures of a capture; empty if they were deleted."""
    return [obj for obj in capture.all_objects if obj.type == "ARMATURE" and is_person(obj)]


def unit_text(scene: Scene) -> str:
    """Return what to say of a scene whose unit is not a metre; empty if the shown people have their
    size in it.
    """
    unit_m = scene.unit_settings.scale_length
    capture = shown_capture(scene)
    people = people_of(capture) if capture else []
    scales = [person.matrix_world.median_scale * unit_m for person in people]
    if all(abs(scale - 1.0) < _SAME_SIZE for scale in scales):
        return ""
    warning = notice("scene_unit", unit_m=unit_m, scale=1.0 / unit_m)
    return sentence(warning.text(iface_))


def people_text(count: int) -> str:
    """Return a number of people with its noun."""
    return iface_("{count} person" if count == 1 else "{count} people", count=count)


def shown_index(settings: PropertyGroup) -> int:
    """Return the shown capture's index among the file's collections; -1 if there is none. Blender's
    list asks for it.

    The index changes with every collection that is added, removed or renamed; the stored pointer
    does not.
    """
    shown = shown_capture(settings.id_data)
    return next((index for index, each in enumerate(bpy.data.collections) if each == shown), -1)


def show_index(settings: PropertyGroup, index: int) -> None:
    """Show the capture at an index among the file's collections."""
    if 0 <= index < len(bpy.data.collections):
        _show(settings, bpy.data.collections[index])


def _show(settings: PropertyGroup, capture: bpy.types.Collection) -> None:
    settings.capture = capture
    show_again(capture)
    _make_active(capture)


def _make_active(capture: bpy.types.Collection) -> None:
    """Make a person of the shown capture active, so that the sections below act on what is
    shown.
    """
    context = bpy.context
    layer = context.view_layer
    people = [
        person for person in people_of(capture) if layer is not None and is_in_layer(layer, person)
    ]
    active = layer.objects.active if people else None
    if (
        not people
        or captured_armature(context) in people
        or (active is not None and active.mode != "OBJECT")
    ):
        return
    select_only(layer, people[0])


def elided(text: str, width: float, measure: Callable[[str], float]) -> str:
    """Return a text that fits into a width, without its middle if need be: the beginning and end
    tell names apart.

    :param measure: returns the width of a text.
    """
    if measure(text) <= width:
        return text
    for kept in range(len(text) - 1, 0, -1):
        short = f"{text[: (kept + 1) // 2]}…{text[len(text) - kept // 2 :]}"
        if measure(short) <= width:
            return short
    return "…"


def _text_width(text: str) -> float:
    """Return the width of a text in the interface's font, in pixels at a scale of 1."""
    import blf

    blf.size(0, float(bpy.context.preferences.ui_styles[0].widget.points))
    return float(blf.dimensions(0, text)[0])


class SCOPE_OT_show_capture(Operator):
    """Show this capture"""

    bl_idname = "scope.show_capture"
    bl_label = "Show Capture"
    bl_options = {"UNDO", "INTERNAL"}

    name: StringProperty(name="Name", description="Name of the capture's collection")

    @classmethod
    def description(cls, _context: Context, properties: bpy.types.OperatorProperties) -> str:
        """Return the whole name, which the list may have no room for, and where to change it.

        Blender opens the text field of an entry on a double click, and hands a button no second
        click.
        """
        return f"{properties.name}\n{tip_('Rename it with Object > Motion Capture > Rename Take')}"

    def execute(self, context: Context) -> set[str]:
        """Select it in the list."""
        capture = bpy.data.collections.get(self.name)
        if capture not in captures_of(context.scene):
            return {"CANCELLED"}
        _show(context.scene.scope, capture)
        return {"FINISHED"}


class SCOPE_UL_captures(UIList):
    """The captures of the scene."""

    def draw_item(
        self,
        context: Context,
        layout: UILayout,
        _data: bpy.types.BlendData,
        item: bpy.types.Collection,
        _icon: int,
        _settings: PropertyGroup,
        _active_property: str,
    ) -> None:
        """Draw one capture: its name, its people, and whether it has warnings; grey without an
        armature.

        A name that is too long is drawn without its middle, and whole in its tooltip.
        """
        people = people_of(item)
        result = item.scope_result
        scale = context.preferences.system.ui_scale
        sidebar = context.region.width / scale if context.region else _DEFAULT_WIDTH
        text = people_text(len(people)) if people else iface_("removed")
        if people and sidebar < _WIDE:
            text = str(len(people))
        beside = _text_width(text) + 2 * _ICON + _PADDING
        width = max(sidebar - _AROUND, 2 * beside)
        row = layout.split(factor=1.0 - beside / width, align=True)
        row.active = bool(people)
        icon = "OUTLINER_COLLECTION" if people else "GHOST_DISABLED"
        name = elided(item.name, width - beside - _ICON - _PADDING, _text_width)
        if name == item.name:
            row.prop(item, "name", text="", emboss=False, icon=icon)
        else:
            cell = row.row(align=True)
            cell.alignment = "LEFT"
            cell.operator(
                "scope.show_capture", text=name, translate=False, emboss=False, icon=icon
            ).name = item.name
        details = row.row(align=True)
        details.label(text=text, translate=False, icon="OUTLINER_OB_ARMATURE" if people else "NONE")
        details.label(text="", icon="ERROR" if people and len(result.warnings) else "BLANK1")

    def filter_items(
        self, context: Context, data: bpy.types.BlendData, property_name: str
    ) -> tuple[list[int], list[int]]:
        """Show only the captures of the scene, and of these the ones whose name contains the typed
        filter.
        """
        shown = captures_of(context.scene)
        typed = self.filter_name.lower()
        flags = [
            self.bitflag_filter_item if each in shown and typed in each.name.lower() else 0
            for each in getattr(data, property_name)
        ]
        return flags, []


def draw_captures(layout: UILayout, context: Context) -> None:
    """Draw the list if the scene has several captures."""
    count = len(captures_of(context.scene))
    if count > 1:
        rows = {"rows": min(count, 3), "maxrows": 5, "sort_lock": True}
        layout.template_list(
            "SCOPE_UL_captures",
            "",
            bpy.data,
            "collections",
            context.scene.scope,
            "capture_index",
            **rows,
        )


CLASSES = (SCOPE_OT_show_capture, SCOPE_UL_captures)
