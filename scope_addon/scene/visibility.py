# SPDX-License-Identifier: GPL-3.0-or-later
"""Hiding a captured person while a retargeted rig replaces them, and showing them again; and
selection, mode and hidden objects from before a live capture, for when it is cancelled; and where
a hidden object is, which Blender does not evaluate. Which scene a window shows: exporters, and
whatever is built, work on that one.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
from bpy.types import Object, Scene, ViewLayer
from mathutils import Matrix

from .datablocks import found, is_in_layer, is_part

# Custom property of objects hidden here, so that those hidden by the user stay hidden. Its value
# says whether the object stays hidden or is only shown temporarily.
_HIDDEN = "scope_hidden"
_STAYS = 1
_COMES_BACK = 2


def hide(armature: Object, view_layer: ViewLayer) -> None:
    """Hide a captured armature and its body in viewports and renders."""
    for obj in _person(armature, view_layer):
        if not obj.hide_get(view_layer=view_layer) or not obj.hide_render:
            obj[_HIDDEN] = _STAYS
        obj.hide_set(True, view_layer=view_layer)
        obj.hide_render = True


def show(armature: Object, view_layer: ViewLayer, *, temporarily: bool = False) -> None:
    """Show what ``hide`` has hidden.

    :param temporarily: until ``hide_again``.
    """
    for obj in (armature, *armature.children):
        if _HIDDEN not in obj or not is_in_layer(view_layer, obj):
            continue
        if not temporarily:
            del obj[_HIDDEN]
        elif obj.hide_get(view_layer=view_layer):
            obj[_HIDDEN] = _COMES_BACK
        obj.hide_set(False, view_layer=view_layer)
        obj.hide_render = False


def hide_again(armature: Object, view_layer: ViewLayer) -> None:
    """Hide what was shown temporarily."""
    if armature.get(_HIDDEN) == _COMES_BACK:
        hide(armature, view_layer)
        for obj in _person(armature, view_layer):
            obj[_HIDDEN] = _STAYS


def _person(armature: Object, view_layer: ViewLayer) -> list[Object]:
    """Return armature and body, without objects outside the view layer, which cannot be hidden, and
    without what the user has parented to the armature.
    """
    meshes = [obj for obj in armature.children if obj.type == "MESH"]
    # the body of a live capture is not marked
    bodies = [mesh for mesh in meshes if is_part(mesh)] or meshes
    return [obj for obj in (armature, *bodies) if is_in_layer(view_layer, obj)]


@contextmanager
def evaluated(obj: Object) -> Iterator[None]:
    """Let Blender evaluate an object inside the block, also one that is hidden or excluded.

    Otherwise, such an object does not follow its animation and its parents, and is at the origin
    after its file was opened.
    """
    scene = bpy.context.scene
    shown = scene.collection.objects  # this collection cannot be hidden or excluded
    is_hidden = obj.hide_viewport
    is_added = obj not in shown.values() and scene.library is None
    if obj.visible_get(view_layer=bpy.context.view_layer):
        yield
        return
    try:
        obj.hide_viewport = False
        if is_added:
            shown.link(obj)
        above: Object | None = obj
        while above is not None:
            above.update_tag(refresh={"OBJECT", "TIME"})
            above = above.parent
        yield
    finally:
        if is_added:
            shown.unlink(obj)
        obj.hide_viewport = is_hidden
        bpy.context.view_layer.update()  # it would still list the object


def world_matrix(obj: Object) -> Matrix:
    """Return an object's transform (4, 4) to the world at the current frame, also of a hidden
    one.
    """
    with evaluated(obj):
        bpy.context.view_layer.update()
        return obj.matrix_world.copy()


def select_only(layer: ViewLayer, chosen: Object) -> None:
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
        scene = found("scenes", "", self._scene_uid)
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


@contextmanager
def window_shows(scene: Scene) -> Iterator[None]:
    """Show a scene in the window inside the block, and the former one, as it was, after it.

    Viewports that look through a camera leave it where the other scene has none; they look through
    it again afterwards.
    """
    if bpy.context.scene == scene:
        yield
        return
    # timers have no window, so the first one is used
    window = bpy.context.window or bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window):
        before = window.scene
        views = [
            area.spaces.active.region_3d for area in window.screen.areas if area.type == "VIEW_3D"
        ]
        through_camera = [view for view in views if view.view_perspective == "CAMERA"]
        window.scene = scene
        try:
            yield
        finally:
            window.scene = before
            for view in through_camera:
                view.view_perspective = "CAMERA"
