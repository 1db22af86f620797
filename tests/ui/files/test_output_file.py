# SPDX-License-Identifier: GPL-3.0-or-later
"""Where an operator writes a file whose name the user has entered."""

import os
from pathlib import Path

import bpy
import pytest
from scope.scope_addon.errors import UsageError
from scope.scope_addon.ui.files.output_file import output_file

from ...edit.walking import motion_of, walk
from ...scene.made_rigs import build_rig, captured


def test_the_suffix_is_added_and_a_name_is_required(tmp_path):
    assert output_file(str(tmp_path / "walk"), ".fbx") == output_file(
        str(tmp_path / "walk.fbx"), ".fbx"
    )
    for nameless in ("", "//", ".fbx", str(tmp_path / ".fbx")):
        with pytest.raises(UsageError, match="the file has no name"):
            output_file(nameless, ".fbx")


def test_a_path_beside_the_blend_file_needs_one(tmp_path):
    with pytest.raises(
        UsageError,
        match=r"'//walk\.fbx' is relative to this \.blend file, which "
        r"was never saved",
    ):
        output_file("//walk.fbx", ".fbx")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "shot.blend"))
    assert output_file("//walk.fbx", ".fbx") == Path(tmp_path / "walk.fbx")


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
