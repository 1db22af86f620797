# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line as a process: ``python -m scope.scope_addon``. Even a signal while it is loaded leads to a message.

Loading takes a second. Nothing has been written then, and Python would end with a traceback, or silently.
"""

from __future__ import annotations

import os
import signal
from types import FrameType


def main() -> None:
    """Load the command line and run it."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stop)
    from .cli import run

    run()


def _stop(number: int, _: FrameType | None) -> None:
    os.write(2, b"scope: stopped\n")
    os._exit(130)


if __name__ == "__main__":
    main()
