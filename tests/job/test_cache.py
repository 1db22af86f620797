# SPDX-License-Identifier: GPL-3.0-or-later
"""Finished captures are found, unfinished ones never, and the least recently used are pruned
first.
"""

import hashlib
import os
import shutil
import sys
import time
from pathlib import Path

import pytest
from scope.scope_addon import temporary
from scope.scope_addon.errors import OutputError
from scope.scope_addon.job.cache import Cache
from scope.scope_addon.job.unfinished import unfinished_capture
from scope.scope_addon.live import unfinished as live_names


@pytest.fixture
def cache(tmp_path):
    return Cache(tmp_path / "cache")


def key(name):
    """A key, as it is made of the request."""
    return hashlib.md5(name.encode()).hexdigest()


def add(cache, name, size=1000):
    folder = cache.new_job_folder()
    (folder / "person1.npz").write_bytes(b"x" * size)
    return cache.keep(folder, key(name), ["person1.npz"], {"people": 1})


def test_kept_captures_are_found(cache):
    assert cache.find(key("a")) is None
    kept = add(cache, "a")
    assert cache.find(key("a")) == kept
    assert kept.motions[0].read_bytes() == b"x" * 1000
    assert kept.report == {"people": 1}
    assert list((cache.root / "jobs").iterdir()) == []


def test_recordings_are_found_wherever_they_grow(cache, tmp_path, monkeypatch):
    monkeypatch.setattr(live_names, "lasting_folder", lambda: tmp_path / "user")
    monkeypatch.setattr(live_names, "system_folder", lambda: tmp_path / "tmp")
    own = [cache.root / "recordings", tmp_path / "user" / "recordings"]
    folders = [*own, live_names.temporary_place()]
    for folder in folders:
        folder.mkdir(parents=True)
        (folder / "job-1.recording").touch()
    assert cache.recordings() == [folder / "job-1.recording" for folder in folders]
    # Files of others in the temporary folder, of which there may be very many, are not even listed.
    (tmp_path / "tmp" / "job-2.recording").touch()
    assert len(cache.recordings()) == len(folders)


def test_a_damaged_capture_is_not_found(cache):
    kept = add(cache, "a")
    for content in (b"", b"y" * 1000):
        kept.motions[0].write_bytes(content)
        assert cache.find(key("a")) is None
    kept.motions[0].unlink()
    assert cache.find(key("a")) is None
    add(cache, "a")
    assert cache.find(key("a")) is not None


@pytest.mark.parametrize(
    "content",
    [
        '{"motions":' * 100_000,
        '{"report": {}, "motions": ["' + "x" * 300 + '.npz"]}',
        '{"report": {}, "motions": ["../../secret.npz"]}',
        '{"report": {"fps": {"total": "fast"}}, "motions": ["person1.npz"]}',
    ],
)
def test_a_report_that_nothing_can_be_done_with_is_not_found(cache, content):
    add(cache, "a")
    (cache.root / "secret.npz").write_bytes(b"")
    (cache.root / "captures" / key("a") / "report.json").write_text(content)
    assert cache.find(key("a")) is None


def test_pruning_removes_the_least_recently_used(cache):
    for age, name in enumerate(["new", "middle", "old"]):
        add(cache, name)
        os.utime(cache.root / "captures" / key(name), (time.time() - 100 * age,) * 2)
    cache.prune(2500)
    assert [name for name in ("new", "middle", "old") if cache.find(key(name))] == ["new", "middle"]
    os.utime(cache.root / "captures" / key("new"), (time.time() - 100,) * 2)
    cache.prune(1)  # the most recently used is kept, however large it is
    assert [name for name in ("new", "middle") if cache.find(key(name))] == ["middle"]


@pytest.fixture
def vanishing(monkeypatch):
    """A folder of that name is listed, but removed by another Blender before it is read."""
    name = key("vanishing")
    before = Path.stat

    def stat(path, **how):
        if path.name == name:
            shutil.rmtree(path, ignore_errors=True)
        return before(path, **how)

    monkeypatch.setattr(Path, "stat", stat)
    return name


def test_another_blender_may_prune_at_the_same_time(cache, vanishing):
    add(cache, "new")
    (cache.root / "captures" / vanishing).mkdir()
    cache.prune(1)
    assert cache.find(key("new"))


def test_abandoned_jobs_are_removed_and_running_ones_kept(cache):
    running = cache.new_job_folder()
    abandoned = cache.new_job_folder()
    os.close(temporary._locks.pop(abandoned))  # as the end of its Blender does
    cache.clear()
    cache.new_job_folder()
    assert running.exists()
    assert not abandoned.exists()


@pytest.mark.skipif(sys.platform != "linux", reason="looks at /proc")
def test_the_name_of_a_jobs_lock_is_on_the_disk_before_its_files(cache, monkeypatch):
    """A power cut on btrfs left files of a job that were synced, without the lock beside it."""
    synced = []
    true_sync = os.fsync

    def sync(handle):
        synced.append(os.readlink(f"/proc/self/fd/{handle}"))
        true_sync(handle)

    monkeypatch.setattr(os, "fsync", sync)
    folder = cache.new_job_folder()
    assert synced == [str(folder.parent.resolve())]


def test_a_capture_that_is_found_leaves_nothing_of_killed_processes(cache):
    """No other process may ever write there."""
    add(cache, "a")
    abandoned = cache.new_job_folder()
    times = temporary.claim(cache.root, ".times.", ".json")
    times.write_bytes(b"{")
    for path in (abandoned, times):
        os.close(temporary._locks.pop(path))
    cache.find(key("a"))
    assert list((cache.root / "jobs").iterdir()) == []
    assert not times.exists()


@pytest.mark.skipif(os.name == "nt", reason="Windows needs a privilege for links")
@pytest.mark.parametrize("is_link", [False, True])
def test_what_others_keep_in_folders_of_these_names_stays(cache, tmp_path, is_link):
    """The user may choose any folder for the cache."""
    cache.root.mkdir()
    files = []
    for name in ("captures", "unfinished", "kernels", "jobs"):
        theirs = tmp_path / "theirs" / name if is_link else cache.root / name
        takes = theirs / ("0" * 32 if is_link else "takes")
        takes.mkdir(parents=True)
        files.append(takes / "take.mp4")
        files[-1].write_bytes(bytes(3000))
        for path in (files[-1], takes, theirs):
            os.utime(path, (1, 1))
        if is_link:
            (cache.root / name).symlink_to(theirs)
    with unfinished_capture(cache.root, tmp_path / "walk.mp4"):
        cache.new_job_folder()
        cache.prune(1)
        cache.clear()
    assert [file.stat().st_size for file in files] == [3000] * 4


@pytest.mark.skipif(os.name == "nt", reason="Windows keeps its pipes in no folder")
def test_a_pipe_in_the_place_of_a_report_is_not_waited_for(cache):
    kept = add(cache, "a")
    report = kept.motions[0].parent / "report.json"
    report.unlink()
    os.mkfifo(report)
    assert cache.find(key("a")) is None


def test_an_unwritable_folder_is_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="choose another folder"):
        Cache(tmp_path / "file" / "cache").new_job_folder()


def test_clearing_keeps_compiled_code_except_that_of_replaced_versions(cache):
    add(cache, "a", size=1000)
    of_others = cache.kernels / "gauss_newton_" / "optimizer.optimize-134.py311.nbi"
    replaced, used, other = (
        cache.kernels / name / "optimizer.optimize-0123456789ab.code"
        for name in (
            "solver-01234567-000000000000",
            "solver-01234567-ffffffffffff",
            "solver-89abcdef-000000000000",
        )
    )
    for path in (of_others, replaced, used, other):
        path.parent.mkdir(parents=True)
        path.write_bytes(b"x" * 100)
    marker = cache.kernels / "0123456789abcdef.ready"
    marker.touch()
    os.utime(replaced.parent, (1, 1))
    freed = cache.size()
    assert 1100 <= freed < 1300
    assert cache.clear() == freed
    assert cache.find(key("a")) is None
    assert [path.exists() for path in (of_others, replaced, used, other, marker)] == [
        True,
        False,
        True,
        True,
        True,
    ]
    assert cache.size() == 0
