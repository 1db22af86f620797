# SPDX-License-Identifier: GPL-3.0-or-later
"""Let the n-th system call of a write fail, for every n."""

from __future__ import annotations

import builtins
import errno
import io
import os
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from scope.solver.errors import ScopeError

_CALLS = (
    *((os, name) for name in ("open", "replace", "rename", "mkdir", "chmod", "close")),
    (tempfile, "mkdtemp"),
    *((module, "open") for module in (builtins, io)),
)


class _File:
    """A file of which one write fails; everything else is the file's own."""

    def __init__(self, file: Any, count: Callable[[], None]) -> None:
        self._file = file
        self._count = count

    def write(self, data: Any) -> Any:
        self._count()
        return self._file.write(data)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def __enter__(self) -> _File:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()


@contextmanager
def failing(n: int, without: tuple[str, ...] = ()) -> Iterator[list[int]]:
    """Let the n-th call fail with a full disk; give a list of the calls so far. Those of threads
    that run already do not count.

    :param without: names of calls that do not count.
    """
    calls: list[int] = []
    others = set(threading.enumerate()) - {threading.current_thread()}

    def count() -> None:
        if threading.current_thread() in others:
            return
        calls.append(len(calls))
        if len(calls) == n:
            raise OSError(errno.ENOSPC, "No space left on device")

    def faulty(call: Callable[..., Any], name: str) -> Callable[..., Any]:
        def wrapped(*arguments: Any, **named: Any) -> Any:
            # closes, and reports that the disk is full, as file systems on a network do
            if name == "close":
                call(*arguments)
                count()
                return None
            count()
            made = call(*arguments, **named)
            mode = str(arguments[1] if len(arguments) > 1 else named.get("mode", "r"))
            return _File(made, count) if isinstance(made, io.IOBase) and "r" not in mode else made

        return wrapped

    with pytest.MonkeyPatch.context() as patch:
        for module, name in (call for call in _CALLS if call[1] not in without):
            patch.setattr(module, name, faulty(getattr(module, name), name))
        yield calls


def all_faults(
    write: Callable[[], None], state: Callable[[], object], old: object, new: object
) -> int:
    """Write with a fault at every call in turn; return how many there were.

    :param state: everything in the folder, to be ``old`` or ``new`` after each.
    """
    n = 0
    was = old
    said = []
    while True:
        n += 1
        with failing(n) as calls:
            try:
                write()
                failed = False
            except ScopeError as error:
                failed = True
                said.append(str(error))
        assert state() in (was, new), f"after a fault at call {n}"
        was = state()
        if len(calls) < n:
            assert not failed
            assert state() == new
            assert not any("\n" in text for text in said)
            return n - 1


def contents(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }
