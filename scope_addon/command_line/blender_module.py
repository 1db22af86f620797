# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's module in a shell: its temporary folder, which lies inside one of ours, and limits to
what its importers may take.

Blender makes a folder ``blender_XXXXXX`` when its module is loaded, and removes it at a normal exit
alone.

A few bytes of a rig's file can ask for any work, which nothing can interrupt but the end of the
process. This is for the check before the capture, when nothing has been done that could be lost.
"""

from __future__ import annotations

import importlib
import os
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..capture.perception.adapters.network_server import used_bytes
from ..errors import FAILED
from ..footage import display_text
from ..scene.budget import BASE_BYTES
from ..temporary import TEMPORARY_VARIABLES, discard_all, new_folder, remove

_INTERVAL_S = 0.1
# A file may take these, and in addition as many seconds for a megabyte, and as many bytes for a
# byte.
BASE_S = 30.0
S_PER_MB = 1.0
BYTES_PER_BYTE = 20


def load_blender() -> None:
    """Load Blender's module, if it is not loaded, and remove folders that killed processes have
    left.
    """
    if "bpy" in sys.modules:
        return
    with _temporary_folder():
        importlib.import_module("bpy")


def discard_temporary() -> None:
    """Remove what is temporary of this process, also the folder of Blender's module, if it was
    loaded, or while it is being loaded, before an exit without exit handlers.
    """
    if (bpy := sys.modules.get("bpy")) is not None and hasattr(bpy, "app"):
        folder = Path(bpy.app.tempdir)
        if folder.name.startswith("blender_"):  # not a folder that the user has chosen
            remove(folder)
    discard_all()


@contextmanager
def _temporary_folder() -> Iterator[None]:
    """Have the system's temporary folder be a new one of ours; as it is where none can be made."""
    before = {name: os.environ.get(name) for name in TEMPORARY_VARIABLES}
    with suppress(OSError):
        made = new_folder("blender")
        os.environ.update(dict.fromkeys(TEMPORARY_VARIABLES, str(made)))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


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
