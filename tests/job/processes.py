# SPDX-License-Identifier: GPL-3.0-or-later
"""Observe processes that a test did not start itself."""

from __future__ import annotations

import time
from collections.abc import Callable

import psutil

# A defect is found that late; a worker, whose priority is low, may take minutes on a computer that
# has other work.
_LONGEST_S = 900.0


def wait_for(condition: Callable[[], object]) -> None:
    """Wait until the condition holds."""
    end = time.monotonic() + _LONGEST_S
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def runs(pid: int) -> bool:
    """Return whether a process exists and is no zombie."""
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False
