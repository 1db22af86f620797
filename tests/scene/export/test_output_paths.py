# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of exports are checked before anything is captured, and no file is written for the check.

Files that end too early, or lack a part, are not whole; what Blender writes is.
"""

import os
import subprocess
import sys

import bpy
import pytest
from scope.scope_addon.errors import OutputError, UsageError
from scope.scope_addon.output_paths import check_output, person_paths
from scope.scope_addon.scene.export.export import export_motions
from scope.scope_addon.scene.export.formats import is_whole_blend, is_whole_crate


def test_the_check_needs_no_blender():
    code = "import sys, scope.scope_addon.output_paths; sys.exit('bpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_what_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder.glb").mkdir()
    (tmp_path / "link.glb").symlink_to(tmp_path / "gone" / "walk.glb")
    refused = (
        ("walk.mp4", UsageError, "suffix must be one of .glb"),
        ("walk", UsageError, "suffix must be one of .glb"),
        ("folder", UsageError, "it is a folder; name a file in it"),
        ("folder.glb", OutputError, "a folder of that name exists"),
        ("nowhere/walk.glb", OutputError, "nowhere does not exist"),
        ("link.glb", OutputError, "a link into"),
        ("w" * 300 + ".glb", OutputError, "too long"),
    )
    for name, error, message in refused:
        with pytest.raises(error, match=f"(?i){message}"):
            check_output(tmp_path / name)


def test_the_check_writes_nothing(tmp_path):
    for name in ("walk.glb", "walk.FBX", "walk.npz"):
        assert check_output(str(tmp_path / name)) == tmp_path / name
    assert os.listdir(tmp_path) == []


def test_people_get_files_of_their_own_where_a_format_has_one_person(tmp_path):
    files = (
        ("a.b.bvh", 1, True, ["a.b.bvh"]),
        ("a.b.bvh", 2, False, ["a.b.person1.bvh", "a.b.person2.bvh"]),
        ("a.NPZ", 2, False, ["a.person1.NPZ", "a.person2.NPZ"]),
        ("a.glb", 2, False, ["a.glb"]),
        ("a.glb", 2, True, ["a.person1.glb", "a.person2.glb"]),
    )
    for name, people, separate, expected in files:
        paths = [tmp_path / path for path in expected]
        assert person_paths(tmp_path / name, people, separate) == paths


CHECKS = {".blend": is_whole_blend, ".usdc": is_whole_crate}


@pytest.fixture(params=CHECKS)
def exported(request, body, make_motion, tmp_path):
    path = tmp_path / f"walk{request.param}"
    export_motions([make_motion(body, 1)], body, path)
    return path


def test_only_the_whole_file_is_whole(exported):
    is_whole = CHECKS[exported.suffix]
    content = exported.read_bytes()
    assert is_whole(exported)
    half = len(content) // 2
    for damaged in (
        b"",
        content[:10],
        content[:half],
        content[:-1],
        content[: half - 4096] + content[half:],  # one write is missing
        content[4096:],
    ):
        exported.write_bytes(damaged)
        assert not is_whole(exported), len(damaged)


@pytest.mark.parametrize("compress", [False, True])
def test_checking_leaves_the_session_as_it_was(tmp_path, compress):
    path = tmp_path / "some.blend"
    bpy.data.libraries.write(str(path), {bpy.context.scene}, compress=compress)
    before = [len(kind) for kind in (bpy.data.libraries, bpy.data.scenes, bpy.data.objects)]
    assert is_whole_blend(path)
    path.write_bytes(path.read_bytes()[:-5000])
    assert not is_whole_blend(path)
    assert [len(kind) for kind in (bpy.data.libraries, bpy.data.scenes, bpy.data.objects)] == before
