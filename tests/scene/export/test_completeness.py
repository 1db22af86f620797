# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that end too early, or lack a part, are not whole; what Blender writes is."""

import bpy
import pytest
from scope.scope_addon.scene.export.completeness import is_whole_blend, is_whole_crate
from scope.scope_addon.scene.export.export import export_motions

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
