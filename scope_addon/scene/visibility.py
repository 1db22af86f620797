# SPDX-License-Identifier: GPL-3.0-or-later
"""Hide a captured person while a rig moves in their place, and show them again."""

from __future__ import annotations

import bpy

_HIDDEN = "scope_hidden"  # custom property of what was hidden here, so that what the user hides stays hidden


def hide(armature: bpy.types.Object, view_layer: bpy.types.ViewLayer) -> None:
    """Hide a captured armature and its body, in viewports and in renders."""
    for obj in _body(armature):
        if not obj.hide_get(view_layer=view_layer) or not obj.hide_render:
            obj[_HIDDEN] = True
        obj.hide_set(True, view_layer=view_layer)
        obj.hide_render = True


def show(armature: bpy.types.Object, view_layer: bpy.types.ViewLayer) -> None:
    """Show what ``hide`` has hidden."""
    for obj in _body(armature):
        if _HIDDEN in obj:
            del obj[_HIDDEN]
            obj.hide_set(False, view_layer=view_layer)
            obj.hide_render = False


def _body(armature: bpy.types.Object) -> list[bpy.types.Object]:
    return [armature, *(obj for obj in armature.children if obj.type == "MESH")]
