# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawing over the viewport, in pixels of its region, and the viewport that a tool was started
in; and where the mouse was when a button was pressed or released.

In a window without the keyboard's focus, Blender gives a button's event the place where the mouse
is when the event is handled. While Blender is busy, as with its first drawing or a fit, a drag is
over by then: the press would be where the drag ended, far from the handle that was under the mouse.
Movements always have their own place.
"""

from __future__ import annotations

import math

import bpy

from .sidebar import main_region, viewport_at

_ANGLES = [2 * math.pi * k / 20 for k in range(20)]
_MOVES = ("MOUSEMOVE", "INBETWEEN_MOUSEMOVE")


def viewport_of(pointer: int) -> tuple[bpy.types.Area, bpy.types.Region] | None:
    """Return the viewport at an address and its main region; see `viewport_at`."""
    found = viewport_at(pointer)
    return (found[1], main_region(found[1])) if found else None


def redraw_viewport(pointer: int) -> None:
    """Redraw a viewport, if it is still there."""
    if found := viewport_at(pointer):
        found[1].tag_redraw()


def draw_disc(center: tuple[float, float], radius: float, color: tuple[float, ...]) -> None:
    """Draw a disc with a dark rim."""
    import gpu
    from gpu_extras.batch import batch_for_shader

    for size, fill in ((radius + 1.5, (0.0, 0.0, 0.0, 0.6)), (radius, color)):
        rim = [(center[0] + size * math.cos(a), center[1] + size * math.sin(a)) for a in _ANGLES]
        triangles = [(0, k + 1, (k + 1) % len(rim) + 1) for k in range(len(rim))]
        shader = gpu.shader.from_builtin("UNIFORM_COLOR")
        batch = batch_for_shader(shader, "TRIS", {"pos": [center, *rim]}, indices=triangles)
        shader.uniform_float("color", fill)
        batch.draw(shader)


def draw_line(points: list[tuple[float, float]], color: tuple[float, ...]) -> None:
    """Draw a line between two points."""
    import gpu
    from gpu_extras.batch import batch_for_shader

    gpu.state.line_width_set(2.0)
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    batch = batch_for_shader(shader, "LINES", {"pos": points})
    shader.uniform_float("color", color)
    batch.draw(shader)
    gpu.state.line_width_set(1.0)


class Pointer:
    """Follows the mouse through a tool's events, in pixels of the window."""

    def __init__(self) -> None:
        """Begin before the first event."""
        self._moved_to: tuple[int, int] | None = None

    def place(self, event: bpy.types.Event) -> tuple[int, int]:
        """Return where the mouse was at an event; every event of the tool has to be given, in their
        order.
        """
        if event.type in _MOVES:
            self._moved_to = event.mouse_x, event.mouse_y
        return self._moved_to or (event.mouse_x, event.mouse_y)
