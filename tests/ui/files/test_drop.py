# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that are dropped into a viewport: footage and motions.

Where an operator writes a file whose name the user has entered.
"""

import os

import bpy
import pytest
from scope.scope_addon.ui import file_field

from ...edit.walking import motion_of, walk
from ...scene.made_rigs import build_rig, captured


def test_dropped_files_become_the_footage(footage):
    motions = file_field.SCOPE_FH_motion
    assert (motions.bl_file_extensions, motions.bl_import_operator) == (
        ".npz",
        "scope.import_motion",
    )
    suffixes = file_field.SCOPE_FH_footage.bl_file_extensions.split(";")
    assert {".mp4", ".mov", ".png", ".jpg"} <= set(suffixes)
    # What Blender does with a dropped file: the handler's operator, with a path.
    assert bpy.ops.scope.choose_footage("INVOKE_DEFAULT", filepath=str(footage)) == {"FINISHED"}
    assert bpy.context.scene.scope.footage == str(footage)
    with pytest.raises(RuntimeError, match="not a file"):
        bpy.ops.scope.choose_footage(filepath=str(footage.parent))
    assert bpy.context.scene.scope.footage == str(footage)


def test_nothing_is_written_into_the_current_folder(tmp_path, monkeypatch):
    captured(motion_of(walk(0.2)))
    bpy.context.scene.scope_retarget.rig = build_rig("unreal")[0]
    bpy.ops.scope.guess_bones()
    monkeypatch.chdir(tmp_path)
    for write in (
        lambda: bpy.ops.scope.export(filepath="//walk.bvh", format="BVH"),
        lambda: bpy.ops.scope.save_bone_map(filepath="//bones.json"),
    ):
        with pytest.raises(RuntimeError, match="was never saved"):
            write()
    assert os.listdir(tmp_path) == []
