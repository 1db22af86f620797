# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder of a capture stays when it is killed or cancelled, and is removed when it is finished,
or old.
"""

from __future__ import annotations

import os
import time

import pytest
from scope.scope_addon.errors import NoPersonError
from scope.scope_addon.job import unfinished
from scope.scope_addon.job.cache import Cache
from scope.scope_addon.job.unfinished import FOLDER, unfinished_capture


@pytest.fixture
def footage(tmp_path):
    path = tmp_path / "walk.mp4"
    path.write_text("footage")
    return path


def end(root, footage, error=None):
    """Write something in a capture's folder, end the capture, and return the folder."""
    try:
        with unfinished_capture(root, footage) as folder:
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
    with unfinished_capture(tmp_path, footage) as folder:
        assert folder == first
    assert not first.exists()
    footage.write_text("other footage")
    with unfinished_capture(tmp_path, footage) as folder:
        assert folder != first


def test_what_is_old_or_too_much_is_removed(tmp_path, footage, monkeypatch):
    folders = [tmp_path / FOLDER / name for name in ("0" * 32, "1" * 32, "2" * 32, "3" * 32)]
    for folder, age_s in zip(folders, (0, 3600, 7200, 30 * 86400), strict=True):
        folder.mkdir(parents=True)
        (folder / "0.npz").write_bytes(bytes(1000))
        os.utime(folder, (time.time() - age_s,) * 2)
    end(tmp_path, footage)
    assert [folder.exists() for folder in folders] == [True, True, True, False]
    monkeypatch.setattr(unfinished, "_LARGEST", 2500)
    end(tmp_path, footage)
    assert [folder.exists() for folder in folders] == [True, True, False, False]


def test_folders_in_it_count_by_their_size_and_time(tmp_path, footage, monkeypatch):
    folders = [tmp_path / FOLDER / name for name in ("0" * 32, "1" * 32, "2" * 32)]
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


def test_clearing_the_cache_removes_it(tmp_path, footage):
    folder = end(tmp_path, footage, KeyboardInterrupt())
    cache = Cache(tmp_path)
    assert cache.size() == cache.clear() > 0
    assert not folder.exists()


def test_without_a_folder_for_caches_nothing_is_kept(footage):
    with unfinished_capture(None, footage) as folder:
        assert folder is None
