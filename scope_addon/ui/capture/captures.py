# SPDX-License-Identifier: GPL-3.0-or-later
"""The captures of a scene: its collections with a capture's mark, each of which stores its own result.

The result is stored with the collection, so it is saved, undone, appended, linked, renamed and deleted with it.
"""

from __future__ import annotations

import bpy

from ..captured_person import captured_armature
from ..reporting import iface_

CAPTURE = "scope_capture"  # custom property that ``scene.build`` gives to a capture's collection


def captures_of(scene: bpy.types.Scene) -> list[bpy.types.Collection]:
    """Return the captures of a scene, the last added last."""
    return [collection for collection in scene.collection.children_recursive if CAPTURE in collection]


def shown_capture(scene: bpy.types.Scene) -> bpy.types.Collection | None:
    """Return the capture that is selected in the list; the last one if the selected one was removed."""
    found = captures_of(scene)
    if scene.scope.capture in found:
        chosen: bpy.types.Collection = scene.scope.capture
        return chosen
    return found[-1] if found else None


def people_of(capture: bpy.types.Collection) -> list[bpy.types.Object]:
    """Return the captured armatures of a capture; empty if they were deleted."""
    return [obj for obj in capture.all_objects if obj.type == "ARMATURE" and "scope_source" in obj]


def people_text(count: int) -> str:
    """Return a number of people with its noun."""
    return iface_("{count} person" if count == 1 else "{count} people", count=count)


def shown_index(settings: bpy.types.PropertyGroup) -> int:
    """Return the shown capture's index among the file's collections; -1 if there is none. Blender's list asks for it.

    The index changes with every collection that is added, removed or renamed; the stored pointer does not.
    """
    shown = shown_capture(settings.id_data)
    return next((index for index, each in enumerate(bpy.data.collections) if each == shown), -1)


def show_index(settings: bpy.types.PropertyGroup, index: int) -> None:
    """Show the capture at an index among the file's collections."""
    if 0 <= index < len(bpy.data.collections):
        settings.capture = bpy.data.collections[index]
        _make_active(settings.capture)


def _make_active(capture: bpy.types.Collection) -> None:
    """Make a person of the shown capture active, so that the sections below act on what is shown."""
    context = bpy.context
    layer = context.view_layer
    people = [person for person in people_of(capture) if layer is not None and person.name in layer.objects]
    active = layer.objects.active if people else None
    if not people or captured_armature(context) in people or (active is not None and active.mode != "OBJECT"):
        return
    for obj in context.selected_objects:
        obj.select_set(False)
    people[0].select_set(True)
    layer.objects.active = people[0]


class SCOPE_UL_captures(bpy.types.UIList):
    """The captures of the scene."""

    def draw_item(
        self,
        _context: bpy.types.Context,
        layout: bpy.types.UILayout,
        _data: bpy.types.BlendData,
        item: bpy.types.Collection,
        _icon: int,
        _settings: bpy.types.PropertyGroup,
        _active_property: str,
    ) -> None:
        """Draw one capture: its name, its people, and whether it has warnings; grey without an armature."""
        people, result = people_of(item), item.scope_result
        row = layout.split(factor=0.6, align=True)
        row.active = bool(people)
        row.prop(item, "name", text="", emboss=False, icon="OUTLINER_COLLECTION" if people else "GHOST_DISABLED")
        details = row.row(align=True)
        details.label(text=people_text(len(people)) if people else iface_("removed"))
        details.label(text="", icon="ERROR" if people and len(result.warnings) else "BLANK1")

    def filter_items(
        self, context: bpy.types.Context, data: bpy.types.BlendData, property_name: str
    ) -> tuple[list[int], list[int]]:
        """Show only the captures of the scene, and of these the ones whose name contains the typed filter."""
        shown, typed = captures_of(context.scene), self.filter_name.lower()
        flags = [
            self.bitflag_filter_item if each in shown and typed in each.name.lower() else 0
            for each in getattr(data, property_name)
        ]
        return flags, []


def draw_captures(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw the list if the scene has several captures."""
    count = len(captures_of(context.scene))
    if count > 1:
        rows = {"rows": min(count, 3), "maxrows": 5, "sort_lock": True}
        layout.template_list(
            "SCOPE_UL_captures", "", bpy.data, "collections", context.scene.scope, "capture_index", **rows
        )


CLASSES = (SCOPE_UL_captures,)
