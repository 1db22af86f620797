# SPDX-License-Identifier: GPL-3.0-or-later
"""Hiding a captured person while a retargeted rig replaces them, and showing them again."""

from __future__ import annotations

import bpy

from .datablock_names import is_in_layer

# Custom property of objects hidden here, so that those hidden by the user stay hidden. Its value
# says whether the object stays hidden or is only shown temporarily.
_HIDDEN = "scope_hidden"
_STAYS = 1
_COMES_BACK = 2


def hide(armature: bpy.types.Object, view_layer: bpy.types.ViewLayer) -> None:
    """Hide a captured armature and its body in viewports and renders."""
    for obj in _person(armature, view_layer):
        if not obj.hide_get(view_layer=view_layer) or not obj.hide_render:
            obj[_HIDDEN] = _STAYS
        obj.hide_set(True, view_layer=view_layer)
        obj.hide_render = True


def show(
    armature: bpy.types.Object, view_layer: bpy.types.ViewLayer, *, temporarily: bool = False
) -> None:
    """Show what ``hide`` has hidden.

    :param temporarily: until ``hide_again``.
    """
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
    """Hide what was shown temporarily."""
    if armature.get(_HIDDEN) == _COMES_BACK:
        hide(armature, view_layer)
        for obj in _person(armature, view_layer):
            obj[_HIDDEN] = _STAYS


def _person(armature: bpy.types.Object, view_layer: bpy.types.ViewLayer) -> list[bpy.types.Object]:
    """Return armature and body, without objects outside the view layer, which cannot be hidden."""
    person = [armature, *(obj for obj in armature.children if obj.type == "MESH")]
    return [obj for obj in person if is_in_layer(view_layer, obj)]
