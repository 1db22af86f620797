# SPDX-License-Identifier: GPL-3.0-or-later
"""All 3D viewports, and the sidebar of each with its tab Scope.

A viewport is found again by its address: Blender frees a closed area, and a reference to it then
crashes, so whatever runs later keeps the address alone.
"""

from __future__ import annotations

import bpy

TAB = "Scope"
_DRAWN_AFTER_S = 0.3  # a sidebar knows its tabs only after it has been drawn


def viewport_of(context: bpy.types.Context) -> bpy.types.Area | None:
    """Return the context's viewport, or else, as in a menu at the top, the largest of its
    window.
    """
    window = context.window
    area = context.area
    if window is None or (area is not None and area.type == "VIEW_3D"):
        return area if window is not None else None
    viewports = [each for each in window.screen.areas if each.type == "VIEW_3D"]
    return max(viewports, key=lambda each: each.width * each.height, default=None)


def show_tab(context: bpy.types.Context) -> None:
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


def _choose_tab(area: bpy.types.Area) -> bool:
    """Choose the tab in a viewport; False where Blender does not allow it, such as before the
    sidebar was drawn.
    """
    try:
        for sidebar in _sidebars(area):
            sidebar.active_panel_category = TAB
    except (AttributeError, TypeError):
        return False
    return True


def _sidebars(area: bpy.types.Area) -> list[bpy.types.Region]:
    return [region for region in area.regions if region.type == "UI"]


def is_over_tab(window: bpy.types.Window, event: bpy.types.Event) -> bool:
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


def viewports() -> list[tuple[bpy.types.Window, bpy.types.Area]]:
    """Return the viewports of all windows, each with its window."""
    windows = bpy.context.window_manager.windows
    return [
        (window, area)
        for window in windows
        for area in window.screen.areas
        if area.type == "VIEW_3D"
    ]


def main_region(area: bpy.types.Area) -> bpy.types.Region:
    """Return the region of an area that is neither header nor sidebar; every area has one."""
    return next(region for region in area.regions if region.type == "WINDOW")


def viewport_at(pointer: int) -> tuple[bpy.types.Window, bpy.types.Area] | None:
    """Return a viewport and its window; None once it was closed or became another editor.

    :param pointer: ``as_pointer`` of the viewport's area.
    """
    return next((pair for pair in viewports() if pair[1].as_pointer() == pointer), None)
