# SPDX-License-Identifier: GPL-3.0-or-later
"""Finished captures are found, unfinished ones never, and the least recently used are pruned
first.
"""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from scope.scope_addon.errors import OutputError
from scope.scope_addon.job.cache import Cache


@pytest.fixture
def cache(tmp_path):
    return Cache(tmp_path / "cache")


def add(cache, key, size=1000):
    folder = cache.new_job_folder()
    (folder / "person1.npz").write_bytes(b"x" * size)
    return cache.keep(folder, key, ["person1.npz"], {"people": 1})


def test_kept_captures_are_found(cache):
    assert cache.find("a") is None
    kept = add(cache, "a")
    assert cache.find("a") == kept
    assert kept.motions[0].read_bytes() == b"x" * 1000
    assert kept.report == {"people": 1}
    assert list((cache.root / "jobs").iterdir()) == []


def test_a_damaged_capture_is_not_found(cache):
    kept = add(cache, "a")
    kept.motions[0].unlink()
    assert cache.find("a") is None
    (kept.motions[0].parent / "report.json").write_text("{")
    assert cache.find("a") is None
    add(cache, "a")
    assert cache.find("a") is not None


@pytest.mark.parametrize(
    "content",
    [
        '{"motions":' * 100_000,
        '{"report": {}, "motions": ["' + "x" * 300 + '.npz"]}',
        '{"report": [], "motions": ["person1.npz"]}',
        '{"report": {"fps": {"total": "fast"}}, "motions": ["person1.npz"]}',
    ],
)
def test_a_report_that_nothing_can_be_done_with_is_not_found(cache, content):
    add(cache, "a")
    (cache.root / "captures" / "a" / "report.json").write_text(content)
    assert cache.find("a") is None


def test_names_from_a_report_cannot_leave_the_folder(cache):
    add(cache, "a")
    folder = cache.root / "captures" / "a"
    (cache.root / "secret.npz").write_bytes(b"")
    (folder / "report.json").write_text('{"motions": ["../../secret.npz"], "report": {}}')
    assert cache.find("a") is None


def test_pruning_removes_the_least_recently_used(cache):
    for age, key in enumerate(["new", "middle", "old"]):
        add(cache, key)
        os.utime(cache.root / "captures" / key, (time.time() - 100 * age,) * 2)
    cache.prune(2500)
    assert [k for k in ("new", "middle", "old") if cache.find(k)] == ["new", "middle"]
    os.utime(cache.root / "captures" / "new", (time.time() - 100,) * 2)
    cache.prune(1)  # the most recently used is kept, however large it is
    assert [k for k in ("new", "middle") if cache.find(k)] == ["middle"]


@pytest.fixture
def vanishing(monkeypatch):
    """A folder of that name is listed, but removed by another Blender before it is read."""
    before = Path.stat

    def stat(path, **how):
        if path.name.endswith("vanishing"):
            shutil.rmtree(path, ignore_errors=True)
        return before(path, **how)

    monkeypatch.setattr(Path, "stat", stat)
    return "job-00000000-1-vanishing"


def test_another_blender_may_prune_at_the_same_time(cache, vanishing):
    add(cache, "new")
    (cache.root / "captures" / vanishing).mkdir()
    cache.prune(1)
    assert cache.find("new")


def test_another_blenders_job_may_end_at_the_same_time(cache, vanishing):
    add(cache, "new")
    (cache.root / "jobs" / vanishing).mkdir()
    assert cache.new_job_folder().is_dir()


def test_abandoned_jobs_are_removed_and_running_ones_kept(cache):
    running = cache.new_job_folder()
    abandoned = cache.new_job_folder()
    os.utime(abandoned, (1, 1))
    cache.clear()
    cache.new_job_folder()
    assert running.exists()
    assert not abandoned.exists()


def test_the_folder_of_a_killed_blender_is_removed_at_once(cache):
    """Its worker may have ended before it."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    running = cache.new_job_folder()
    killed = running.with_name(running.name.replace(f"-{os.getpid()}-", f"-{ended.pid}-"))
    elsewhere = running.with_name(f"job-00000000-{ended.pid}-x")
    for folder in (killed, elsewhere):
        folder.mkdir()
    cache.new_job_folder()
    assert (running.exists(), killed.exists(), elsewhere.exists()) == (True, False, True)


def test_an_unwritable_folder_is_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="choose another folder"):
        Cache(tmp_path / "file" / "cache").new_job_folder()


def test_clearing_keeps_compiled_code_except_that_of_replaced_versions(cache):
    add(cache, "a", size=1000)
    of_numba = cache.kernels / "gauss_newton_" / "optimizer.optimize-134.py311.nbi"
    replaced, used, other = (
        cache.kernels / name / "optimizer.optimize-0123456789ab.code"
        for name in (
            "solver-01234567-000000000000",
            "solver-01234567-ffffffffffff",
            "solver-89abcdef-000000000000",
        )
    )
    for path in (of_numba, replaced, used, other):
        path.parent.mkdir(parents=True)
        path.write_bytes(b"x" * 100)
    marker = cache.kernels / "0123456789abcdef.ready"
    marker.touch()
    os.utime(replaced.parent, (1, 1))
    freed = cache.size()
    assert 1200 <= freed < 1300
    assert cache.clear() == freed
    assert cache.find("a") is None
    assert [path.exists() for path in (of_numba, replaced, used, other, marker)] == [
        False,
        False,
        True,
        True,
        True,
    ]
    assert cache.size() == 0
