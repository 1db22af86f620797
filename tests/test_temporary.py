# SPDX-License-Identifier: GPL-3.0-or-later
"""What a killed process has left is removed, and nothing of a living one or of anybody else.

A process may live in another namespace, on a machine of any name, with any clock.
"""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import types
from pathlib import Path

import pytest
from scope.scope_addon import temporary
from scope.scope_addon.atomic_write import atomic_path
from scope.scope_addon.temporary import (
    claim,
    discard,
    discard_all,
    hold,
    is_abandoned,
    new_folder,
    own_entries,
    release,
    remove,
    remove_abandoned,
    temporary_folder,
)

posix = pytest.mark.skipif(os.name == "nt", reason="Windows has no such files, users or signals")

# Writes a result and the drafts of two libraries, makes a folder, and waits.
WRITER = """
import sys
from pathlib import Path
from scope.scope_addon.atomic_write import atomic_path
from scope.scope_addon.temporary import new_folder
folder = Path(sys.argv[1])
(new_folder("job", folder) / "preview.rgba").write_text("picture")
with atomic_path(folder / "walk [1].npz") as temporary:
    temporary.write_text("half")
    Path(f"{temporary}@").write_text("a draft, as Blender writes it")
    temporary.with_suffix(".pqSxDJ").write_text("a draft, as USD writes it")
    print("ready", flush=True)
    sys.stdin.read()
    temporary.write_text("whole")
"""
LEFT = 6  # the file, its drafts, the folder, and two locks
OTHER_MACHINE = ("unshare", "--uts", "--pid", "--fork", "--kill-child", "--mount-proc")


def can_be_other_machine():
    """Whether a process of its own process numbers and host name can be started."""
    try:
        return subprocess.run([*OTHER_MACHINE, "true"], check=False).returncode == 0
    except OSError:
        return False


def writer(folder, *before):
    """Start a process that writes, and wait until it does."""
    command = [*before, sys.executable, "-c", WRITER, str(folder)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    return process


def end(process):
    with process:
        process.kill()
        process.wait()  # before its input ends, at which the process of a namespace would finish


def age(folder, time_s):
    for path in folder.iterdir():
        os.utime(path, (time_s, time_s))


@pytest.mark.parametrize("time_s", [0, 4e9])
def test_what_is_written_stays_whatever_the_clocks_say(tmp_path, time_s):
    process = writer(tmp_path)
    age(tmp_path, time_s)
    before = set(os.listdir(tmp_path))
    remove_abandoned(tmp_path)
    with atomic_path(tmp_path / "walk [1].npz") as own:
        own.write_text("another")
    assert set(os.listdir(tmp_path)) == before | {"walk [1].npz"}
    process.communicate()
    assert process.returncode == 0
    assert (tmp_path / "walk [1].npz").read_text("utf-8") == "whole"


@pytest.mark.parametrize("time_s", [0, 4e9])
def test_what_a_killed_process_has_left_is_removed_by_the_next_one(tmp_path, time_s):
    end(writer(tmp_path))
    assert len(os.listdir(tmp_path)) == LEFT
    others = (".walk [1].npz", ".walk [1].scope-notes.npz", ".walk [2].scope-0-0-x.npz")
    for name in others:
        (tmp_path / name).write_text("a user's")
    age(tmp_path, time_s)
    with atomic_path(tmp_path / "run.npz") as own:
        own.write_text("new")
    assert sorted(os.listdir(tmp_path)) == sorted(["run.npz", *others])


@pytest.mark.skipif(not can_be_other_machine(), reason="needs root and unshare")
def test_another_machine_keeps_what_it_writes_until_it_ends(tmp_path):
    """It numbers its processes from 1, as every container does, and has another name."""
    process = writer(tmp_path, *OTHER_MACHINE, "sh", "-c", 'hostname elsewhere; exec "$@"', "sh")
    before = set(os.listdir(tmp_path))
    remove_abandoned(tmp_path)
    assert set(os.listdir(tmp_path)) == before
    end(process)
    while list(tmp_path.iterdir()):  # its processes end with it, soon after
        remove_abandoned(tmp_path)


@posix
def test_where_there_are_no_locks_everything_works_and_nothing_is_taken_for_abandoned(
    tmp_path, monkeypatch
):
    import fcntl

    end(writer(tmp_path))
    left = set(os.listdir(tmp_path))

    def no_locks(handle, operation):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", no_locks)
    with atomic_path(tmp_path / "run.npz") as own:
        own.write_text("new")
    assert set(os.listdir(tmp_path)) == left | {"run.npz"}


@posix
def test_files_of_another_owner_stay(tmp_path):
    """Also those that a server shows as nobody's."""
    if os.geteuid() != 0:
        pytest.skip("only root can give files away")
    end(writer(tmp_path))
    for path in tmp_path.iterdir():
        os.chown(path, 65534, 65534)
    remove_abandoned(tmp_path)
    assert len(os.listdir(tmp_path)) == LEFT


@posix
def test_where_new_files_are_another_users_nothing_is_taken_for_held(tmp_path, monkeypatch):
    """As on a server's disk that gives all files to one user."""
    monkeypatch.setattr(os, "geteuid", lambda: os.stat(tmp_path).st_uid + 1)
    with pytest.raises(OSError, match="No locks"):
        hold(tmp_path / "lock")
    assert os.listdir(tmp_path) == []
    (tmp_path / "lock").touch()
    assert not hold(tmp_path / "lock")  # which another user may hold
    assert os.listdir(tmp_path) == ["lock"]


NAME = "scope-0123456789abcdef"


@posix
@pytest.mark.parametrize("kind", ["link", "dangling link", "pipe", "folder", "device", "content"])
def test_what_is_no_lock_of_ours_removes_nothing(tmp_path, kind):
    """And does not let a process wait, or open a device."""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "empty").touch()
    folder = tmp_path / "out"
    folder.mkdir()
    lock = folder / f".walk.{NAME}-lock"
    if kind == "link":
        lock.symlink_to(elsewhere / "empty")
    elif kind == "dangling link":
        lock.symlink_to(tmp_path / "none")
    elif kind == "pipe":
        os.mkfifo(lock)
    elif kind == "folder":
        lock.mkdir()
    elif kind == "device":
        if os.geteuid() != 0:
            pytest.skip("only root can make a device")
        os.mknod(lock, 0o020600, os.makedev(1, 5))  # of endless zeros
    else:
        lock.write_text("a user's")
    (folder / f".walk.{NAME}.npz").write_text("a user's")
    before = set(os.listdir(folder))
    remove_abandoned(folder)
    assert not hold(lock)
    assert not is_abandoned(lock)
    assert set(os.listdir(folder)) == before
    assert os.listdir(elsewhere) == ["empty"]
    assert not (tmp_path / "none").exists()


@posix
@pytest.mark.parametrize("when", ["before it is opened", "while it is held"])
@pytest.mark.parametrize("kind", ["link", "pipe", "folder"])
def test_a_lock_that_somebody_replaces_is_neither_followed_nor_waited_for(
    tmp_path, monkeypatch, kind, when
):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.touch()
    lock = tmp_path / "lock"

    def replace_it():
        lock.unlink()
        if kind == "link":
            lock.symlink_to(elsewhere)
        elif kind == "pipe":
            os.mkfifo(lock)
        else:
            lock.mkdir()

    really_open = os.open

    def open_late(path, flags, *rest):
        if Path(path) == lock and not flags & os.O_CREAT:
            replace_it()
        return really_open(path, flags, *rest)

    if when == "while it is held":
        assert hold(lock)
        replace_it()
    else:
        monkeypatch.setattr(os, "open", open_late)
        assert not hold(lock)
        monkeypatch.undo()
    assert not hold(lock)
    assert not is_abandoned(lock)
    release(lock)
    assert elsewhere.exists()


@posix
@pytest.mark.parametrize("abandoned", ["file", "folder"])
def test_links_are_removed_and_what_they_lead_to_stays(tmp_path, abandoned):
    elsewhere = tmp_path / "elsewhere"
    (elsewhere / "takes").mkdir(parents=True)
    (elsewhere / "takes" / "take.mp4").write_text("footage")
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / f"job-{NAME}-lock").touch()
    if abandoned == "file":
        (folder / f"job-{NAME}").symlink_to(elsewhere)
    else:
        (folder / f"job-{NAME}").mkdir()
        (folder / f"job-{NAME}" / "below").symlink_to(elsewhere)
    remove_abandoned(folder)
    assert os.listdir(folder) == []
    assert (elsewhere / "takes" / "take.mp4").read_text("utf-8") == "footage"


@posix
def test_a_folder_that_is_replaced_by_a_link_while_it_is_removed_is_not_followed(
    tmp_path, monkeypatch
):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "take.mp4").write_text("footage")
    folder = tmp_path / "job"
    (folder / "below").mkdir(parents=True)
    real_open = os.open

    def open_late(path, flags, *others, **how):
        if path == "below":
            (folder / "below").rmdir()
            (folder / "below").symlink_to(elsewhere)
        return real_open(path, flags, *others, **how)

    monkeypatch.setattr(os, "open", open_late)
    remove(folder)
    assert (elsewhere / "take.mp4").exists()


def test_locks_are_free_when_they_are_released_or_their_process_has_ended(tmp_path):
    lock = tmp_path / "batch"
    assert not is_abandoned(lock)
    assert hold(lock)
    assert not is_abandoned(lock)
    assert not hold(lock)
    release(lock)
    assert not lock.exists()
    script = (
        "import sys; from pathlib import Path; from scope.scope_addon.temporary import hold;"
        "print(hold(Path(sys.argv[1])))"
    )
    command = [sys.executable, "-c", script, str(lock)]
    assert subprocess.run(command, capture_output=True, check=True).stdout.strip() == b"True"
    assert is_abandoned(lock)
    assert hold(lock)
    release(lock)


MANY = """
import sys
from pathlib import Path
from scope.scope_addon.atomic_write import atomic_path
from scope.scope_addon.temporary import temporary_folder
folder = Path(sys.argv[1])
for number in range(15):
    with atomic_path(folder / "walk.npz", durable=False) as temporary:
        temporary.write_text(f"{number:1000}")
    with temporary_folder("job", folder) as job:
        (job / "file").write_text("mine")
        assert (job / "file").read_text("utf-8") == "mine"
"""


@pytest.mark.skipif(
    os.name == "nt", reason="Windows may refuse to replace a file that another process replaces"
)
def test_processes_that_write_at_once_do_not_disturb_each_other(tmp_path):
    command = [sys.executable, "-c", MANY, str(tmp_path)]
    processes = [subprocess.Popen(command, stderr=subprocess.PIPE) for _ in range(3)]
    for process in processes:
        assert process.communicate()[1] == b""
        assert process.returncode == 0
    assert os.listdir(tmp_path) == ["walk.npz"]
    assert len((tmp_path / "walk.npz").read_text("utf-8")) == 1000


@posix
def test_a_lock_that_was_taken_for_abandoned_before_it_was_held_is_not_used(tmp_path, monkeypatch):
    """Between making and locking it, another process has locked and removed it."""
    import fcntl

    real = fcntl.flock
    removed = []

    def late(handle, operation):
        if not removed:
            removed.extend(tmp_path.iterdir())
            removed[0].unlink()
        real(handle, operation)

    monkeypatch.setattr(fcntl, "flock", late)
    path = claim(tmp_path, ".walk.", ".npz")
    assert removed[0].name != f"{path.stem}-lock"
    assert os.listdir(tmp_path) == [f"{path.stem}-lock"]
    discard(path)
    assert os.listdir(tmp_path) == []


def test_an_exit_without_cleaning_up_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    (new_folder("footage") / "clip.mp4").write_text("footage")
    claim(tmp_path, ".walk.", ".npz").write_text("half")
    discard_all()
    assert os.listdir(tmp_path) == []


@posix
def test_a_temporary_folder_is_nobody_elses(tmp_path):
    with temporary_folder("job", tmp_path) as folder:
        assert folder.stat().st_mode & 0o077 == 0
    assert os.listdir(tmp_path) == []


@posix
def test_only_own_folders_with_names_of_ours_are_listed(tmp_path):
    import re

    name = re.compile("[0-9a-f]{4}")
    elsewhere = tmp_path / "elsewhere"
    (elsewhere / "0123").mkdir(parents=True)
    folder = tmp_path / "captures"
    (folder / "abcd").mkdir(parents=True)
    (folder / "holiday").mkdir()
    (folder / "ef01").write_text("a file")
    (folder / "2345").symlink_to(elsewhere)
    assert own_entries(folder, name) == [folder / "abcd"]
    (tmp_path / "linked").symlink_to(elsewhere)
    assert own_entries(tmp_path / "linked", name) == []
    assert own_entries(tmp_path / "none", name) == []


def test_names_are_found_in_the_systems_own_folder(monkeypatch, tmp_path):
    for variable in temporary.TEMPORARY_VARIABLES:
        monkeypatch.delenv(variable, raising=False)
    assert temporary.system_folder() == Path("/tmp")
    monkeypatch.setenv("TEMP", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "none"))
    assert temporary.system_folder() == tmp_path


class StandInForMsvcrt(types.ModuleType):
    """The part of Windows' module that is used, as its documentation describes it: bytes from the
    position on are locked, also after the end of the file, until the file is closed; an open file
    that has no lock is refused with EACCES.
    """

    LK_NBLCK = 2

    def locking(self, handle, mode, nbytes):
        assert (mode, nbytes) == (self.LK_NBLCK, 1)
        import fcntl

        assert os.lseek(handle, 0, os.SEEK_CUR) == 0  # so that all lock the same byte
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise PermissionError(errno.EACCES, "Permission denied") from error


@posix
def test_the_locks_of_windows_say_the_same(tmp_path, monkeypatch):
    """They have never been tried on Windows itself."""
    monkeypatch.setitem(sys.modules, "msvcrt", StandInForMsvcrt("msvcrt"))
    monkeypatch.setattr(sys, "platform", "win32")
    abandoned = f".scope-{'0' * 16}"
    (tmp_path / f"{abandoned}-lock").touch()
    (tmp_path / abandoned).touch()
    path = claim(tmp_path)
    path.touch()
    assert not (tmp_path / abandoned).exists()
    assert not is_abandoned(path.with_name(f"{path.name}-lock"))
    other = claim(tmp_path)
    assert path.exists()
    discard(other)
    discard(path)
    assert list(tmp_path.iterdir()) == []
    assert hold(tmp_path / "lock")
    assert not hold(tmp_path / "lock")
    release(tmp_path / "lock")
