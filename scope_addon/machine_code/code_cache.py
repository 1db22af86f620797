# SPDX-License-Identifier: GPL-3.0-or-later
"""The machine code of one kernel on disk, in place of numba's own cache.

Numba's cache fails on damaged files, for ever; throws a kernel's code away when its own file has
changed, but not when one of those has that are inlined into it; and depends on the sources' times
and the exact processor.

Files are checked before they are used: a file's content is unpickled and run, so whoever can write
it can run anything as the user.

- A folder that comes with the program is trusted as the program's sources are: who can write there
  can change those.
- Anywhere else only a file of the user's own, or the system's, that nobody else may write to is
  opened, wherever it lies: a folder in which others can write, such as the system's temporary one,
  is no way in. (Windows, which keeps the user's folders from others by itself, reports no owner.)
- The checksum finds damage (a full disk, a power cut, flipped bits), which would crash the process.
  It is not a signature: it says nothing about who wrote the file.
"""

from __future__ import annotations

import errno
import hashlib
import inspect
import logging
import os
import stat
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from numba.core.caching import _Cache

from ..atomic_write import complete_file
from ..temporary import remove, remove_abandoned
from .code_folders import SOLVER, Area, digest_of, mark_used, name_in_package
from .numba_internals import load_result, payload_of, use_cache, use_kernel_compiler

_LOG = logging.getLogger(__name__)
# of each kernel that this process had to compile so far: the folder of its source
_compiling: list[Path] = []
_refused: list[OSError] = []  # why code could not be kept
_announced: list[Path] = []  # the folder of which that has been said, once in a process
SUFFIX = ".code"
_MAGIC = b"Scope machine code 1\n"
# a named pipe must not block
_OPEN = os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0)


def compiled_kernels(sources: Path = SOLVER) -> int:
    """Return how many kernels this process had to compile so far, those in progress included.

    :param sources: only those in this folder count.
    """
    return sum(sources == folder or sources in folder.parents for folder in list(_compiling))


class ShippedOrOwnCode:
    """Keeps the machine code of all kernels: see `scope.solver.code_keeper.CodeKeeper`."""

    def prepare(self, kernel: Any) -> None:
        """Let a kernel run its own copies of the kernels that it calls."""
        use_kernel_compiler(kernel)

    def keep(self, kernel: Any) -> None:
        """Keep a kernel's machine code in a `CodeCache`."""
        use_cache(kernel, CodeCache(kernel.py_func))

    def has_code(self, kernel: Any) -> bool:
        """Whether there is a file of a kernel, whatever it contains."""
        return bool(kernel._cache.has_code())


class CodeCache(_Cache):
    """The code of a kernel's signatures, one file for each. What cannot be read or kept is compiled
    again.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        code = function.__code__
        module = name_in_package(function.__module__)
        self._function = module, function.__qualname__, code.co_firstlineno
        self._source = Path(inspect.getfile(function)).parent
        self._area = _area_of(function.__module__, self._source)
        name = f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}"
        self._name = name.replace("<", "").replace(">", "")
        # What a closure refers to is not in the sources.
        self._enabled = function.__closure__ is None

    @property
    def cache_path(self) -> str:
        """The folder that code is written to."""
        return str(self._area.own_folders()[0])

    def has_code(self) -> bool:
        """Whether there is code of any signature."""
        return self._enabled and any(
            any(folder.glob(f"{self._name}-*{SUFFIX}"))
            for folder, _ in self._area.folders()
            if folder.is_dir()
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the code for a signature; None if it must be compiled."""
        target_context.refresh()
        for folder, trusted in self._area.folders() if self._enabled else ():
            path = folder / self._file_name(sig)
            key = self._key(sig)
            payload = read_code(path, key, trusted=trusted)
            if payload is None:
                continue
            try:
                result = load_result(target_context, payload)
            except Exception:  # whatever an unusable file leads to, compiling it again mends it
                remove(path)
                continue
            if not trusted:
                _used(self._area, folder)
            return result
        _compiling.append(self._source)
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code of a signature, if there is a place for it."""
        if (
            not self._enabled
            or data.library.has_dynamic_globals
            or any(not x.can_cache for x in data.lifted)
        ):
            return
        payload = payload_of(data)
        for folder in self._area.own_folders():
            try:
                write_code(folder / self._file_name(sig), self._key(sig), payload)
            except OSError as error:
                _refused.append(error)
                continue
            _used(self._area, folder)
            return
        if not _announced:
            _announced.append(folder)
            reason = _refused[-1].strerror or _refused[-1]
            _LOG.warning(
                "The compiled solver cannot be kept in %s (%s): it works, but starts slowly.",
                folder,
                reason,
            )

    def enable(self) -> None:
        """Use the files."""
        self._enabled = True

    def disable(self) -> None:
        """Ignore the files."""
        self._enabled = False

    def flush(self) -> None:
        """Remove the code of all signatures that this processor's own folder has."""
        for folder in self._area.own_folders():
            for path in folder.glob(f"{self._name}-*{SUFFIX}"):
                remove(path)

    def _key(self, sig: Any) -> str:
        return repr((self._function, str(sig)))

    def _file_name(self, sig: Any) -> str:
        return f"{self._name}-{digest_of(self._key(sig))[:12]}{SUFFIX}"


@cache
def _area_of(module: str, sources: Path) -> Area:
    """Return the area of a module: the whole solver, or the package that contains the module."""
    if sources == SOLVER or SOLVER in sources.parents:
        return Area(SOLVER.name, SOLVER)
    return Area(name_in_package(module).rpartition(".")[0], sources)


@cache
def _used(area: Area, folder: Path) -> None:
    """Note, once in a process, that a folder is in use; remove what it replaces, and what a kill
    left in it.
    """
    mark_used(folder)
    remove_abandoned(folder)
    area.remove_stale(folder)


def read_code(path: Path, key: str, *, trusted: bool) -> bytes | None:
    """Return what `write_code` wrote; None if there is no such file, or none that may be used.

    A damaged file is removed, so that it is written anew.

    :param key: what the code was compiled from and for; part of the checksum, so that a renamed
        file does not pass.
    :param trusted: whether the folder came with the program.
    """
    try:
        descriptor = os.open(path, _OPEN)
    except OSError:
        return None
    try:
        with open(descriptor, "rb") as file:
            status = os.fstat(descriptor)
            if not stat.S_ISREG(status.st_mode) or not (trusted or _only_ours(status)):
                return None
            content = file.read()
    except OSError:
        return None
    payload = content[len(_header(key, b"")) :]
    if content != _header(key, payload) + payload:
        remove(path)
        return None
    return payload


def write_code(path: Path, key: str, payload: bytes) -> None:
    """Write a file that is either complete or not there.

    :raises OSError: the system refused.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # Nobody else may write to it, also where new files are the group's as well: it would not be
    # read again.
    with complete_file(path, durable=False, mode=0o644) as temporary:
        temporary.write_bytes(_header(key, payload) + payload)
    if not _only_ours(path.stat()):
        remove(path)
        raise PermissionError(errno.EACCES, "others can write to files there")


def _header(key: str, payload: bytes) -> bytes:
    return _MAGIC + hashlib.sha256(key.encode() + b"\n" + payload).digest()


def _only_ours(status: os.stat_result) -> bool:
    """Whether only this user or the system can have written the file."""
    if not hasattr(os, "geteuid"):
        return True
    return status.st_uid in (0, os.geteuid()) and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
