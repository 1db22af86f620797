# SPDX-License-Identifier: GPL-3.0-or-later
"""Which scene a window shows: exporters, and whatever is built, work on that one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy


@contextmanager
def window_shows(scene: bpy.types.Scene) -> Iterator[None]:
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
