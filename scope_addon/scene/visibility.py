# SPDX-License-Identifier: GPL-3.0-or-later
"""Hide a captured person while a rig moves in their place, and show them again."""

from __future__ import annotations

import bpy

# Custom property of what was hidden here, so that what the user hides stays hidden; its value says what is to come.
_HIDDEN = "scope_hidden"
_STAYS, _COMES_BACK = 1, 2


def hide(armature: bpy.types.Object, view_layer: bpy.types.ViewLayer) -> None:
    """Hide a captured armature and its body, in viewports and in renders."""
    for obj in _person(armature, view_layer):
        if not obj.hide_get(view_layer=view_layer) or not obj.hide_render:
            obj[_HIDDEN] = _STAYS
        obj.hide_set(True, view_layer=view_layer)
        obj.hide_render = True


def show(armature: bpy.types.Object, view_layer: bpy.types.ViewLayer, *, temporarily: bool = False) -> None:
    """Show what ``hide`` has hidden; ``temporarily``: until ``hide_again``."""
    for obj in _person(armature, view_layer):
        if _HIDDEN not in obj:
            continue
        if not temporarily:
            del obj[_HIDDEN]
        elif obj.hide_get(view_layer=view_layer):
            obj[_HIDDEN] = _COMES_BACK
        obj.hide_set(False, view_layer=view_layer)
        obj.hide_render = False


def hide_again(armature: bpy.types.Object, view_layer: bpy.types.ViewLayer) -> None:
    """Hide what was shown for now."""
    if armature.get(_HIDDEN) == _COMES_BACK:
        hide(armature, view_layer)
        for obj in _person(armature, view_layer):
            obj[_HIDDEN] = _STAYS


def _person(armature: bpy.types.Object, view_layer: bpy.types.ViewLayer) -> list[bpy.types.Object]:
    """Armature and body, but for what the view layer leaves out: that is not seen, nor can it be hidden."""
    person = [armature, *(obj for obj in armature.children if obj.type == "MESH")]
    return [obj for obj in person if obj.name in view_layer.objects]
