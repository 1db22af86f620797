# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes of the view after a capture."""

import bpy
import pytest
from scope.scope_addon.ui.view.view_operators import hide_startup_cube


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
    assert not own.hide_get()


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


def test_the_cube_of_a_saved_file_stays(empty, tmp_path):
    startup = cube()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "mine.blend"))
    hide_startup_cube(bpy.context)
    assert not startup.hide_get()
