# SPDX-License-Identifier: GPL-3.0-or-later
"""Observe processes that a test did not start itself."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

# A defect is found that late; a worker, whose priority is low, may take minutes on a computer that has other work.
_LONGEST_S = 900.0


def wait_for(condition: Callable[[], object]) -> None:
    """Wait until the condition holds."""
    end = time.monotonic() + _LONGEST_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def runs(pid: int) -> bool:
    """Return whether a process exists and, where there is /proc, is not a zombie."""
    if not Path("/proc/self").exists():  # macOS
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return False
        return True
    try:
        return Path(f"/proc/{pid}/stat").read_text("utf-8").rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False
