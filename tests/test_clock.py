# SPDX-License-Identifier: GPL-3.0-or-later
"""Seconds of stages by a clock that the test turns.

Freed memory goes back to the system, as the system itself says.
"""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest
from scope.scope_addon.clock import StageClock


def test_stages_add_up_also_when_they_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr("scope.scope_addon.clock.time.perf_counter", lambda: now[0])
    found = StageClock()
    for name, seconds in (("decode", 1.0), ("solver", 2.0), ("decode", 0.5)):
        with found.stage(name):
            now[0] += seconds
        now[0] += 40.0  # between them

    def fail() -> None:
        with found.stage("solver"):
            now[0] += 0.5
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert found.seconds == {"decode": 1.5, "solver": 2.5}
    assert found.rates(30) == {"decode": 20.0, "solver": 12.0, "total": 7.5}


def test_a_stage_that_took_no_time_has_a_rate() -> None:
    found = StageClock()
    found.seconds["decode"] = 0.0
    assert found.rates(3)["decode"] > 1e6


# Blocks that glibc takes from its heap; the few that stay keep it from returning the others by
# itself.
PROGRAM = """
import os
from scope.scope_addon.capture.solve import return_freed_memory

def resident_mib():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20

blocks = [bytearray(60_000) for _ in range(3000)]
blocks = blocks[::50]
kept = resident_mib()
return_freed_memory()
print(kept - resident_mib())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library returns it itself")
def test_memory_between_blocks_in_use_is_returned() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True
    )
    assert float(done.stdout) > 100.0
