# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding a viewport again by its address.

Blender frees a closed area, and a reference to it then crashes, so whatever runs later keeps the address alone.
"""

from __future__ import annotations

import bpy


def viewport_at(pointer: int) -> tuple[bpy.types.Window, bpy.types.Area] | None:
    """Return a viewport and its window; None once it was closed or became another editor.

    :param pointer: ``as_pointer`` of the viewport's area.
    """
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.as_pointer() == pointer and area.type == "VIEW_3D":
                return window, area
    return None
