# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports that fail: one sentence, no half-written file, and no earlier result lost."""

import ctypes
import os
import sys
import tempfile
from pathlib import Path

import bpy
import pytest
from scope.scope_addon.errors import OutputError, UsageError
from scope.scope_addon.output_paths import SUFFIXES, WITHOUT_SCENE
from scope.scope_addon.scene.export import formats
from scope.scope_addon.scene.export.export import export, export_motions
from scope.scope_addon.scene.export.without_scene import write_without_scene

SCENE_SUFFIXES = [suffix for suffix in SUFFIXES if suffix not in WITHOUT_SCENE]
NOBODY = 65534


@pytest.mark.skipif(os.name == "nt", reason="Windows counts letters, and those of the whole path")
@pytest.mark.parametrize("suffix", [".bvh", ".npz"])
def test_names_may_be_as_long_as_the_system_lets_them(body, make_motion, tmp_path, suffix):
    def write(people, path):
        motions = [make_motion(body, 1)] * people
        if suffix in WITHOUT_SCENE:
            write_without_scene(path, motions, [body] * people)
        else:
            export_motions(motions, body, path)

    longest = tmp_path / ("ä" * 125 + suffix)  # 254 bytes
    write(1, longest)
    assert list(tmp_path.iterdir()) == [longest]
    for people in (1, 2):
        too_long = tmp_path / ("x" * (252 if people == 1 else 245) + suffix)
        with pytest.raises(
            OutputError, match=f"cannot write .*x(.person1)?{suffix}: .*; choose a shorter name"
        ):
            write(people, too_long)
    assert list(tmp_path.iterdir()) == [longest]


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no such names")
def test_a_name_may_be_no_text(whole_body, make_motion, tmp_path, capfd):
    """Bytes that are not UTF-8, as old discs and archives have them, and ends of lines. Writers
    keep standard output clean.
    """
    capfd.readouterr()
    stem = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9\nforged"))
    paths = {suffix: stem.with_name(stem.name + suffix) for suffix in SUFFIXES}
    motion = make_motion(whole_body, 2)
    export_motions([motion], whole_body, [paths[suffix] for suffix in SCENE_SUFFIXES])
    for suffix in WITHOUT_SCENE:
        write_without_scene(paths[suffix], [motion], [whole_body])
        assert b"\nforged" not in paths[suffix].read_bytes()
    assert capfd.readouterr().out == ""
    assert sorted(tmp_path.iterdir()) == sorted(paths.values())


@pytest.fixture
def closed_folder():
    """A folder in which this process cannot write. Root, whom no mode bits stop, is nobody until
    the test ends.
    """
    # tmp_path lies in a folder that nobody else may enter
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        is_root = os.geteuid() == 0
        folder.chmod(0o555)
        if is_root:
            os.setresuid(NOBODY, NOBODY, 0)
        yield folder
        if is_root:
            os.setresuid(0, 0, 0)
        folder.chmod(0o700)


@pytest.mark.skipif(os.name == "nt", reason="Windows writes where the mode bits forbid it")
def test_an_unwritable_folder_is_named(body, make_motion, closed_folder):
    with pytest.raises(OutputError, match="not writable"):
        export_motions([make_motion(body, 1)], body, closed_folder / "walk.glb")
    assert list(closed_folder.iterdir()) == []


@pytest.mark.skipif(
    os.name == "nt", reason="Windows has no limit on a file's size that a process could set"
)
@pytest.mark.parametrize("suffix", SCENE_SUFFIXES)
def test_a_full_disk_is_reported_in_one_sentence_and_leaves_nothing(
    body, make_motion, tmp_path, suffix
):
    import resource

    path = tmp_path / f"walk{suffix}"
    motion = make_motion(body, 100)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        with pytest.raises(OutputError, match="cannot write .*walk") as raised:
            export_motions([motion], body, path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert "\n" not in str(raised.value)
    assert list(tmp_path.iterdir()) == []


def test_a_failing_writer_leaves_the_old_file_and_no_other(
    body, make_motion, tmp_path, monkeypatch
):
    path = tmp_path / "walk.usdc"
    path.write_text("before")

    def fail(temporary, *rest):
        temporary.write_text("half")
        raise RuntimeError("disk full")

    monkeypatch.setattr(formats, "write_usd", fail)
    with pytest.raises(OutputError, match="disk full"):
        export_motions([make_motion(body, 1)], body, path)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
    assert path.read_text("utf-8") == "before"
    assert [s.name for s in bpy.data.scenes] == ["Scene"]


@pytest.mark.skipif(os.name == "nt", reason="links need a permission there")
@pytest.mark.parametrize("suffix", [".glb", ".blend"])
def test_a_link_may_lead_to_a_file_without_a_suffix(body, make_motion, tmp_path, suffix):
    """As version control of large files makes them."""
    stored = tmp_path / "objects" / "5f2a"
    stored.parent.mkdir()
    path = tmp_path / f"walk{suffix}"
    path.symlink_to(stored)
    export_motions([make_motion(body, 1)], body, path)
    assert path.is_symlink()
    assert stored.stat().st_size > 1000
    assert list(stored.parent.iterdir()) == [stored]


class StoppedExporter(bpy.types.Operator):
    """An exporter in Python that is interrupted with Ctrl-C."""

    bl_idname = "scope_test.stopped"
    bl_label = "Stopped"

    def execute(self, context):
        raise KeyboardInterrupt


def test_ctrl_c_in_an_exporter_is_not_reported_as_a_failure(
    body, make_motion, tmp_path, monkeypatch
):
    monkeypatch.setattr(
        formats, "write_glb", lambda *rest: formats.call_operator(bpy.ops.scope_test.stopped)
    )
    bpy.utils.register_class(StoppedExporter)
    try:
        with pytest.raises(KeyboardInterrupt):
            export_motions([make_motion(body, 1)], body, tmp_path / "walk.glb")
    finally:
        bpy.utils.unregister_class(StoppedExporter)
    assert list(tmp_path.iterdir()) == []
    assert [s.name for s in bpy.data.scenes] == ["Scene"]


def test_a_scene_without_captures_cannot_be_exported(tmp_path):
    with pytest.raises(UsageError, match="no capture"):
        export(tmp_path / "walk.glb")


def test_exporters_are_quiet_without_standard_streams(monkeypatch):
    monkeypatch.setattr("sys.stdout", None)
    monkeypatch.setattr("sys.stderr", None)
    with formats.quiet():
        os.write(1, b"to nobody")


@pytest.mark.skipif(os.name == "nt", reason="C's streams have another library there")
def test_what_c_code_prints_while_it_is_quiet_is_not_printed_later(capfd):
    """Without a terminal, it stays in C's buffers, from where it was written behind the program's
    own output.
    """
    c = ctypes.CDLL(None)
    with formats.quiet():
        c.puts(b"said by an exporter")
    c.fflush(None)
    assert capfd.readouterr() == ("", "")
