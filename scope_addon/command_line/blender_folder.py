# SPDX-License-Identifier: GPL-3.0-or-later
"""The temporary folder of Blender's module: in a shell, inside a folder whose name tells the
process that owns it.

Blender makes a folder ``blender_XXXXXX`` when its module is loaded, and removes it at a normal exit
alone.
"""

from __future__ import annotations

import importlib
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..job.private_folder import is_private
from ..processes import is_abandoned, owner

_START = "scope-blender-"
# by which Blender finds the system's temporary folder, on Windows the others
_VARIABLES = ("TMPDIR", "TEMP", "TMP")
_made: list[str] = []  # by this process


def load_blender() -> None:
    """Load Blender's module, if it is not loaded, and remove folders that killed processes have
    left.
    """
    if "bpy" in sys.modules:
        return
    with _temporary_folder():
        importlib.import_module("bpy")


def remove_blender_folder() -> None:
    """Remove the temporary folder of Blender's module, if it was loaded, or while it is being
    loaded, before an exit without Blender's exit handlers.
    """
    for made in _made:
        shutil.rmtree(made, ignore_errors=True)
    if (bpy := sys.modules.get("bpy")) is not None and hasattr(bpy, "app"):
        folder = Path(bpy.app.tempdir)
        if folder.name.startswith("blender_"):  # not a folder that the user has chosen
            shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _temporary_folder() -> Iterator[None]:
    """Have the system's temporary folder be a new one with the owner's name; as it is where none
    can be made.
    """
    before = {name: os.environ.get(name) for name in _VARIABLES}
    with suppress(OSError):
        system = _system_folder()
        _remove_abandoned(system)
        made = tempfile.mkdtemp(prefix=f"{_START}{owner()}-", dir=system)
        _made.append(made)
        os.environ.update(dict.fromkeys(_VARIABLES, made))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _system_folder() -> Path:
    """Return the system's temporary folder; `tempfile.gettempdir` would try it with a file, which a
    kill leaves.
    """
    given = [Path(os.environ[name]) for name in _VARIABLES if os.environ.get(name)]
    return next((folder for folder in given if folder.is_dir()), Path("/tmp"))


def _remove_abandoned(system_folder: Path) -> None:
    """Remove folders of ours whose process does not run any more."""
    for folder in system_folder.glob(f"{_START}*-*-*"):
        with suppress(OSError):
            if is_private(folder) and is_abandoned(folder, folder.name.removeprefix(_START)):
                shutil.rmtree(folder, ignore_errors=True)
