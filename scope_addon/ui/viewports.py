# SPDX-License-Identifier: GPL-3.0-or-later
"""All 3D viewports, the sidebar of each with its tab Scope, and drawing over them, in pixels of a
region; and where the mouse was when a button was pressed or released.

A viewport is found again by its address: Blender frees a closed area, and a reference to it then
crashes, so whatever runs later keeps the address alone.

In a window without the keyboard's focus, Blender gives a button's event the place where the mouse
is when the event is handled. While Blender is busy, as with its first drawing or a fit, a drag is
over by then: the press would be where the drag ended, far from the handle that was under the mouse.
Movements always have their own place.
"""

from __future__ import annotations

import math

import bpy
from bpy.types import Area, Context, Event, Region, Window

TAB = "Scope"
_ANGLES = [2 * math.pi * k / 20 for k in range(20)]
_MOVES = ("MOUSEMOVE", "INBETWEEN_MOUSEMOVE")
_DRAWN_AFTER_S = 0.3  # a sidebar knows its tabs only after it has been drawn


def viewport_of(context: Context) -> Area | None:
    """Return the context's viewport, or else, as in a menu at the top, the largest of its
    window.
    """
    window = context.window
    area = context.area
    if window is None or (area is not None and area.type == "VIEW_3D"):
        return area if window is not None else None
    viewports = [each for each in window.screen.areas if each.type == "VIEW_3D"]
    return max(viewports, key=lambda each: each.width * each.height, default=None)


def show_tab(context: Context) -> None:
    """Open the tab in the context's viewport, or else in the largest of its window: it shows a
    capture's progress.
    """
    area = viewport_of(context)
    if area is None:
        return
    area.spaces.active.show_region_ui = True
    if not _choose_tab(area) and not bpy.app.background:
        pointer = area.as_pointer()
        bpy.app.timers.register(lambda: _choose_tab_later(pointer), first_interval=_DRAWN_AFTER_S)


def _choose_tab_later(pointer: int) -> None:
    """Choose the tab in the viewport at an address, if that is still open."""
    found = viewport_at(pointer)
    if found is not None and _choose_tab(found[1]):
        found[1].tag_redraw()


def _choose_tab(area: Area) -> bool:
    """Choose the tab in a viewport; False where Blender does not allow it, such as before the
    sidebar was drawn.
    """
    try:
        for sidebar in _sidebars(area):
            sidebar.active_panel_category = TAB
    except (AttributeError, TypeError):
        return False
    return True


def _sidebars(area: Area) -> list[Region]:
    return [region for region in area.regions if region.type == "UI"]


def is_over_tab(window: Window, event: Event) -> bool:
    """Return whether the mouse is over a sidebar of a 3D viewport that shows the tab Scope."""
    areas = [area for area in window.screen.areas if area.type == "VIEW_3D"]
    return any(
        0 <= event.mouse_x - sidebar.x < sidebar.width
        and 0 <= event.mouse_y - sidebar.y < sidebar.height
        and getattr(sidebar, "active_panel_category", TAB) == TAB
        for area in areas
        for sidebar in _sidebars(area)
        if sidebar.width > 1  # a hidden one is 1 pixel wide
    )


def redraw_sidebars() -> None:
    """Redraw the sidebars, but not the viewports, because redrawing a large scene repeatedly is
    slow.
    """
    for region in (sidebar for _, area in viewports() for sidebar in _sidebars(area)):
        region.tag_redraw()


def redraw_sidebars_twice() -> None:
    """Redraw now and again shortly: panels below one whose height changed move only at the second
    redraw.
    """
    redraw_sidebars()
    if not bpy.app.background:
        bpy.app.timers.register(redraw_sidebars, first_interval=_DRAWN_AFTER_S)


def viewports() -> list[tuple[Window, Area]]:
    """Return the viewports of all windows, each with its window."""
    windows = bpy.context.window_manager.windows
    return [
        (window, area)
        for window in windows
        for area in window.screen.areas
        if area.type == "VIEW_3D"
    ]


def main_region(area: Area) -> Region:
    """Return the region of an area that is neither header nor sidebar; every area has one."""
    return next(region for region in area.regions if region.type == "WINDOW")


def viewport_at(pointer: int) -> tuple[Window, Area] | None:
    """Return a viewport and its window; None once it was closed or became another editor.

    :param pointer: ``as_pointer`` of the viewport's area.
    """
    return next((pair for pair in viewports() if pair[1].as_pointer() == pointer), None)


def region_at(pointer: int) -> tuple[Area, Region] | None:
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

    def place(self, event: Event) -> tuple[int, int]:
        """Return where the mouse was at an event; every event of the tool has to be given, in their
        order.
        """
        if event.type in _MOVES:
            self._moved_to = event.mouse_x, event.mouse_y
        return self._moved_to or (event.mouse_x, event.mouse_y)
