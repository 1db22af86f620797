# SPDX-License-Identifier: GPL-3.0-or-later
"""Selection, mode and hidden objects from before a live capture, for when it is cancelled."""

from __future__ import annotations

import bpy


def select_only(layer: bpy.types.ViewLayer, chosen: bpy.types.Object) -> None:
    """Make an object the active and the only selected one."""
    layer.update()
    for obj in layer.objects:
        obj.select_set(obj == chosen, view_layer=layer)
    layer.objects.active = chosen


class SceneBefore:
    """The view layer of the context. Objects are kept by name, because undo replaces them."""

    def __init__(self) -> None:
        layer = bpy.context.view_layer
        layer.update()
        self._scene_uid = bpy.context.scene.session_uid
        self._layer = layer.name
        active = layer.objects.active
        self._active: str = active.name if active else ""
        self._mode: str = active.mode if active else "OBJECT"
        self._selected = {obj.name for obj in layer.objects if obj.select_get(view_layer=layer)}
        self._hidden = {obj.name for obj in layer.objects if obj.hide_get(view_layer=layer)}

    def restore(self) -> None:
        """Restore what still exists."""
        scene = next(
            (scene for scene in bpy.data.scenes if scene.session_uid == self._scene_uid), None
        )
        layer = scene.view_layers.get(self._layer) if scene else None
        if layer is None:
            return
        layer.update()  # it still lists what was just removed
        for obj in layer.objects:
            hidden = obj.name in self._hidden
            if obj.hide_get(view_layer=layer) != hidden:
                obj.hide_set(hidden, view_layer=layer)
            obj.select_set(obj.name in self._selected, view_layer=layer)
        layer.objects.active = layer.objects.get(self._active)
        is_shown = layer == bpy.context.view_layer
        if (
            is_shown
            and layer.objects.active is not None
            and layer.objects.active.mode != self._mode
        ):
            bpy.ops.object.mode_set(mode=self._mode)
