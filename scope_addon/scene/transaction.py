# SPDX-License-Identifier: GPL-3.0-or-later
"""All or nothing: what a failed or cancelled build made is removed, what it changed is put back."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

# Kinds of datablock that building a scene may create; shape keys go with their mesh.
_KINDS = ("collections", "objects", "meshes", "armatures", "cameras", "actions", "materials", "movieclips", "images")
_SCENE = ("frame_start", "frame_end", "frame_preview_start", "frame_preview_end", "camera")
_RENDER = ("fps", "fps_base", "resolution_x", "resolution_y", "pixel_aspect_x", "pixel_aspect_y")


@contextmanager
def all_or_nothing(scene: bpy.types.Scene) -> Iterator[None]:
    """Undo every new datablock and scene setting when the block raises, and raise on."""
    before = {kind: {block.session_uid for block in getattr(bpy.data, kind)} for kind in _KINDS}
    settings = {name: getattr(scene, name) for name in _SCENE}
    render = {name: getattr(scene.render, name) for name in _RENDER}
    current = scene.frame_current, scene.frame_subframe
    view_layer = bpy.context.view_layer
    active = view_layer.objects.active
    mode = active.mode if active else "OBJECT"
    markers = set(scene.timeline_markers.values())
    selected = [obj for obj in view_layer.objects if obj.select_get(view_layer=view_layer)]
    try:
        yield
    except BaseException:
        now = view_layer.objects.active
        if now is not None and now.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        new = [b for kind in _KINDS for b in getattr(bpy.data, kind) if b.session_uid not in before[kind]]
        bpy.data.batch_remove(new)
        for marker in [m for m in scene.timeline_markers if m not in markers]:
            scene.timeline_markers.remove(marker)
        for name, value in render.items():
            setattr(scene.render, name, value)
        scene.frame_end = max(settings["frame_end"], scene.frame_start)
        for name, value in settings.items():
            setattr(scene, name, value)
        scene.frame_set(current[0], subframe=current[1])
        for obj in view_layer.objects:
            obj.select_set(obj in selected, view_layer=view_layer)
        view_layer.objects.active = active
        if active is not None and mode != active.mode:
            bpy.ops.object.mode_set(mode=mode)
        raise
