# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the mouse was when a button was pressed or released.

In a window without the keyboard's focus, Blender gives a button's event the place where the mouse
is when the event is handled. While Blender is busy, as with its first drawing or a fit, a drag is
over by then: the press would be where the drag ended, far from the handle that was under the mouse.
Movements always have their own place.
"""

from __future__ import annotations

import bpy

_MOVES = ("MOUSEMOVE", "INBETWEEN_MOUSEMOVE")


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
