# SPDX-License-Identifier: GPL-3.0-or-later
"""Memory that was freed goes back to the system between stages, which need it in other sizes."""

from __future__ import annotations

import ctypes
import sys
from contextlib import suppress


def return_freed_memory() -> None:
    """Have glibc return what it keeps for later; nothing with other C libraries, which return it
    themselves.
    """
    if sys.platform.startswith("linux"):
        with suppress(OSError, AttributeError):  # musl has no such function
            ctypes.CDLL(None).malloc_trim(0)
