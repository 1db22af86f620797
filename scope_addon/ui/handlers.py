# SPDX-License-Identifier: GPL-3.0-or-later
"""What is put right after Blender's own steps: views and appended files.

Views are not part of what Blender undoes, so that the viewport is restored when "Compare with
Footage" is undone. And Blender puts the rings that the bones of an appended armature show into the
scene. Before 4.3, Blender says nothing of appended files, and they stay there.
"""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

from .comparison import close_side_view, end, looks_through, side_area
from .sidebar import viewports

_looked_through: set[int] = set()  # areas that showed a capture through its camera before the undo
_sides: set[int] = set()  # areas that showed a capture from its side


def attach() -> None:
    """Add the handlers."""
    bpy.app.handlers.undo_pre.append(_before)
    bpy.app.handlers.undo_post.append(_after)
    if hasattr(bpy.app.handlers, "blend_import_post"):
        bpy.app.handlers.blend_import_post.append(_unlink_rings)


def detach() -> None:
    """Remove the handlers."""
    bpy.app.handlers.undo_pre.remove(_before)
    bpy.app.handlers.undo_post.remove(_after)
    if hasattr(bpy.app.handlers, "blend_import_post"):
        bpy.app.handlers.blend_import_post.remove(_unlink_rings)


@persistent
def _before(*_: object) -> None:
    _looked_through.clear()
    _sides.clear()
    for window, area in viewports():
        if area == side_area(window.screen):
            _sides.add(area.as_pointer())
        if looks_through(window.scene, area.spaces.active):
            _looked_through.add(area.as_pointer())


@persistent
def _after(*_: object) -> None:
    if _looked_through:
        bpy.app.timers.register(_leave)  # operators must not run during an undo


def _leave() -> None:
    """Leave local view and camera view in the viewports that no longer show a capture through its
    camera.
    """
    left = False
    for window, area in viewports():
        if area.as_pointer() in _looked_through and not looks_through(
            window.scene, area.spaces.active
        ):
            end(window, area)
            left = True
    for window, side in [pair for pair in viewports() if left and pair[1].as_pointer() in _sides]:
        close_side_view(window, side)
    _looked_through.clear()


@persistent
def _unlink_rings(*_: object) -> None:
    from ..scene.character.armature import unlink_rings

    unlink_rings()
