# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder of a capture stays when it is killed or cancelled, and is removed when it is finished,
or old.
"""

from __future__ import annotations

import os
import time
from contextlib import suppress

import pytest
from scope.scope_addon.errors import ChangedFootageError, NoPersonError
from scope.scope_addon.job import unfinished
from scope.scope_addon.job.cache import Cache
from scope.scope_addon.job.unfinished import FOLDER, unfinished_capture
from scope.scope_addon.temporary import hold, release


def name_of(digit):
    """A name that a folder of ours may have."""
    return f"{digit}" * 32 + "-" + "0" * 32


@pytest.fixture
def footage(tmp_path):
    path = tmp_path / "walk.mp4"
    path.write_text("footage")
    return path


def end(root, footage, error=None):
    """Write something in a capture's folder, end the capture, and return the folder."""
    try:
        with unfinished_capture(root, footage) as capture:
            folder = capture.folder
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "0.npz").write_text("estimates")
            if error is not None:
                raise error
    except (NoPersonError, KeyboardInterrupt):
        pass
    return folder


@pytest.mark.parametrize("error", [None, NoPersonError("nobody")])
def test_a_finished_capture_leaves_nothing(tmp_path, footage, error):
    end(tmp_path / "caches", footage, error)
    assert list((tmp_path / "caches").iterdir()) == []


def test_an_interrupted_capture_is_continued_until_the_footage_changes(tmp_path, footage):
    first = end(tmp_path, footage, KeyboardInterrupt())
    assert (first / "0.npz").is_file()
    with unfinished_capture(tmp_path, footage) as capture:
        assert (capture.folder, capture.warnings) == (first, [])
    assert not first.exists()


def test_a_capture_of_another_version_is_not_continued(tmp_path, footage, monkeypatch):
    first = end(tmp_path, footage, KeyboardInterrupt())
    monkeypatch.setattr(unfinished, "code_version", lambda: "another")
    with unfinished_capture(tmp_path, footage) as capture:
        assert capture.folder not in (None, first)


def written_again(path, content):
    """Replace a file's content in place, and leave its size and time."""
    before = path.stat()
    path.write_bytes(content)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert (path.stat().st_size, path.stat().st_mtime_ns) == (before.st_size, before.st_mtime_ns)


def test_other_content_of_the_same_size_and_time_is_not_continued_and_that_is_said(
    tmp_path, footage
):
    size = 3 << 20
    footage.write_bytes(bytes(size))
    first = end(tmp_path, footage, KeyboardInterrupt())
    changed = bytearray(size)
    changed[size // 2] = 1
    written_again(footage, changed)
    with unfinished_capture(tmp_path, footage) as capture:
        assert capture.folder != first
        assert not first.exists()
        (warning,) = capture.warnings
        assert str(warning).startswith("walk.mp4 has been changed since a capture of it was stop")
    with unfinished_capture(tmp_path, footage) as capture:
        assert capture.warnings == []


@pytest.mark.parametrize("change", ["content", "added", "removed", "renamed", "exchanged"])
@pytest.mark.parametrize("name", ["frames", "frames/f_1.png"])
def test_other_pictures_are_not_continued(tmp_path, change, name):
    frames = tmp_path / "frames"
    frames.mkdir()
    pictures = [frames / f"f_{k}.png" for k in range(1, 6)]
    for k, picture in enumerate(pictures):
        picture.write_bytes(b"picture %d" % k)
    footage = tmp_path / name

    def stopped(root, error=None):
        with suppress(KeyboardInterrupt), unfinished_capture(root, footage, True) as capture:
            capture.folder.mkdir(parents=True, exist_ok=True)
            raise error or KeyboardInterrupt
        return capture

    first = stopped(tmp_path / "caches")
    assert stopped(tmp_path / "caches").folder == first.folder
    (frames / "notes.txt").write_text("no picture")  # such as a result beside them
    assert stopped(tmp_path / "caches").folder == first.folder
    time_ns = frames.stat().st_mtime_ns
    if change == "content":
        written_again(pictures[3], b"picture X")
    elif change == "added":
        (frames / "f_6.png").write_bytes(b"picture 6")
    elif change == "removed":
        pictures[-1].unlink()
    elif change == "renamed":
        pictures[-1].rename(frames / "f_7.png")
    else:
        written_again(pictures[1], b"picture 2")
        written_again(pictures[2], b"picture 1")
    os.utime(frames, ns=(time_ns, time_ns))
    again = stopped(tmp_path / "caches")
    assert again.folder != first.folder
    assert len(again.warnings) == 1
    assert not first.folder.exists()


def test_what_is_no_file_is_not_read(tmp_path):
    """A pipe would wait for a writer."""
    os.mkfifo(tmp_path / "pipe.mp4")
    for name in ("pipe.mp4", "missing.mp4", "."):
        with unfinished_capture(tmp_path / "caches", tmp_path / name) as capture:
            capture.footage.check()


def replaced(path):
    path.with_name("new").write_bytes(b"x" * 100)
    path.with_name("new").replace(path)


CHANGES = {
    "written": lambda path: path.write_bytes(bytes(reversed(path.read_bytes()))),
    "replaced": replaced,
    "shortened": lambda path: os.truncate(path, 10),
    "removed": lambda path: path.unlink(),
    "longer, and other": lambda path: path.write_bytes(b"y" * 300),
}


@pytest.mark.parametrize("change", CHANGES)
def test_footage_that_is_changed_while_it_is_read_is_noticed_and_nothing_of_it_kept(
    tmp_path, footage, change
):
    footage.write_bytes(b"0123456789" * 10)
    folders = []

    def capture():
        with unfinished_capture(tmp_path / "caches", footage) as capture:
            folders.append(capture.folder)
            capture.footage.check()
            capture.folder.mkdir(parents=True)
            report = capture.footage.watched(lambda *_: None, to_end=True)
            report(1, 2)
            CHANGES[change](footage)
            report(2, 2)

    with pytest.raises(ChangedFootageError, match="was changed while it was read"):
        capture()
    assert not folders[0].exists()


def test_a_video_that_only_grows_stays_the_same(tmp_path, footage):
    """As one that is still being recorded, which has a warning of its own."""
    footage.write_bytes(b"0123456789" * 10)
    with unfinished_capture(tmp_path, footage) as capture:
        with footage.open("ab") as file:
            file.write(b"more")
        capture.footage.check()


def test_the_lock_of_a_killed_capture_without_a_folder_is_removed_by_the_next_one(
    tmp_path, footage
):
    folder = tmp_path / "caches" / FOLDER
    folder.mkdir(parents=True)
    (folder / f"{name_of(1)}.lock").touch()
    held = folder / f"{name_of(2)}.lock"
    assert hold(held)
    others = [folder / "mine.lock", folder / f"{name_of(3)}.lock"]
    others[0].touch()
    others[1].write_text("not empty, so no lock of ours")
    with unfinished_capture(tmp_path / "caches", footage):
        assert sorted(path for path in others if path.exists()) == sorted(others)
        assert held.exists()
        assert not (folder / f"{name_of(1)}.lock").exists()
    release(held)


def test_what_is_old_or_too_much_is_removed(tmp_path, footage, monkeypatch):
    folders = [tmp_path / FOLDER / name_of(digit) for digit in range(3)]
    for folder, age_s, inner_s in zip(
        folders, (3600, 86400, 30 * 86400), (3600, 0, 30 * 86400), strict=True
    ):
        windows = folder / "windows-0"
        windows.mkdir(parents=True)
        (windows / "window00000.npz").write_bytes(bytes(1000))
        for path, age in ((windows, inner_s), (folder, age_s)):
            os.utime(path, (time.time() - age,) * 2)
    end(tmp_path, footage)
    assert [folder.exists() for folder in folders] == [True, True, False]
    monkeypatch.setattr(unfinished, "_LARGEST", 1500)
    end(tmp_path, footage)
    assert [folder.exists() for folder in folders] == [False, True, False]


def test_the_same_capture_twice_at_once_is_kept_by_the_first_alone(tmp_path, footage):
    with unfinished_capture(tmp_path, footage) as first:
        first.folder.mkdir(parents=True)
        with unfinished_capture(tmp_path, footage) as second:
            assert second.folder is None
        assert Cache(tmp_path).clear() == 0
        assert first.folder.is_dir()
    assert list(tmp_path.iterdir()) == [footage]


def test_a_running_capture_is_neither_too_much_nor_too_old_nor_one_of_other_content(
    tmp_path, footage, monkeypatch
):
    monkeypatch.setattr(unfinished, "_LARGEST", 10)
    other = tmp_path / "run.mp4"
    other.write_text("other footage")
    with unfinished_capture(tmp_path, footage) as first:
        first.folder.mkdir(parents=True)
        (first.folder / "0.npz").write_bytes(bytes(1000))
        os.utime(first.folder, (time.time() - 30 * 86400,) * 2)
        end(tmp_path, other)
        footage.write_text("changed")
        with unfinished_capture(tmp_path, footage) as second:
            assert second.folder not in (None, first.folder)
            assert second.warnings == []
        assert (first.folder / "0.npz").is_file()
    end(tmp_path, other, KeyboardInterrupt())
    monkeypatch.setattr(unfinished, "_ABANDONED_S", -1.0)
    end(tmp_path, footage)
    assert not (tmp_path / FOLDER).exists()


def test_clearing_the_cache_removes_it(tmp_path, footage):
    folder = end(tmp_path, footage, KeyboardInterrupt())
    cache = Cache(tmp_path)
    assert cache.size() == cache.clear() > 0
    assert not folder.exists()
