# SPDX-License-Identifier: GPL-3.0-or-later
"""All viewports, and finding one again by its address.

Blender frees a closed area, and a reference to it then crashes, so whatever runs later keeps the
address alone.
"""

from __future__ import annotations

import bpy


def viewports() -> list[tuple[bpy.types.Window, bpy.types.Area]]:
    """Return the viewports of all windows, each with its window."""
    windows = bpy.context.window_manager.windows
    return [
        (window, area)
        for window in windows
        for area in window.screen.areas
        if area.type == "VIEW_3D"
    ]


def viewport_at(pointer: int) -> tuple[bpy.types.Window, bpy.types.Area] | None:
    """Return a viewport and its window; None once it was closed or became another editor.

    :param pointer: ``as_pointer`` of the viewport's area.
    """
    return next((pair for pair in viewports() if pair[1].as_pointer() == pointer), None)
