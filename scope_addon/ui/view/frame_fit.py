# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitting a camera's frame into the part of a viewport that no sidebar or toolbar covers.

Seen through a camera, a viewport of ``w`` × ``h`` pixels at zoom ``z`` shows the sensor ``f ·
max(w, h)`` pixels long, with ``f = (√2 + z / 50)² / 4``, and the offset ``(dx, dy)`` moves the
frame by ``-2 f (dx · w, dy · h)`` pixels. A sensor that is fitted horizontally or vertically has
``w`` or ``h`` in place of ``max(w, h)``.
"""

from __future__ import annotations

import math

import bpy

_FILLED = 0.94  # of the visible part
_ZOOMS = (-30.0, 600.0)  # Blender's limits
# by viewport: zoom and offset before the first fit
_former: dict[int, tuple[float, tuple[float, float]]] = {}


def fit_frame(scene: bpy.types.Scene, area: bpy.types.Area) -> None:
    """Zoom and move a viewport's camera view so that the whole frame of the scene's camera is
    visible.
    """
    region = next((each for each in area.regions if each.type == "WINDOW"), None)
    camera = scene.camera
    space = area.spaces.active
    if (
        region is None
        or camera is None
        or camera.type != "CAMERA"
        or min(region.width, region.height) < 2
    ):
        return
    left, right, bottom, top = _visible(area, region)
    render = scene.render
    size = render.resolution_x * render.pixel_aspect_x, render.resolution_y * render.pixel_aspect_y
    width, height = _frame_at_one(camera.data.sensor_fit, size, (region.width, region.height))
    factor = _FILLED * min((right - left) / width, (top - bottom) / height)
    view = space.region_3d
    _former.setdefault(space.as_pointer(), (view.view_camera_zoom, tuple(view.view_camera_offset)))
    zoom = 50.0 * (math.sqrt(4.0 * max(factor, 0.0)) - math.sqrt(2.0))
    view.view_camera_zoom = min(max(zoom, _ZOOMS[0]), _ZOOMS[1])
    factor = (math.sqrt(2.0) + view.view_camera_zoom / 50.0) ** 2 / 4.0
    view.view_camera_offset = (
        -((left + right - region.width) / 2.0) / (2.0 * factor * region.width),
        -((bottom + top - region.height) / 2.0) / (2.0 * factor * region.height),
    )


def unfit_frame(space: bpy.types.SpaceView3D) -> None:
    """Restore the zoom and offset from before the first fit."""
    if (former := _former.pop(space.as_pointer(), None)) is not None:
        space.region_3d.view_camera_zoom, space.region_3d.view_camera_offset = former


def _frame_at_one(
    fit: str, size: tuple[float, float], region: tuple[int, int]
) -> tuple[float, float]:
    """Return the width and height of the frame, pixels, where the sensor is as long as the
    viewport.
    """
    horizontal = fit == "HORIZONTAL" or (fit == "AUTO" and size[0] >= size[1])
    along = {"HORIZONTAL": region[0], "VERTICAL": region[1]}.get(fit, max(region))
    scale = along / (size[0] if horizontal else size[1])
    return size[0] * scale, size[1] * scale


def _visible(area: bpy.types.Area, region: bpy.types.Region) -> tuple[float, float, float, float]:
    """Return the left, right, bottom and top of what no other region covers, in pixels of the
    viewport's region.
    """
    left = 0.0
    right = float(region.width)
    bottom = 0.0
    top = float(region.height)
    for other in area.regions:
        if min(other.width, other.height) < 2:  # hidden
            continue
        x = other.x - region.x
        y = other.y - region.y
        if other.type == "TOOLS":
            left = max(left, x + other.width)
        elif other.type == "UI":
            right = min(right, x)
        elif other.type in ("HEADER", "TOOL_HEADER") and y > region.height / 2:
            top = min(top, y)
        elif other.type in ("HEADER", "TOOL_HEADER"):
            bottom = max(bottom, y + other.height)
    wide_enough = right - left > 0.2 * region.width and top - bottom > 0.2 * region.height
    return (
        (left, right, bottom, top)
        if wide_enough
        else (0.0, float(region.width), 0.0, float(region.height))
    )
