# SPDX-License-Identifier: GPL-3.0-or-later
"""Freed memory goes back to the system, as the system itself says."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

# Blocks that glibc takes from its heap; the few that stay keep it from returning the others by
# itself.
PROGRAM = """
import os
from scope.scope_addon.capture.stages.solve import return_freed_memory

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
