# SPDX-License-Identifier: GPL-3.0-or-later
"""Nothing is added to a scene that is linked from another file."""

from pathlib import Path

import bpy
import pytest
import scope
from scope.scope_addon.errors import UsageError
from scope.scope_addon.scene.build import build_scene
from scope.scope_addon.scene.footage_strip import add_footage_strips

SAMPLE = Path(scope.__file__).resolve().parent / "assets" / "sample" / "sample.mp4"


@pytest.fixture
def linked(tmp_path):
    """A scene of another file, shown in the window."""
    path = str(tmp_path / "other.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    with bpy.data.libraries.load(path, link=True) as (there, here):
        here.scenes = list(there.scenes)
    bpy.context.window.scene = here.scenes[0]
    return here.scenes[0]


def test_a_motion_is_not_built_in_a_linked_scene(linked, body, make_motion):
    before = [len(blocks) for blocks in (bpy.data.objects, bpy.data.collections, bpy.data.actions)]
    with pytest.raises(UsageError, match=r"the scene is linked from .*other\.blend"):
        build_scene([make_motion(body, 12)], body)
    assert [
        len(blocks) for blocks in (bpy.data.objects, bpy.data.collections, bpy.data.actions)
    ] == before


def test_no_strip_is_added_to_a_linked_scene(linked):
    with pytest.raises(UsageError, match=r"use a scene of this file"):
        add_footage_strips(linked, SAMPLE, 1.0)
