# SPDX-License-Identifier: GPL-3.0-or-later
"""The n-th system call of a write fails, for every n: the old result or the new one, no leftovers, a good next run."""

from __future__ import annotations

import builtins
import errno
import io
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scope.scope_addon.job.cache import Cache
from scope.scope_addon.retarget.bone_map import REQUIRED, BoneMap, load_bone_map, save_bone_map
from scope.solver.body import Body
from scope.solver.errors import ScopeError

from ..made_motion import made_motion

_CALLS = (
    *((os, name) for name in ("open", "replace", "rename", "mkdir", "chmod", "close")),
    *((tempfile, name) for name in ("mkstemp", "mkdtemp")),
    *((module, "open") for module in (builtins, io)),
)


class _File:
    """A file of which one write fails; everything else is the file's own."""

    def __init__(self, file: Any, count: Callable[[], None]) -> None:
        self._file, self._count = file, count

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
def failing(n: int) -> Iterator[list[int]]:
    """Let the n-th call fail with a full disk; give a list of the calls so far."""
    calls: list[int] = []

    def count() -> None:
        calls.append(len(calls))
        if len(calls) == n:
            raise OSError(errno.ENOSPC, "No space left on device")

    def faulty(call: Callable[..., Any], name: str) -> Callable[..., Any]:
        def wrapped(*arguments: Any, **named: Any) -> Any:
            if name == "close":  # closes, and reports that the disk is full, as file systems on a network do
                call(*arguments)
                count()
                return None
            count()
            made = call(*arguments, **named)
            mode = str(arguments[1] if len(arguments) > 1 else named.get("mode", "r"))
            return _File(made, count) if isinstance(made, io.IOBase) and "r" not in mode else made

        return wrapped

    with pytest.MonkeyPatch.context() as patch:
        for module, name in _CALLS:
            patch.setattr(module, name, faulty(getattr(module, name), name))
        yield calls


def all_faults(write: Callable[[], None], state: Callable[[], object], old: object, new: object) -> int:
    """Write with a fault at every call in turn; return how many there were.

    :param state: everything in the folder, to be ``old`` or ``new`` after each.
    """
    n, was, said = 0, old, []
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
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_motion_is_the_old_or_the_new_one(tmp_path: Path, body: Body) -> None:
    first, second = (made_motion(body, np.zeros((2, 72)), np.full((2, 3), x)) for x in (0.0, 1.0))
    first.save(tmp_path / "out.npz")
    old = contents(tmp_path)
    second.save(tmp_path / "out.npz")
    new = contents(tmp_path)
    first.save(tmp_path / "out.npz")
    count = all_faults(lambda: second.save(tmp_path / "out.npz"), lambda: contents(tmp_path), old, new)
    assert count > 4


def test_a_bone_map_is_the_old_or_the_new_one(tmp_path: Path) -> None:
    path = tmp_path / "map.json"
    first, second = (BoneMap({f"{name} {part}": part for part in REQUIRED}) for name in ("A", "B"))
    save_bone_map(second, path)
    new = contents(tmp_path)
    save_bone_map(first, path)
    assert all_faults(lambda: save_bone_map(second, path), lambda: contents(tmp_path), contents(tmp_path), new) > 4
    assert load_bone_map(path) == second


def test_the_cache_has_the_old_or_the_new_capture(tmp_path: Path) -> None:
    """The job's own folder may stay: whoever made it removes it, see `WorkerProcess.close`."""
    cache = Cache(tmp_path)

    def keep(content: bytes, name: str) -> bool:
        """Return whether there was a fault; it may have left a folder that is removed later."""
        job = tmp_path / "jobs" / name
        job.mkdir(parents=True)
        (job / "person1.npz").write_bytes(content)
        with failing(int(name)) as calls, suppress(ScopeError):
            cache.keep(job, "key", ["person1.npz"], {"people": 1})
        return len(calls) >= int(name)

    def state() -> object:
        found = cache.find("key")
        others = [p.name for p in (tmp_path / "captures").iterdir() if p.name != "key"]
        return found and found.motions[0].read_bytes(), others

    keep(b"old", "1000")
    n = 1
    while keep(b"new", str(n)):
        assert state() in ((b"old", []), (b"new", [])), f"after a fault at call {n}"
        if state() == (b"new", []):
            keep(b"old", str(1000 + n))
        n += 1
    assert n > 4
    assert state() == (b"new", [])
