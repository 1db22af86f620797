# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera's frame fills what sidebars and toolbars leave of a viewport; a real Blender checks it
on the screen.
"""

import math
from types import SimpleNamespace

import bpy
import pytest
from scope.scope_addon.ui.view.frame_fit import fit_frame, unfit_frame

# As measured in a Blender 4.3: at zoom 0 and without an offset, a square frame in a viewport of
# 1322 x 876 is 661 wide.
HALF_AT_ZOOM_0 = (1322, 661)


def regions(width, height, tools=58, sidebar=291, headers=54):
    sizes = [
        ("WINDOW", 500, 97, width, height),
        ("TOOLS", 500, 97, tools, height - headers),
        ("UI", 500 + width - sidebar, 97, sidebar, height - headers),
        ("HEADER", 500, 97 + height - headers // 2, width, headers // 2),
        ("TOOL_HEADER", 500, 97 + height - headers, width, headers // 2),
        ("HUD", 0, 0, 1, 1),
    ]
    return [SimpleNamespace(type=t, x=x, y=y, width=w, height=h) for t, x, y, w, h in sizes]


def viewport(width, height, **given):
    view = SimpleNamespace(view_camera_zoom=12.0, view_camera_offset=(0.1, 0.2))
    space = SimpleNamespace(region_3d=view)
    space.as_pointer = lambda: id(space)
    return SimpleNamespace(
        regions=regions(width, height, **given), spaces=SimpleNamespace(active=space)
    )


def scene(size, fit="AUTO"):
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit = fit
    bpy.context.scene.camera = bpy.data.objects.new("camera", camera)
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = size
    return bpy.context.scene


def frame_of(area, size):
    """Return left, right, bottom and top of the frame in the region, for a sensor that is fitted
    automatically.
    """
    view = area.spaces.active.region_3d
    region = area.regions[0]
    scale = ((math.sqrt(2) + view.view_camera_zoom / 50) / math.sqrt(2)) ** 2
    longer = scale * HALF_AT_ZOOM_0[1] / HALF_AT_ZOOM_0[0] * max(region.width, region.height)
    width, height = (longer * side / max(size) for side in size)
    x = region.width / 2 - view.view_camera_offset[0] * scale * region.width
    y = region.height / 2 - view.view_camera_offset[1] * scale * region.height
    return x - width / 2, x + width / 2, y - height / 2, y + height / 2


@pytest.mark.parametrize("size", [(576, 576), (1920, 1080), (1080, 1920)])
@pytest.mark.parametrize("viewport_size", [(1322, 876), (831, 876), (600, 900)])
def test_the_whole_frame_is_visible_and_as_large_as_fits(size, viewport_size):
    area = viewport(*viewport_size)
    fit_frame(scene(size), area)
    left, right, bottom, top = frame_of(area, size)
    free = 58, viewport_size[0] - 291, 0, viewport_size[1] - 54
    assert free[0] < left < right < free[1]
    assert free[2] < bottom < top < free[3]
    assert max(
        (right - left) / (free[1] - free[0]), (top - bottom) / (free[3] - free[2])
    ) == pytest.approx(0.94)


def test_the_former_view_returns():
    area = viewport(1322, 876)
    view = area.spaces.active.region_3d
    for size in ((1920, 1080), (576, 576)):
        fit_frame(scene(size), area)
    assert view.view_camera_zoom != 12.0
    unfit_frame(area.spaces.active)
    assert (view.view_camera_zoom, view.view_camera_offset) == (12.0, (0.1, 0.2))


def test_a_viewport_that_is_nearly_covered_is_used_as_a_whole():
    area = viewport(360, 876)
    fit_frame(scene((576, 576)), area)
    left, right, _, _ = frame_of(area, (576, 576))
    assert (left, right) == pytest.approx((360 * 0.03, 360 * 0.97))
