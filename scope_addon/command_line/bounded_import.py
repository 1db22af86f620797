# SPDX-License-Identifier: GPL-3.0-or-later
"""End the process when Blender's importer takes too much time or memory for a file.

A few bytes of a rig's file can ask for any work, which nothing can interrupt but the end of the
process. This is for the check before the capture, when nothing has been done that could be lost.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..capture.perception.adapters.network_server import used_bytes
from ..errors import FAILED
from ..footage import display_text
from ..scene.budget import BASE_BYTES
from ..temporary import discard_all

_INTERVAL_S = 0.1
# A file may take these, and in addition as many seconds for a megabyte, and as many bytes for a
# byte.
BASE_S = 30.0
S_PER_MB = 1.0
BYTES_PER_BYTE = 20


@contextmanager
def bounded_import(path: Path) -> Iterator[None]:
    """End the process with one sentence when the block takes too long, or too much memory, for a
    file of its size.
    """
    size = path.stat().st_size
    longest_s = BASE_S + S_PER_MB * size / 1e6
    most_bytes = BASE_BYTES + BYTES_PER_BYTE * size
    done = threading.Event()
    # While Blender imports, the descriptor 2 leads nowhere.
    messages = os.dup(2)
    at_start = used_bytes()

    def watch() -> None:
        end = time.monotonic() + longest_s
        while not done.wait(_INTERVAL_S):
            if time.monotonic() > end:
                _stop(
                    messages,
                    f"{path}: Blender did not finish importing this file within {longest_s:.0f} s",
                )
            if used_bytes() - at_start > most_bytes:
                _stop(
                    messages,
                    f"{path}: importing this file takes more than {most_bytes / 1e9:.1f} GB of "
                    "memory",
                )

    watcher = threading.Thread(target=watch, name="scope-import", daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        watcher.join()
        os.close(messages)


def _stop(messages: int, what: str) -> None:
    """Say in one line why the process ends, and end it.

    :param messages: open file.
    """
    discard_all()
    text = display_text(f"scope: {what}; export it again or choose another")
    os.write(messages, f"{text}\n".encode())
    os._exit(FAILED)
