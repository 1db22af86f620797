# SPDX-License-Identifier: GPL-3.0-or-later
"""Files are complete or absent, links stay links, and what is not a regular file is not
replaced.
"""

from __future__ import annotations

import errno
import os
import socket
import tracemalloc

import numpy as np
import pytest
from scope.scope_addon import atomic_write
from scope.scope_addon.atomic_write import atomic_path, write_npz
from scope.scope_addon.errors import OutputError
from scope.scope_addon.output_paths import check_output


def write(path, text="new"):
    with atomic_path(path) as temporary:
        temporary.write_text(text)


@pytest.fixture
def link(tmp_path):
    """A link to a file that does not exist yet, in another folder: results are to be stored on
    another disk.
    """
    (tmp_path / "disk").mkdir()
    path = tmp_path / "walk.npz"
    path.symlink_to("disk/kept.npz")
    return path


@pytest.mark.parametrize("earlier", [None, "earlier"])
def test_a_link_stays_and_its_target_is_written(link, tmp_path, earlier):
    target = tmp_path / "disk" / "kept.npz"
    if earlier:
        target.write_text(earlier)
    write(check_output(link))
    assert link.is_symlink()
    assert target.read_text("utf-8") == "new"
    assert os.listdir(target.parent) == ["kept.npz"]


def test_a_link_to_a_link_stays_too(link, tmp_path):
    second = tmp_path / "disk" / "second.npz"
    second.symlink_to(link)
    write(second)
    assert second.is_symlink()
    assert link.is_symlink()
    assert (tmp_path / "disk" / "kept.npz").read_text("utf-8") == "new"


def test_a_failure_keeps_the_target_of_a_link(link, tmp_path):
    target = tmp_path / "disk" / "kept.npz"
    target.write_text("earlier")
    with pytest.raises(TypeError), atomic_path(link) as temporary:
        temporary.write_text(b"no text")
    assert link.is_symlink()
    assert target.read_text("utf-8") == "earlier"
    assert sorted(os.listdir(tmp_path)) == ["disk", "walk.npz"]
    assert os.listdir(target.parent) == ["kept.npz"]


def test_a_failure_leaves_no_draft_either(tmp_path):
    def fail(temporary):
        for draft in (f"{temporary.name}@", f"{temporary.stem}.pqSxDJ"):
            (tmp_path / draft).write_text("half")
        temporary.write_text(b"no text")

    with pytest.raises(TypeError), atomic_path(tmp_path / "walk.blend") as temporary:
        fail(temporary)
    assert os.listdir(tmp_path) == []


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such permissions")
@pytest.mark.parametrize(("mask", "replaces"), [(0o077, False), (0o002, True)])
def test_a_file_has_the_permissions_of_any_new_one_and_the_umask_is_left_alone(
    tmp_path, monkeypatch, mask, replaces
):
    """Every change of the umask affects the files that other threads create meanwhile."""
    before = os.umask(mask)
    changes = []
    try:
        with monkeypatch.context() as patch:
            patch.setattr(os, "umask", changes.append)
            with atomic_path(tmp_path / "walk.npz") as temporary:
                if replaces:  # as exporters do
                    temporary.unlink()
                    os.close(os.open(temporary, os.O_CREAT | os.O_WRONLY, 0o600))
        (tmp_path / "other.npz").write_text("")
    finally:
        os.umask(before)
    assert (tmp_path / "walk.npz").stat().st_mode == (tmp_path / "other.npz").stat().st_mode
    assert not changes


def test_other_hidden_files_of_that_name_stay(tmp_path):
    (tmp_path / ".walk.settings").write_text("kept")
    write(tmp_path / "walk")
    assert sorted(os.listdir(tmp_path)) == [".walk.settings", "walk"]


def test_a_link_into_a_missing_folder_is_an_error_before_the_capture(link, tmp_path):
    (tmp_path / "disk").rmdir()
    with pytest.raises(OutputError, match="disk, which does not exist"):
        check_output(link)


def test_circular_links_are_an_error(tmp_path):
    path = tmp_path / "walk.npz"
    path.symlink_to(path)
    for refused in (check_output, write):
        with pytest.raises(OutputError, match="form a loop"):
            refused(path)


def make_pipe(path):
    os.mkfifo(path)


def make_socket(path):
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(path))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows keeps its pipes in no folder")
@pytest.mark.parametrize("linked", [False, True])
@pytest.mark.parametrize("make", [make_pipe, make_socket, os.mkdir])
def test_folders_pipes_and_sockets_are_neither_written_nor_replaced(
    tmp_path, monkeypatch, make, linked
):
    monkeypatch.chdir(tmp_path)  # a socket's name has to be short
    other = tmp_path / "other"
    make(other.relative_to(tmp_path))
    path = tmp_path / "walk.npz"
    if linked:
        path.symlink_to(other)
    else:
        other.rename(path)
    before = path.stat()
    for refused in (check_output, write):
        with pytest.raises(
            OutputError, match="is a device, a pipe or a socket|is a folder|a folder of that name"
        ):
            refused(path)
    assert path.stat() == before
    assert path.is_symlink() == linked


@pytest.mark.skipif(not os.path.exists("/dev/null"), reason="Windows has no such device")
def test_writing_to_a_device_is_an_error(tmp_path):
    path = tmp_path / "walk.npz"
    path.symlink_to("/dev/null")
    with pytest.raises(OutputError, match="it is a link to /dev/null, and that is a device"):
        check_output(path)


@pytest.mark.parametrize(("compressed", "save"), [(False, np.savez), (True, np.savez_compressed)])
@pytest.mark.parametrize("piece", [1, 1 << 23])
def test_an_archive_is_numpys_own_however_it_is_written(
    tmp_path, monkeypatch, compressed, save, piece
):
    monkeypatch.setattr(atomic_write, "_PIECE", piece)
    grid = np.arange(6000.0).reshape(60, 100)
    arrays = {
        "grid": grid,
        "fortran": np.asfortranarray(grid),
        "part": grid[::3, 5:],
        "names": np.array(["left_hip", "é"]),
        "text": np.array("walk"),
        "none": np.zeros((0, 3), np.float32),
    }
    save(tmp_path / "expected.npz", **arrays)
    write_npz(tmp_path / "walk.npz", arrays, compressed)
    assert (tmp_path / "walk.npz").read_bytes() == (tmp_path / "expected.npz").read_bytes()


def test_an_archive_is_not_held_in_memory(tmp_path):
    arrays = {f"a{k}": np.full(1 << 22, k, np.uint8) for k in range(16)}
    tracemalloc.start()
    write_npz(tmp_path / "walk.npz", arrays)
    highest = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (tmp_path / "walk.npz").stat().st_size > 1 << 26
    assert highest < 1 << 25


def test_an_archive_that_the_disk_refuses_is_one_error(tmp_path, monkeypatch, capfd):
    """Nothing is printed when the archive is destroyed, and the earlier file stays."""
    path = tmp_path / "walk.npz"
    path.write_bytes(b"earlier")
    monkeypatch.setattr(atomic_write, "_PIECE", 1)

    def full_disk(self, file):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic_write._MovedFile, "move_to", full_disk)
    with pytest.raises(OSError, match="No space left"):
        write_npz(path, {"a": np.zeros(3), "b": np.ones(3)})
    assert path.read_bytes() == b"earlier"
    assert os.listdir(tmp_path) == ["walk.npz"]
    assert capfd.readouterr().err == ""


@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="needs the names of open files")
def test_content_and_name_are_on_the_disk_before_success_is_said(tmp_path, monkeypatch):
    """Without a sync before the rename, a power cut leaves an empty file; without one of the lock's
    name before the content's, a temporary file that nobody removes.
    """
    done = []
    real_sync = os.fsync
    real_replace = os.replace

    def fsync(handle):
        name = os.path.basename(os.readlink(f"/proc/self/fd/{handle}"))
        size = os.fstat(handle).st_size if name.startswith(".walk.scope-") else None
        done.append(("sync", name, size))
        real_sync(handle)

    def replace(source, target):
        done.append(("rename", os.path.basename(source), os.path.basename(target)))
        real_replace(source, target)

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(os, "replace", replace)
    write(tmp_path / "walk.txt", "whole")
    temporary = done[1][1]
    assert done == [
        ("sync", tmp_path.name, None),
        ("sync", temporary, 5),
        ("rename", temporary, "walk.txt"),
        ("sync", tmp_path.name, None),
    ]


def test_a_disk_that_refuses_at_the_sync_leaves_the_earlier_file(tmp_path, monkeypatch):
    path = tmp_path / "walk.txt"
    path.write_text("earlier")

    def fsync(handle):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", fsync)
    with pytest.raises(OSError, match="Input/output error"):
        write(path)
    assert path.read_text() == "earlier"
    assert os.listdir(tmp_path) == ["walk.txt"]


def test_a_file_that_nobody_needs_after_a_power_cut_does_not_wait_for_the_disk(
    tmp_path, monkeypatch
):
    def fsync(handle):
        raise AssertionError("waits for the disk")

    monkeypatch.setattr(os, "fsync", fsync)
    with atomic_path(tmp_path / "preview.rgb", durable=False) as temporary:
        temporary.write_text("picture")
    assert os.listdir(tmp_path) == ["preview.rgb"]
