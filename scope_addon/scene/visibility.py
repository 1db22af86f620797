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


def select_only(layer: ViewLayer, *chosen: Object) -> None:
    """Select these objects alone, and make the first of them active."""
    layer.update()
    for obj in layer.objects:
        obj.select_set(obj in chosen, view_layer=layer)
    layer.objects.active = chosen[0]


class Selection:
    """The selected objects of a view layer, the active one and its mode, by their sessions'
    identifiers: undo replaces objects.
    """

    def __init__(self, layer: ViewLayer) -> None:
        active = layer.objects.active
        self.selected = {o.session_uid for o in layer.objects if o.select_get(view_layer=layer)}
        self.active = active.session_uid if active else 0
        self.mode = active.mode if active else "OBJECT"

    def restore(self, layer: ViewLayer) -> None:
        """Select and activate what still exists; the mode stays."""
        active = None
        for obj in layer.objects:
            obj.select_set(obj.session_uid in self.selected, view_layer=layer)
            if obj.session_uid == self.active:
                active = obj
        layer.objects.active = active

    def restore_mode(self) -> None:
        """Give the active object of the context its mode, if it is the same object."""
        active = bpy.context.view_layer.objects.active
        if active is not None and active.session_uid == self.active and active.mode != self.mode:
            bpy.ops.object.mode_set(mode=self.mode)


class SceneBefore:
    """The selection of the context's view layer, and which of its objects are hidden."""

    def __init__(self) -> None:
        layer = bpy.context.view_layer
        layer.update()
        self._scene_uid = bpy.context.scene.session_uid
        self._layer = layer.name
        self._selection = Selection(layer)
        self._hidden = {o.session_uid for o in layer.objects if o.hide_get(view_layer=layer)}

    def restore(self) -> None:
        """Restore what still exists."""
        scene = found("scenes", "", self._scene_uid)
        layer = scene.view_layers.get(self._layer) if scene else None
        if layer is None:
            return
        layer.update()  # it still lists what was just removed
        for obj in layer.objects:
            hidden = obj.session_uid in self._hidden
            if obj.hide_get(view_layer=layer) != hidden:
                obj.hide_set(hidden, view_layer=layer)
        self._selection.restore(layer)
        if layer == bpy.context.view_layer:
            self._selection.restore_mode()


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
