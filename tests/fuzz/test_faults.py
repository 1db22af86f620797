# SPDX-License-Identifier: GPL-3.0-or-later
"""The n-th system call of a write fails, for every n: the old result or the new one, no leftovers,
a good next run.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import numpy as np
from scope.scope_addon.job.cache import Cache
from scope.solver.body import Body
from scope.solver.errors import ScopeError

from ..made_motion import made_motion
from .faults import all_faults, contents, failing


def test_a_motion_is_the_old_or_the_new_one(tmp_path: Path, body: Body) -> None:
    first, second = (made_motion(body, np.zeros((2, 72)), np.full((2, 3), x)) for x in (0.0, 1.0))
    first.save(tmp_path / "out.npz")
    old = contents(tmp_path)
    second.save(tmp_path / "out.npz")
    new = contents(tmp_path)
    first.save(tmp_path / "out.npz")
    count = all_faults(
        lambda: second.save(tmp_path / "out.npz"), lambda: contents(tmp_path), old, new
    )
    assert count > 4


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
