# SPDX-License-Identifier: GPL-3.0-or-later
"""A process ends when its parent ends, whatever either of them does."""

import os
import signal
import subprocess
import sys
import types

import pytest
from scope.scope_addon import parent

from .job.processes import runs, wait_for

# Starts a process that runs the code after it, says its number, and waits.
PARENT = """
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", sys.argv[1]], stdin=subprocess.PIPE)
print(child.pid, flush=True)
child.wait()
"""
BEGIN = """
import atexit, ctypes, os, signal, subprocess, sys, time
from pathlib import Path
from scope.scope_addon import parent
from scope.scope_addon.atomic_write import atomic_path
from scope.scope_addon.temporary import discard_all
# As the command line does; background jobs of a shell ignore SIGINT.
signal.signal(signal.SIGINT, signal.default_int_handler)
parent.GRACE_S = 0.2
"""
INTERRUPTED = "parent.end_with_parent(discard_all, interrupts=True)\n"
SERVER = "parent.end_with_parent(receive=None)\n"
KEEPS_THE_LOCK = """
pipe = os.pipe()
print(1, flush=True)
ctypes.PyDLL(None).read(pipe[0], ctypes.create_string_buffer(1), 1)
"""
# Tells that it has begun, and waits in the middle of a file.
WRITES = """
with atomic_path(Path({path!r})) as temporary:
    temporary.write_text("half of something")
    print(1, flush=True)
    while True:
        try:
            while True:
                time.sleep(0.05)
        except {swallowed}:
            pass
"""


def killed_parent(code, *, inherited=False):
    """Run code as a child, kill its parent when the code says a line, and wait for its end.

    :param inherited: a third process has the other end of the child's standard input as well.
    """
    script = PARENT
    if inherited:
        holder = "subprocess.Popen(['sleep', '600'], pass_fds=[child.stdin.fileno()])"
        script = script.replace("print(child.pid", f"print({holder}.pid)\nprint(child.pid")
    command = [sys.executable, "-c", script, BEGIN + code]
    pids = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as above:
        assert above.stdout is not None
        pids = [int(above.stdout.readline()) for _ in range(1 + inherited)]
        assert above.stdout.readline().strip() == "1"
        above.kill()
    wait_for(lambda: not runs(pids[-1]))
    for pid in pids[:-1]:
        os.kill(pid, signal.SIGKILL)


on_linux = pytest.mark.skipif(sys.platform != "linux", reason="asks Linux about processes")


@on_linux
@pytest.mark.parametrize(
    ("swallowed", "inherited"), [("ZeroDivisionError", False), ("KeyboardInterrupt", True)]
)
def test_it_ends_and_leaves_no_partial_file_when_its_parent_is_killed(
    tmp_path, swallowed, inherited
):
    path = str(tmp_path / "result.npz")
    killed_parent(INTERRUPTED + WRITES.format(path=path, swallowed=swallowed), inherited=inherited)
    assert list(tmp_path.iterdir()) == []


@on_linux
@pytest.mark.parametrize(
    "code",
    [
        INTERRUPTED + KEEPS_THE_LOCK,
        # As Blender's module does, after an interrupt.
        INTERRUPTED + "libc = ctypes.CDLL(None)\nlibc.__cxa_atexit(libc.pause, None, None)\n"
        "print(1, flush=True)\ntime.sleep(600)",
        INTERRUPTED + "atexit.register(time.sleep, 600)\nprint(1, flush=True)\ntime.sleep(600)",
        SERVER + "print(1, flush=True)\nsys.stdin.read()\ntime.sleep(600)",
        "parent.end_with_parent(lambda: 1 / 0)\nprint(1, flush=True)\ntime.sleep(600)",
    ],
    ids=["lock kept", "exit of C", "exit of Python", "server", "error"],
)
def test_it_ends_although_its_interpreter_stands_still(code):
    """After a second, which is signal 1."""
    killed_parent("parent._LIMIT_S = 1\n" + code)


def test_a_child_ends_within_ten_seconds():
    """The system's timer begins at the parent's end, and once more when that is noticed."""
    assert 2 * parent._LIMIT_S <= 10
    assert parent.GRACE_S + parent._INTERVAL_S < parent._LIMIT_S


@on_linux
def test_it_goes_on_when_only_the_thread_ends_that_has_started_it():
    """Linux sends the signal of a parent's end then, too."""
    code = """
import subprocess, sys, threading
child = "from scope.scope_addon import parent\\nimport signal, sys\\n" \
    "parent.end_with_parent()\\nprint(1, flush=True)\\n" \
    "while not signal.getitimer(signal.ITIMER_REAL)[0]: pass\\n" \
    "while signal.getitimer(signal.ITIMER_REAL)[0]: pass\\nprint(2, flush=True)\\n" \
    "import time; time.sleep(600)"
found = []
def start():
    pipe = subprocess.PIPE
    found.append(subprocess.Popen([sys.executable, "-c", child], stdin=pipe, stdout=pipe))
    assert found[0].stdout.readline() == b"1\\n"
thread = threading.Thread(target=start)
thread.start()
thread.join()
assert found[0].stdout.readline() == b"2\\n"
found[0].stdin.close()
assert found[0].wait() == 130
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=300)


def test_what_the_parent_writes_is_heard():
    code = BEGIN + (
        "parent.end_with_parent(lambda: print('ended', flush=True), lambda piece: print(piece, "
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
        assert child.wait(300) == parent.STOPPED
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
    monkeypatch.setattr(parent, "_INTERVAL_S", 0.0)
    monkeypatch.setitem(sys.modules, "_winapi", types.SimpleNamespace(PeekNamedPipe=peek))
    monkeypatch.setitem(
        sys.modules, "msvcrt", types.SimpleNamespace(get_osfhandle=lambda fd: 100 + fd)
    )
    with pytest.raises(BrokenPipeError):
        parent._wait_for_end(1, heard.append)
    assert looks == [(100, 0)] * 4
    assert heard == [b"stop\n"]


def test_on_windows_a_process_whose_input_somebody_else_reads_waits_for_its_parent(monkeypatch):
    waited = []
    system = types.SimpleNamespace(
        SYNCHRONIZE=1 << 20,
        INFINITE=-1,
        OpenProcess=lambda *of: waited.append(of) or 7,
        WaitForSingleObject=lambda *of: waited.append(of),
    )
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setitem(sys.modules, "_winapi", system)
    monkeypatch.setitem(sys.modules, "msvcrt", types.SimpleNamespace())
    parent._wait_for_end(1234, None)
    assert waited == [(1 << 20, False, 1234), (7, -1)]
