# SPDX-License-Identifier: GPL-3.0-or-later
"""The same motion gives the same FBX file, whenever and by whichever process it is written."""

import pytest
from scope.scope_addon.scene.export.export import export_motions


def test_files_do_not_depend_on_the_time_or_on_hashes(body, make_motion, tmp_path, monkeypatch):
    """Blender's exporter numbers objects by hashes that every process salts; a salt here stands for a process."""
    motion, files = make_motion(body, 3), []
    for folder, salt in (("a", "first"), ("b", "second")):
        path = tmp_path / folder / "walk.fbx"
        path.parent.mkdir()
        export_motions([motion], body, tmp_path / "enables_the_exporter.fbx")
        utils = pytest.importorskip("io_scene_fbx.fbx_utils")
        original = utils._key_to_uuid
        monkeypatch.setattr(utils, "_key_to_uuid", lambda uuids, key, f=original, s=salt: f(uuids, (s, key)))
        export_motions([motion], body, path)
        monkeypatch.undo()
        files.append(path.read_bytes())
    assert files[0] == files[1]
