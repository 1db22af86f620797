# SPDX-License-Identifier: GPL-3.0-or-later
"""The temporary folder of Blender's module: in a shell, inside one of ours.

Blender makes a folder ``blender_XXXXXX`` when its module is loaded, and removes it at a normal exit
alone.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..temporary import TEMPORARY_VARIABLES, discard_all, new_folder, remove


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
