# SPDX-License-Identifier: GPL-3.0-or-later
"""File > Import > Motion from Video captures the chosen file."""

import bpy
import pytest


def test_a_chosen_video_is_captured_under_the_name_of_the_take(fake_worker, footage):
    fake_worker("finish()")
    bpy.context.scene.scope.take = "first try"
    assert bpy.ops.scope.import_video(filepath=str(footage)) == {"FINISHED"}
    scene = bpy.context.scene
    assert scene.scope.footage == str(footage)
    assert scene.scope.result.collection.name == "first try"


def test_a_folder_is_an_error(tmp_path):
    with pytest.raises(RuntimeError, match="not a file"):
        bpy.ops.scope.import_video(filepath=str(tmp_path))


def test_where_nothing_can_be_captured_that_is_said_without_a_traceback(footage, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (there, here):
        here.scenes = there.scenes
    linked = next(scene for scene in bpy.data.scenes if scene.library)
    with (
        bpy.context.temp_override(scene=linked),
        pytest.raises(RuntimeError, match="linked from") as caught,
    ):
        bpy.ops.scope.import_video(filepath=str(footage))
    assert "Traceback" not in str(caught.value)
