# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera's frame fills what sidebars and toolbars leave of a viewport; a real Blender checks
it on the screen.

The side view shows everybody over the whole motion, and one person as large as ever.

Changes of the view after a capture.

A capture that is started from a menu opens the tab in which its progress is shown.
"""

import math
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.scene.character.root_object import move_root_motion_to_object
from scope.scope_addon.ui import comparison, viewports
from scope.scope_addon.ui.comparison import fit_frame, side_extent, unfit_frame
from scope.scope_addon.ui.view_operators import hide_startup_cube

from ...edit.walking import BODY, motion_of, walk

# As measured in a Blender 4.3: at zoom 0 and without an offset, a square frame in a viewport of
# 1322 x 876 is 661 wide.
HALF_AT_ZOOM_0 = (1322, 661)


def regions(width, height):
    sizes = [
        ("WINDOW", 500, 97, width, height),
        ("TOOLS", 500, 97, 58, height - 54),
        ("UI", 500 + width - 291, 97, 291, height - 54),
        ("HEADER", 500, 97 + height - 27, width, 27),
        ("TOOL_HEADER", 500, 97 + height - 54, width, 27),
        ("HUD", 0, 0, 1, 1),
    ]
    return [SimpleNamespace(type=t, x=x, y=y, width=w, height=h) for t, x, y, w, h in sizes]


def viewport(width, height):
    view = SimpleNamespace(view_camera_zoom=12.0, view_camera_offset=(0.1, 0.2))
    space = SimpleNamespace(region_3d=view)
    space.as_pointer = lambda: id(space)
    return SimpleNamespace(regions=regions(width, height), spaces=SimpleNamespace(active=space))


def scene(size):
    camera = bpy.data.cameras.new("camera")
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


# a level view along -x, in which the walk goes along -y
ALONG_X = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]], float)


def people(*clips):
    """Return the captured armatures of some clips."""
    motions = [motion_of(clip) for clip in clips]
    found = [person.armature for person in build_scene(motions, BODY, None, BuildOptions()).people]
    bpy.context.view_layer.update()
    return found


def test_one_person_is_shown_from_head_to_foot():
    (alone,) = people(walk(1.0))
    assert side_extent(alone, [alone], ALONG_X) == pytest.approx((1.0, 2.6))


def test_the_view_is_wide_enough_for_the_person_who_walks_away():
    """One stays, the other walks 1.2 m/s for 2 s."""
    first, second = people(walk(2.0, speed=0.0), walk(2.0))
    for followed in (first, second):
        width, height = side_extent(followed, [first, second], ALONG_X)
        assert width == pytest.approx(1.0 + 2 * 2.4, abs=0.05)
        assert height == pytest.approx(2.6, abs=0.05)
    second.matrix_world = Matrix.Translation((0.0, 0.0, 1.0)) @ second.matrix_world
    bpy.context.view_layer.update()
    assert side_extent(first, [first, second], ALONG_X)[1] == pytest.approx(4.6, abs=0.05)


@pytest.mark.parametrize("on_object", [False, True])
def test_people_of_a_scene_in_centimetres_are_shown_as_wide(on_object):
    found = people(walk(2.0, speed=0.0), walk(2.0))
    for person in found:
        person.scale = (100.0,) * 3
        if on_object:
            move_root_motion_to_object(person, BODY, 30.0, in_place=False, heading=True)
    bpy.context.view_layer.update()
    width, height = side_extent(found[0], found, ALONG_X)
    assert width == pytest.approx(100 * (1.0 + 2 * 2.4), abs=5)
    assert height == pytest.approx(260, abs=5)


def test_a_person_without_keys_does_not_prevent_the_view():
    first, second = people(walk(1.0), walk(1.0, speed=0.5))
    second.animation_data_clear()
    assert side_extent(first, [first, second], ALONG_X) == pytest.approx((1.0, 2.6))
    assert side_extent(second, [first, second], ALONG_X) == pytest.approx((1.0, 2.6))


@pytest.mark.parametrize("aspect", [0.4, 1.0, 2.5])
@pytest.mark.parametrize("shown", [(1.0, 2.6), (8.0, 2.6)])
def test_width_and_height_both_fit_into_a_viewport_of_any_shape(shown, aspect):
    span = comparison._span(shown, aspect)  # across the longer side
    size = (span, span / aspect) if aspect >= 1.0 else (span * aspect, span)
    assert size[0] >= shown[0] - 1e-9
    assert size[1] >= shown[1] - 1e-9
    assert size[0] == pytest.approx(shown[0]) or size[1] == pytest.approx(shown[1])


def cube(name="Cube", location=(0, 0, 0)):
    bpy.ops.mesh.primitive_cube_add(location=location)
    bpy.context.object.name = name
    return bpy.context.object


@pytest.fixture
def empty():
    bpy.ops.wm.read_factory_settings(use_empty=True)


def test_the_default_cube_is_hidden(empty):
    startup = cube()
    own = cube("Box")
    hide_startup_cube(bpy.context)
    assert startup.hide_get()
    assert startup.hide_render
    assert not own.hide_get()
    assert not own.hide_render


@pytest.mark.parametrize("touch", [
    lambda o: setattr(o, "location", (1, 0, 0)),
    lambda o: o.modifiers.new("bevel", "BEVEL"),
    lambda o: o.keyframe_insert("location"),
    lambda o: setattr(o, "name", "Die"),
])  # fmt: skip
def test_a_modified_cube_stays(empty, touch):
    startup = cube()
    touch(startup)
    bpy.context.view_layer.update()
    hide_startup_cube(bpy.context)
    assert not startup.hide_get()
    assert not startup.hide_render


def test_the_cube_of_a_saved_file_stays(empty, tmp_path):
    startup = cube()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "mine.blend"))
    hide_startup_cube(bpy.context)
    assert not startup.hide_get()
    assert not startup.hide_render


class Region:
    """A sidebar that knows its tabs only after it has been drawn."""

    type = "UI"

    def __init__(self, drawn):
        self.drawn = drawn
        self.tab = "Item"

    @property
    def active_panel_category(self):
        return self.tab if self.drawn else "UNSUPPORTED"

    @active_panel_category.setter
    def active_panel_category(self, tab):
        if not self.drawn:
            raise AttributeError("read-only")
        self.tab = tab


def area(kind="VIEW_3D", size=(800, 600), drawn=True):
    spaces = SimpleNamespace(active=SimpleNamespace(show_region_ui=False))
    regions = [SimpleNamespace(type="WINDOW"), Region(drawn)]
    found = SimpleNamespace(
        type=kind, width=size[0], height=size[1], spaces=spaces, regions=regions
    )
    found.as_pointer = lambda: id(found)
    found.tag_redraw = lambda: None
    return found


def context(areas, active=None):
    window = SimpleNamespace(screen=SimpleNamespace(areas=areas))
    return SimpleNamespace(window=window, area=active)


def test_the_tab_opens_in_the_largest_viewport_of_a_menu():
    menu = area("TOPBAR", (2000, 2000))
    small = area(size=(100, 100))
    large = area()
    viewports.show_tab(context([menu, small, large], menu))
    assert [each.spaces.active.show_region_ui for each in (menu, small, large)] == [
        False,
        False,
        True,
    ]
    assert large.regions[1].tab == "Scope"
    assert viewports.viewport_of(context([small, large], small)) is small  # where a file is dropped


def test_without_a_viewport_or_before_the_first_drawing_nothing_fails():
    viewports.show_tab(context([area("TOPBAR")]))
    viewports.show_tab(SimpleNamespace(window=None, area=None))
    new = area(drawn=False)
    viewports.show_tab(context([new]))
    assert new.spaces.active.show_region_ui
