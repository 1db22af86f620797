# SPDX-License-Identifier: GPL-3.0-or-later
"""Run a command, and at its n-th system call of a kind kill it, or the process that has started it,
cut the power, or let the call fail. Linux on x86-64 only.

``python system_calls.py PLAN COMMAND…`` prints what happened as JSON on its last line. It imports
nothing of Scope and is a process of its own, because whoever traces has to wait for every child.
The kernel stops the command only at the calls that are named here (a seccomp filter), also in
libraries, in threads and in the processes that it starts.
"""

from __future__ import annotations

import ctypes
import json
import os
import platform
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

AVAILABLE = sys.platform == "linux" and platform.machine() == "x86_64"
KILL = "kill"
FULL = "full"
NO_MEMORY = "no memory"
KILL_PARENT = "kill parent"
CUT = "power cut"
# ENOSPC, ENOMEM
_DISK_FULL = 28
_LACK_OF_MEMORY = 12
# the first argument is a file, a path, or a folder to which a path belongs
_AT_FD, _AT_PATH, _AT_FOLDER = range(3)
_WRITES = {
    1: ("write", _AT_FD),
    18: ("pwrite", _AT_FD),
    20: ("writev", _AT_FD),
    40: ("sendfile", _AT_FD),
    74: ("fsync", _AT_FD),
    77: ("ftruncate", _AT_FD),
    91: ("fchmod", _AT_FD),
    285: ("fallocate", _AT_FD),
    2: ("open", _AT_PATH),
    76: ("truncate", _AT_PATH),
    82: ("rename", _AT_PATH),
    83: ("mkdir", _AT_PATH),
    84: ("rmdir", _AT_PATH),
    85: ("creat", _AT_PATH),
    87: ("unlink", _AT_PATH),
    90: ("chmod", _AT_PATH),
    257: ("open", _AT_FOLDER),
    258: ("mkdir", _AT_FOLDER),
    263: ("unlink", _AT_FOLDER),
    264: ("rename", _AT_FOLDER),
    268: ("chmod", _AT_FOLDER),
    316: ("rename", _AT_FOLDER),
}
_MMAP = 9
_ANONYMOUS = 0x20
_FOR_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT
_LARGE = 1 << 20  # bytes of an allocation that counts
# Of struct user_regs_struct, in words of 8 bytes.
_RAX = 10
_ORIG_RAX = 15
_ARGUMENTS = (14, 13, 12, 7, 9, 8)
_WORDS = 27
_TRACEME = 0
_CONT = 7
_GETREGS = 12
_SETREGS = 13
_SETOPTIONS = 0x4200
# fork, vfork, clone, exec, seccomp; kill all if the tracer ends
_OPTIONS = 0x2 | 0x4 | 0x8 | 0x10 | 0x80 | 0x100000
_SECCOMP_EVENT = 7
_ALL = 0x40000000  # of waitpid: threads too


class Traced(NamedTuple):
    """What happened.

    :param calls: name and path of each call that counted.
    :param status: exit status of the command; negative: the signal that ended it.
    :param seconds: from the n-th call until the last process had ended.
    """

    calls: list[str]
    status: int
    stdout: str
    stderr: str
    seconds: float


def traced(
    command: list[str],
    folder: Path,
    n: int,
    action: str,
    environment: dict[str, str] | None = None,
    disk: Path | None = None,
) -> Traced:
    """Run a command and do something at its n-th call.

    :param folder: only writes to files below it count.
    :param action: ``KILL`` or ``FULL`` (the n-th write fails: no space left), or ``NO_MEMORY`` (the
        n-th allocation of at least 1 MiB fails); ``KILL_PARENT``: the command itself is killed, and
        the processes that it has started are not; ``CUT``: the disk stays as it is.
    :param disk: image of the disk in which the folder lies, for ``CUT``; it is copied beside it.
    """
    plan = json.dumps(
        {
            "folder": os.path.realpath(folder),
            "n": n,
            "action": action,
            "disk": None if disk is None else str(disk),
        }
    )
    done = subprocess.run(
        [sys.executable, __file__, plan, *command],
        capture_output=True,
        text=True,
        errors="replace",
        env=environment,
        check=False,
    )
    *lines, last = done.stdout.rstrip("\n").split("\n")
    if done.returncode or not last.startswith("{"):
        raise RuntimeError(f"the tracer failed: {done.stdout}{done.stderr}")
    result: dict[str, Any] = json.loads(last)
    return Traced(
        result["calls"], result["status"], "\n".join(lines), done.stderr, result["seconds"]
    )


class _Tracer:
    """Traces one command with all of its threads and processes."""

    def __init__(self, plan: dict[str, Any]) -> None:
        self._folder = plan["folder"]
        self._n = plan["n"]
        self._action = plan["action"]
        self._disk = plan["disk"]
        self._child = 0
        self._acted_s = time.monotonic()
        self._libc = ctypes.CDLL(None, use_errno=True)
        self._libc.ptrace.argtypes = [
            ctypes.c_long,
            ctypes.c_long,
            ctypes.c_void_p,
            ctypes.c_void_p,
        ]
        self.calls: list[str] = []

    def run(self, command: list[str]) -> int:
        """Run the command and return its exit status; negative: the signal that ended it."""
        self._child = child = os.fork()
        if child == 0:
            self._libc.ptrace(_TRACEME, 0, None, None)
            os.kill(os.getpid(), signal.SIGSTOP)
            self._install_filter()
            os.execvp(command[0], command)
        os.waitpid(child, 0)
        self._libc.ptrace(_SETOPTIONS, child, None, _OPTIONS)
        self._libc.ptrace(_CONT, child, None, None)
        status = 0
        while True:
            try:
                thread, state = os.waitpid(-1, _ALL)
            except ChildProcessError:
                return status
            if not os.WIFSTOPPED(state):
                status = os.waitstatus_to_exitcode(state) if thread == child else status
                continue
            sent = os.WSTOPSIG(state)
            event = state >> 16
            if event == _SECCOMP_EVENT:
                self._at_call(thread)
            # A new thread or process begins with a SIGSTOP of the tracing, which it must not get.
            passed = 0 if event or sent in (signal.SIGSTOP, signal.SIGTRAP) else sent
            self._libc.ptrace(_CONT, thread, None, passed)

    def _install_filter(self) -> None:
        numbers = [_MMAP] if self._action == NO_MEMORY else sorted(_WRITES)
        # Load the call's number; for each of ours, jump to the last instruction, which asks the
        # tracer.
        code = struct.pack("HBBI", 0x20, 0, 0, 0)
        for k, number in enumerate(numbers):
            code += struct.pack("HBBI", 0x15, len(numbers) - k, 0, number)
        code += struct.pack("HBBI", 0x06, 0, 0, 0x7FFF0000) + struct.pack(
            "HBBI", 0x06, 0, 0, 0x7FF00000
        )
        buffer = ctypes.create_string_buffer(code)
        program = struct.pack("HxxxxxxQ", len(code) // 8, ctypes.addressof(buffer))
        no_new_privileges = 38
        seccomp = 22
        with_filter = 2
        self._libc.prctl(no_new_privileges, 1, 0, 0, 0)
        if self._libc.prctl(seccomp, with_filter, ctypes.c_char_p(program), 0, 0):
            os.write(2, b"no seccomp filter\n")
            os._exit(99)

    def _at_call(self, thread: int) -> None:
        registers = (ctypes.c_ulonglong * _WORDS)()
        if self._libc.ptrace(_GETREGS, thread, None, registers):
            return
        arguments = [registers[k] for k in _ARGUMENTS]
        name = self._counted(thread, registers[_ORIG_RAX], arguments)
        if name is None:
            return
        self.calls.append(name)
        if len(self.calls) != self._n:
            return
        self._acted_s = time.monotonic()
        if self._action == CUT:
            copy_disk(self._disk)
        if self._action in (KILL, CUT, KILL_PARENT):
            is_parent = self._action == KILL_PARENT
            os.kill(self._child if is_parent else _process_of(thread), signal.SIGKILL)
            return
        registers[_ORIG_RAX] = 2**64 - 1  # no call
        registers[_RAX] = 2**64 - (_LACK_OF_MEMORY if self._action == NO_MEMORY else _DISK_FULL)
        self._libc.ptrace(_SETREGS, thread, None, registers)

    def _counted(self, thread: int, number: int, arguments: list[int]) -> str | None:
        """Return the name and the path of a call that counts."""
        if number == _MMAP:
            # some protection: used
            is_large = arguments[3] & _ANONYMOUS and arguments[1] >= _LARGE and arguments[2]
            return f"mmap {arguments[1] >> 20} MiB" if is_large else None
        name, kind = _WRITES[number]
        if name == "open" and not arguments[1 + (kind == _AT_FOLDER)] & _FOR_WRITING:
            return None
        try:
            if kind == _AT_FD:
                path = os.readlink(f"/proc/{thread}/fd/{arguments[0] & 0xFFFFFFFF}")
            else:
                first = (
                    ctypes.c_int(arguments[0] & 0xFFFFFFFF).value if kind == _AT_FOLDER else -100
                )
                base = os.readlink(
                    f"/proc/{thread}/cwd" if first < 0 else f"/proc/{thread}/fd/{first}"
                )
                path = os.path.normpath(
                    os.path.join(base, _text(thread, arguments[kind == _AT_FOLDER]))
                )
        except OSError:
            return None
        return f"{name} {path}" if path.startswith(self._folder + os.sep) else None


def copy_disk(disk: str) -> None:
    """Copy the image of a disk as it is: with what the file system has written to it so far."""
    subprocess.run(["cp", "--sparse=always", disk, f"{disk}.cut"], check=True)


def _text(thread: int, address: int) -> str:
    """Return the text at an address of another process."""
    with open(f"/proc/{thread}/mem", "rb", buffering=0) as memory:
        memory.seek(address)
        found = b""
        while b"\0" not in found and len(found) < 4096:
            # not beyond the page, which may be the last one
            found += memory.read(4096 - (address + len(found)) % 4096)
    return os.fsdecode(found.partition(b"\0")[0])


def _process_of(thread: int) -> int:
    lines = Path(f"/proc/{thread}/status").read_text("utf-8").splitlines()
    return int(next(line.split()[1] for line in lines if line.startswith("Tgid:")))


if __name__ == "__main__":
    tracer = _Tracer(json.loads(sys.argv[1]))
    ended = tracer.run(sys.argv[2:])
    seconds = time.monotonic() - tracer._acted_s
    found = {"calls": tracer.calls, "status": ended, "seconds": seconds}
    print("\n" + json.dumps(found), flush=True)
