# SPDX-License-Identifier: GPL-3.0-or-later
"""The libraries that come with the extension.

Blender keeps the wheels of all enabled extensions in one folder, and removes those of the others
whenever a process ends or enables one: so one that was started with factory settings takes them
away from all that run. They are put back before work that needs them.
"""

from __future__ import annotations

import importlib
import os
from importlib.util import find_spec

import bpy

from ..errors import SetupError

_PACKAGE = __package__.rpartition(".scope_addon")[0]
_NEEDED = ("numba", "llvmlite", "cv2", "onnxruntime", "av")


def restore_libraries() -> None:
    """Have Blender unpack the extension's wheels again if some are missing.

    :raises SetupError: some are still missing.
    """
    if _PACKAGE not in bpy.context.preferences.addons or not _missing():
        return
    import addon_utils

    addon_utils.extensions_refresh(ensure_wheels=True)
    importlib.invalidate_caches()
    if missing := _missing():
        raise SetupError(
            f"a part of Scope is missing ({', '.join(missing)}), which another Blender may have "
            "removed: disable Scope in the preferences and enable it again; if that does not help, "
            "reinstall it"
        )


def _missing() -> list[str]:
    """Return the libraries that are not on the disk, where a worker would look for them."""
    specs = {name: find_spec(name) for name in _NEEDED}
    return [
        name
        for name, spec in specs.items()
        if spec is None or not os.path.exists(spec.origin or "")
    ]
