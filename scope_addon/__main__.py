# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line as a process: ``python -m scope.scope_addon``. Even a signal while it is loaded
leads to a message.

Loading takes a moment. Nothing has been written then, and Python would end with a traceback, or
silently.
"""

from __future__ import annotations

import os
import signal
from types import FrameType

from .command_line.signals import stopping_signals
from .installed import address_space_limit

# bytes of address space; with less, numpy may load in part, and hang or fail later
_MIN_BYTES = 300_000_000


def main() -> None:
    """Load the command line and run it."""
    for number in stopping_signals():
        signal.signal(number, _stop)
    if _memory_is_limited_to(_MIN_BYTES):
        _stop_without_memory()
    try:
        from .cli import run
    except (MemoryError, ImportError, OSError) as error:
        # A library that cannot be loaded may have met the shell's limit; each says so in its own
        # words.
        if not (isinstance(error, MemoryError) or _memory_is_limited_to(1_000_000_000)):
            raise
        _stop_without_memory()
    run()


def _memory_is_limited_to(most: int) -> bool:
    """Return whether the shell limits this process to less than so many bytes."""
    limit = address_space_limit()
    return limit is not None and limit < most


def _stop_without_memory() -> None:
    os.write(
        2, b"scope: there is too little memory to load the program; free memory and try again\n"
    )
    os._exit(1)


def _stop(number: int, _: FrameType | None) -> None:
    os.write(2, b"scope: stopped\n")
    os._exit(130)


if __name__ == "__main__":
    main()
