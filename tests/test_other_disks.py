# SPDX-License-Identifier: GPL-3.0-or-later
"""File systems of networks, cameras' cards and user space, which lack what others have: locks,
syncing, permissions, an identity of a file that lasts, names that differ in case alone.

Each lack is that of one which was mounted: exFAT, NTFS and FAT in user space, and one in user space
that refused a call at a time.
"""

from __future__ import annotations

import errno
import itertools
import os
import shutil
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scope.scope_addon import temporary
from scope.scope_addon.atomic_write import (
    atomic_path,
    create_new,
    finish,
    write_npz,
    write_result,
)
from scope.scope_addon.command_line.outputs import refuse_inputs
from scope.scope_addon.errors import ChangedFootageError, OutputError, UsageError, VideoError
from scope.scope_addon.job.cache import Cache
from scope.scope_addon.job.unfinished import UnfinishedCapture, unfinished_capture
from scope.scope_addon.job.watched_footage import WatchedFootage
from scope.scope_addon.live.journal import Journal, read_about, read_records
from scope.scope_addon.machine_code.code_cache import read_code, write_code
from scope.scope_addon.private_folder import is_private
from scope.solver.body import Body

from .fuzz import own_targets
from .test_temporary import end, writer

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows has other calls")
Patch = pytest.MonkeyPatch


def refuse(patch: Patch, module: Any, name: str, number: int) -> None:
    def refused(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    patch.setattr(module, name, refused)


def no_locks(number: int) -> Callable[[Patch], None]:
    import fcntl

    return lambda patch: refuse(patch, fcntl, "flock", number)


def no_syncing(number: int) -> Callable[[Patch], None]:
    return lambda patch: refuse(patch, os, "fsync", number)


def other_numbers(patch: Patch) -> None:
    """Give a file another number each time it is asked."""
    numbers = itertools.count(1 << 40)

    def renumbered(real: Callable[..., os.stat_result]) -> Callable[..., os.stat_result]:
        def asked(*given: Any, **how: Any) -> os.stat_result:
            status = real(*given, **how)
            values = list(status)
            values[stat.ST_INO] = next(numbers)
            times = ("st_atime_ns", "st_mtime_ns", "st_ctime_ns")
            return os.stat_result(values, {time: getattr(status, time) for time in times})

        return asked

    for name in ("stat", "lstat", "fstat"):
        patch.setattr(os, name, renumbered(getattr(os, name)))


DISKS = {
    "locks that are not available": no_locks(errno.ENOLCK),
    "locks that are always taken": no_locks(errno.EWOULDBLOCK),
    "no syncing": no_syncing(errno.EINVAL),
    "no permissions": lambda patch: refuse(patch, os, "chmod", errno.EPERM),
    "permissions that are ignored": lambda patch: patch.setattr(os, "chmod", lambda *_, **__: None),
    "other numbers": other_numbers,
}


@pytest.fixture(params=DISKS)
def disk(request: pytest.FixtureRequest, monkeypatch: Patch) -> str:
    """A file system that lacks something; its name."""
    DISKS[request.param](monkeypatch)
    return str(request.param)


def test_results_are_written_whole_and_nothing_is_left(tmp_path: Path, disk: str) -> None:
    for value in (0.0, 1.0):
        write_npz(tmp_path / "walk.npz", {"x": np.full(5, value)})
    with np.load(tmp_path / "walk.npz") as file:
        assert file["x"].tolist() == [1.0] * 5
    growing = create_new(tmp_path / "take.unfinished.mp4")
    growing.write_text("images")
    finish(growing, tmp_path / "take.mp4")
    with suppress(RuntimeError), atomic_path(tmp_path / "walk.npz") as half:
        half.write_text("half")
        raise RuntimeError
    assert sorted(os.listdir(tmp_path)) == ["take.mp4", "walk.npz"]


def test_the_cache_keeps_captures(tmp_path: Path, disk: str) -> None:
    cache = Cache(tmp_path)
    for content in (b"old", b"new"):
        job = cache.new_job_folder()
        (job / "person1.npz").write_bytes(content)
        cache.keep(job, "0" * 32, ["person1.npz"], {"people": 1})
    found = cache.find("0" * 32)
    assert found is not None
    assert found.motions[0].read_bytes() == b"new"


def test_what_a_living_process_writes_stays(tmp_path: Path, disk: str) -> None:
    process = writer(tmp_path)
    before = set(os.listdir(tmp_path))
    write_result(tmp_path / "run.json", "{}")
    assert set(os.listdir(tmp_path)) == before | {"run.json"}
    end(process)


def stop_capture(caches: Path, footage: Path) -> UnfinishedCapture:
    """Begin a capture, and stop it once it has found something."""
    with suppress(KeyboardInterrupt), unfinished_capture(caches, footage) as unfinished:
        if unfinished.folder is not None:
            unfinished.folder.mkdir(exist_ok=True)
        raise KeyboardInterrupt
    return unfinished


def test_a_capture_goes_on_and_its_results_count(tmp_path: Path, disk: str) -> None:
    """It is continued where the file system has locks, and begins again elsewhere."""
    footage = tmp_path / "walk.mp4"
    footage.write_bytes(bytes(1000))
    for _ in range(2):
        stopped = stop_capture(tmp_path / "caches", footage)
        assert stopped.warnings == []
        stopped.footage.check()
    assert (stopped.folder is not None) == (not disk.startswith(("locks", "other numbers")))


def test_a_recording_grows_where_it_was_begun(tmp_path: Path, body: Body, disk: str) -> None:
    """And can be finished from its file."""
    other = tmp_path / "other"
    other.mkdir()
    seed = own_targets.recordings(other)[0]
    about = read_about(other / "seed.recording")
    said: list[str] = []
    journal = Journal(tmp_path / "take.recording", about, body, said.append)
    for pose, camera in read_records(other / "seed.recording", about, body):
        journal.add(pose, camera)
    journal.close()
    assert said == []
    assert journal.path == tmp_path / "take.recording"
    assert (tmp_path / "take.recording").read_bytes() == seed
    journal.remove()
    assert os.listdir(tmp_path) == ["other"]


def test_recordings_are_synced_while_they_grow(
    tmp_path: Path, body: Body, monkeypatch: Patch
) -> None:
    from scope.scope_addon.live import journal as module

    monkeypatch.setattr(module, "_SYNC_S", 0.0)
    no_syncing(errno.EINVAL)(monkeypatch)
    test_a_recording_grows_where_it_was_begun(tmp_path, body, "no syncing")


def test_what_cannot_be_removed_yet_is_removed_by_the_next_process(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    """As the folder of a file that is open somewhere, in a network."""
    job = temporary.new_folder("job", tmp_path)
    (job / "footage.mp4").write_text("footage")
    with monkeypatch.context() as patch:
        patch.setattr(shutil, "rmtree", lambda *_, **__: None)
        temporary.discard(job)
    assert sorted(os.listdir(tmp_path)) == [job.name, f"{job.name}-lock"]
    script = (
        "import sys; from pathlib import Path; from scope.scope_addon.temporary import *;"
        "remove_abandoned(Path(sys.argv[1]))"
    )
    subprocess.run([sys.executable, "-c", script, str(tmp_path)], check=True)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("clock_s", [-30 * 86400.0, 30 * 86400.0])
def test_a_servers_clock_removes_nothing_early(
    tmp_path: Path, monkeypatch: Patch, clock_s: float
) -> None:
    """What a kill left yesterday stays, whatever the computer's own clock says."""
    walk, run = tmp_path / "walk.mp4", tmp_path / "run.mp4"
    for number, footage in enumerate((walk, run)):
        footage.write_bytes(bytes([number]) * 1000)
    caches = tmp_path / "caches"
    first = stop_capture(caches, walk)
    now_s = time.time()
    monkeypatch.setattr(time, "time", lambda: now_s + clock_s)
    with unfinished_capture(caches, run):
        assert first.folder is not None
        assert first.folder.is_dir()


def test_footage_of_another_number_is_the_same_if_its_content_is(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    footage = tmp_path / "walk.mp4"
    footage.write_bytes(bytes(1000))
    status = footage.stat()
    watched = WatchedFootage(footage)
    watched.content()
    with monkeypatch.context() as patch:
        other_numbers(patch)
        watched.check()
    other = tmp_path / "other"
    other.write_bytes(b"1" * 1000)
    os.utime(other, ns=(status.st_atime_ns, status.st_mtime_ns))
    os.replace(other, footage)
    with pytest.raises(ChangedFootageError):
        watched.check()


@pytest.mark.parametrize("number", [errno.ESTALE, errno.EACCES])
def test_a_server_that_is_gone_for_a_while_costs_no_capture(
    tmp_path: Path, monkeypatch: Patch, number: int
) -> None:
    """The footage was said to be changed, and what was observed was removed."""
    footage = tmp_path / "walk.mp4"
    footage.write_bytes(bytes(1000))
    real = os.stat

    def gone(path: Any, *how: Any, **more: Any) -> os.stat_result:
        if str(path) == str(footage):
            raise OSError(number, os.strerror(number), str(path))
        return real(path, *how, **more)

    def capture() -> None:
        with unfinished_capture(tmp_path / "caches", footage) as unfinished:
            assert unfinished.folder is not None
            unfinished.folder.mkdir()
            monkeypatch.setattr(os, "stat", gone)
            unfinished.footage.check()

    with pytest.raises(VideoError, match="walk.mp4 cannot be read any more") as raised:
        capture()
    assert not isinstance(raised.value, ChangedFootageError)
    monkeypatch.undo()
    with unfinished_capture(tmp_path / "caches", footage) as again:
        assert again.folder is not None
        assert again.folder.is_dir()
        again.footage.check()


def test_the_input_is_not_written_by_a_name_in_other_letters(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    """Where they are one file, which has another number for each name."""
    path = tmp_path / "my.npz"
    path.write_text("a body")
    other = tmp_path / "MY.npz"
    os.link(path, other)
    refuse_twice = pytest.raises(UsageError, match="is the input itself")
    other_numbers(monkeypatch)
    with refuse_twice:
        refuse_inputs([other], [path])
    refuse_inputs([tmp_path / "other.npz"], [path])


@pytest.mark.parametrize("number", [errno.EINVAL, errno.ENOENT])
def test_a_name_that_a_disk_does_not_have_is_said_to_be_that(
    tmp_path: Path, monkeypatch: Patch, number: int
) -> None:
    real = os.open

    def open_plain(path: Any, *how: Any, **more: Any) -> int:
        if "?" in str(path):
            raise OSError(number, os.strerror(number), str(path))
        return real(path, *how, **more)

    monkeypatch.setattr(os, "open", open_plain)
    with pytest.raises(OutputError, match="choose one without signs such as"):
        write_result(tmp_path / "walk?.json", "{}")
    assert os.listdir(tmp_path) == []
    with pytest.raises(OutputError, match="its folder does not exist"):
        write_result(tmp_path / "none" / "walk.json", "{}")


def test_where_others_can_write_nothing_is_private_and_no_machine_code_kept(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    tmp_path.chmod(0o777)
    before = os.umask(0)
    try:
        DISKS["permissions that are ignored"](monkeypatch)
        assert not is_private(tmp_path)
        file = tmp_path / "kernel.code"
        with pytest.raises(OSError, match="others can write"):
            write_code(file, "key", b"code")
        assert read_code(file, "key", trusted=False) is None
        assert os.listdir(tmp_path) == []
    finally:
        os.umask(before)
