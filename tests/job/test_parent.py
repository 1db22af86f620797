# SPDX-License-Identifier: GPL-3.0-or-later
"""A process ends when its parent ends."""

import subprocess
import sys
import threading
import types

import pytest
from scope.scope_addon.job import parent

# Writes part of a file, and waits until it is interrupted.
CHILD = """
import signal, sys, time
from pathlib import Path
from scope.scope_addon.job import parent
from scope.scope_addon.atomic_write import atomic_path
parent.GRACE_S = {grace}
# As the command line does; background jobs of a shell ignore SIGINT.
signal.signal(signal.SIGINT, signal.default_int_handler)
parent.stop_with_parent()
with atomic_path(Path(sys.argv[1])) as temporary:
    temporary.write_text("half of something")
    print("writing", flush=True)
    while True:
        try:
            while True:
                time.sleep(0.05)
        except {swallowed}:
            pass
"""


@pytest.mark.parametrize(
    ("grace", "swallowed"), [(600.0, "ZeroDivisionError"), (0.2, "KeyboardInterrupt")]
)
def test_no_partial_file_is_left_whether_or_not_the_main_thread_stops(tmp_path, grace, swallowed):
    code = CHILD.format(grace=grace, swallowed=swallowed)
    command = [sys.executable, "-c", code, str(tmp_path / "result.npz")]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        assert child.stdout.readline().strip() == b"writing"
        assert len(list(tmp_path.iterdir())) == 1
        child.stdin.close()
        assert child.wait(300) != 0
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("error", "ends"), [(BrokenPipeError(), True), (OSError(9, "Bad file descriptor"), False)]
)
def test_only_the_end_of_the_pipe_ends_the_process(monkeypatch, error, ends):
    def fails(_):
        raise error

    monkeypatch.setattr(parent, "_wait_for_end_of_stdin", fails)
    ended = threading.Event()
    parent.when_parent_ends(ended.set)
    for thread in threading.enumerate():
        if thread.name == "scope-parent":
            thread.join()
    assert ended.is_set() == ends


def test_what_the_parent_writes_is_heard(tmp_path):
    code = (
        "import sys, time\nfrom scope.scope_addon.job import parent\n"
        "parent.when_parent_ends(lambda: print('ended', flush=True), lambda piece: print(piece, "
        "flush=True))\n"
        "print('begun', flush=True)\ntime.sleep(600)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        heard = [child.stdout.readline()]
        child.stdin.write(b"stop\n")
        child.stdin.flush()
        heard.append(child.stdout.readline())
        child.stdin.close()
        heard.append(child.stdout.readline())
        child.kill()
    assert [line.strip() for line in heard] == [b"begun", rb"b'stop\n'", b"ended"]


def test_on_windows_the_pipe_is_polled_and_only_what_is_there_is_read(monkeypatch):
    """A pending read would block the loading of numpy's libraries there."""
    looks = []
    heard = []

    def peek(handle, size):
        looks.append((handle, size))
        if len(looks) == 4:
            raise BrokenPipeError
        return (5, 0) if len(looks) == 2 else (0, 0)

    def read(handle, size):
        assert (handle, size, len(looks)) == (0, 5, 2)
        return b"stop\n"

    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(parent.os, "read", read)
    monkeypatch.setattr(parent, "_POLLING_INTERVAL_S", 0.0)
    monkeypatch.setitem(sys.modules, "_winapi", types.SimpleNamespace(PeekNamedPipe=peek))
    monkeypatch.setitem(
        sys.modules, "msvcrt", types.SimpleNamespace(get_osfhandle=lambda fd: 100 + fd)
    )
    with pytest.raises(BrokenPipeError):
        parent._wait_for_end_of_stdin(heard.append)
    assert looks == [(100, 0)] * 4
    assert heard == [b"stop\n"]
