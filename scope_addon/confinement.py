# SPDX-License-Identifier: GPL-3.0-or-later
"""Confine a process that decodes other people's files, in case one of them takes over a decoder.

From then on the process writes in a few folders only, starts no program, and opens no connection.
Linux alone offers this to a program without privileges: Landlock limits files (from 6.2 on, when it
learned of truncation), seccomp system calls. Elsewhere, and in containers that forbid either,
nothing changes. Neither can be taken back, and what the process starts inherits both.

Landlock does not reach threads that run already. The module needs the standard library alone, and
is also loaded by scripts without the package.
"""

from __future__ import annotations

import ctypes
import errno
import os
import platform
import struct
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

_CREATE_RULESET = 444
_ADD_RULE = 445
_RESTRICT_SELF = 446
_ASK_FOR_VERSION = 1
_OLDEST_VERSION = 3
_PATH_BENEATH = 1
_NO_NEW_PRIVILEGES = 38  # of prctl

# Rights of Landlock.
_READ = 1 << 2 | 1 << 3
_EXECUTE = 1 << 0
_WRITE_FILE = 1 << 1 | 1 << 14
_MAKE_ANYTHING = sum(1 << bit for bit in range(4, 14))
_OF_FILES = _WRITE_FILE | 1 << 2
_MAKE_SPECIAL = 1 << 6 | 1 << 9 | 1 << 10 | 1 << 11  # devices, sockets, pipes
_WRITE = _WRITE_FILE | _MAKE_ANYTHING & ~_MAKE_SPECIAL

# What every process may write to: devices as far as their own permissions allow it, and itself.
_DEVICES = ("/dev", "/proc/self")
_SHARED_MEMORY = "/dev/shm"
# What every program has to read.
_SYSTEM = ("/usr", "/lib", "/lib64", "/etc", "/nix", "/gnu", "/proc", "/sys", "/dev")

# By processor: how seccomp calls it, and numbers of system calls: seccomp itself, socket, the two
# that start programs, and those that reach into other processes or are a way around the others.
_PROCESSORS = {
    "x86_64": (0xC000003E, 317, (41,), (59, 322), (101, 311, 425)),
    "aarch64": (0xC00000B7, 277, (198,), (221, 281), (117, 271, 425)),
}
_OTHER_NUMBERS = 0x40000000  # from here on, calls have other numbers on x86-64
_ALLOW = 0x7FFF0000
_REFUSE = 0x00050000 | errno.EPERM
_LOAD = 0x20
_IS_EQUAL = 0x15
_IS_AT_LEAST = 0x35
_RETURN = 0x06
_SET_FILTER = 1
_ALL_THREADS = 1


def confine_capture(
    folders: Iterable[Path], *, connects: bool = False, starts_programs: bool = False
) -> None:
    """Confine this process to what a capture needs; it may read everything, since a user's files
    lie anywhere.

    :param folders: of the results and of the cache. Where one does not exist yet, the nearest
        above it counts.
    :param connects: whether it needs a network.
    :param starts_programs: whether it needs further processes.
    """
    from ..solver.body_file import ASSETS
    from .private_folder import lasting_folder
    from .temporary import system_folder

    lasting = lasting_folder()
    machine_code = ASSETS.parent / "solver" / "__pycache__"
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        machine_code = Path(chosen)
    elif lasting is not None and not os.access(machine_code, os.W_OK):
        machine_code = lasting.with_name("numba")
    caches = [machine_code]
    if lasting is not None:
        caches.append(lasting)
        # What CUDA compiles would otherwise be elsewhere.
        os.environ.setdefault("CUDA_CACHE_PATH", str(lasting / "cuda"))
    confine([*folders, *caches, system_folder()], None, connects, starts_programs)


def folders_of(path: Path) -> list[Path]:
    """Return the folders in which writing to a path, which may be a link, makes files."""
    return [path.parent, path.resolve().parent]


def confine(
    writable: Iterable[Path],
    readable: Iterable[Path] | None = None,
    connects: bool = False,
    starts_programs: bool = False,
) -> None:
    """Confine this process as far as the system can.

    :param writable: folders.
    :param readable: folders and files beside those of the system; None: everything.
    :param connects: whether it may open connections, also to programs on this computer.
    :param starts_programs: whether it may start others.
    """
    if sys.platform == "linux" and ctypes.sizeof(ctypes.c_void_p) == 8:
        library = ctypes.CDLL(None)
        library.syscall.argtypes = [ctypes.c_long] * 5
        library.syscall.restype = ctypes.c_long
        library.prctl(_NO_NEW_PRIVILEGES, *map(ctypes.c_ulong, (1, 0, 0, 0)))
        if limits_files():
            _limit_files(library, writable, readable)
        _limit_calls(library, connects, starts_programs)


def limits_files() -> bool:
    """Return whether this system can limit files."""
    if sys.platform != "linux":
        return False
    library = ctypes.CDLL(None)
    return int(library.syscall(_CREATE_RULESET, None, 0, _ASK_FOR_VERSION)) >= _OLDEST_VERSION


def _limit_files(library: Any, writable: Iterable[Path], readable: Iterable[Path] | None) -> None:
    handled = _WRITE_FILE | _MAKE_ANYTHING
    if readable is not None:
        handled |= _READ | _EXECUTE
    ruleset = _call(library, _CREATE_RULESET, struct.pack("=Q", handled), 8, 0)
    if ruleset < 0:
        return
    rules = [(_nearest_folder(folder), _WRITE) for folder in writable]
    rules += [(Path(device), _WRITE_FILE) for device in _DEVICES]
    rules.append((Path(_SHARED_MEMORY), _WRITE))
    if readable is not None:
        rules += [(path, _READ) for path in (*map(Path, _SYSTEM), *readable)]
    for path, rights in rules:
        # What does not exist needs no rule.
        with suppress(OSError):
            # It stays open: a folder that is mounted when needed would be unmounted meanwhile, and
            # its rule be lost.
            handle = os.open(path, getattr(os, "O_PATH", 0) | os.O_CLOEXEC)
            if not path.is_dir():
                rights &= _OF_FILES
            _call(library, _ADD_RULE, ruleset, _PATH_BENEATH, struct.pack("=Qi", rights, handle), 0)
    _call(library, _RESTRICT_SELF, ruleset, 0)
    os.close(ruleset)


def _nearest_folder(path: Path) -> Path:
    return next((each for each in (path, *path.absolute().parents) if each.is_dir()), path)


def _limit_calls(library: Any, connects: bool, starts_programs: bool) -> None:
    """Have the system refuse calls, in all threads, as if the user were not permitted to.

    https://www.kernel.org/doc/html/latest/userspace-api/seccomp_filter.html
    """
    if platform.machine() not in _PROCESSORS:
        return
    processor, seccomp, sockets, programs, others = _PROCESSORS[platform.machine()]
    refused = [*others, *(() if connects else sockets), *(() if starts_programs else programs)]
    # The data are the call's number, then the processor. A jump counts the instructions to skip if
    # the condition holds, and if it does not.
    steps = [(_LOAD, 0, 0, 4), (_IS_EQUAL, 1, 0, processor), (_RETURN, 0, 0, _REFUSE)]
    steps += [(_LOAD, 0, 0, 0), (_IS_AT_LEAST, len(refused) + 1, 0, _OTHER_NUMBERS)]
    for number, call in enumerate(refused):
        steps.append((_IS_EQUAL, len(refused) - number, 0, call))
    steps += [(_RETURN, 0, 0, _ALLOW), (_RETURN, 0, 0, _REFUSE)]
    program = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *step) for step in steps))
    described = struct.pack("@HP", len(steps), ctypes.addressof(program))
    _call(library, seccomp, _SET_FILTER, _ALL_THREADS, described)


def _call(library: Any, *arguments: int | bytes) -> int:
    """Call the system, with pointers to structures; return its answer, negative if it refuses."""
    structures = [
        ctypes.create_string_buffer(each, len(each)) if isinstance(each, bytes) else each
        for each in arguments
    ]
    values = [each if isinstance(each, int) else ctypes.addressof(each) for each in structures]
    return int(library.syscall(*values, *[0] * (5 - len(values))))
