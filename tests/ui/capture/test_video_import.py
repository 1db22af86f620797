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
