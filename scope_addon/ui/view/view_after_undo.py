# SPDX-License-Identifier: GPL-3.0-or-later
"""Restore the viewport when "Compare with Footage" is undone; views are not part of what Blender undoes."""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

from .view_operators import looks_through

_looked_through: set[int] = set()  # areas that showed a capture through its camera before the undo


def attach() -> None:
    """Add the undo handlers."""
    bpy.app.handlers.undo_pre.append(_before)
    bpy.app.handlers.undo_post.append(_after)


def detach() -> None:
    """Remove the undo handlers."""
    bpy.app.handlers.undo_pre.remove(_before)
    bpy.app.handlers.undo_post.remove(_after)


@persistent
def _before(*_: object) -> None:
    _looked_through.clear()
    for window, area in _viewports():
        if looks_through(window.scene, area.spaces.active):
            _looked_through.add(area.as_pointer())


@persistent
def _after(*_: object) -> None:
    if _looked_through:
        bpy.app.timers.register(_leave)  # operators must not run during an undo


def _leave() -> None:
    """Leave local view and camera view in the viewports that no longer show a capture through its camera."""
    for window, area in _viewports():
        space = area.spaces.active
        if area.as_pointer() not in _looked_through or looks_through(window.scene, space):
            continue
        region = next(region for region in area.regions if region.type == "WINDOW")
        with bpy.context.temp_override(window=window, area=area, region=region):
            if space.local_view:
                bpy.ops.view3d.localview(frame_selected=False)
            if space.region_3d.view_perspective == "CAMERA":
                bpy.ops.view3d.view_camera()
    _looked_through.clear()


def _viewports() -> list[tuple[bpy.types.Window, bpy.types.Area]]:
    windows = bpy.context.window_manager.windows
    return [(window, area) for window in windows for area in window.screen.areas if area.type == "VIEW_3D"]
