# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver with its machine code, for operators that solve inside Blender.

Machine code contains the name of its package. It is shipped, and compiled by captures, for the
package ``scope``, whereas Blender calls the extension ``bl_ext.<repository>.scope``: under that
name, all of it would have to be compiled once more. So the extension's folder is also loaded as
``scope``, from the first such operator on until the extension is disabled.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

from .preferences import cache

ROOT = Path(__file__).resolve().parents[2]
OWN_NAME = __name__.partition(".scope_addon.")[0]
NAME = "scope"
_loaded: list[str] = []  # the package, if it was loaded here


def load() -> None:
    """Load the solver as the package ``scope``; keep what it compiles in the cache folder, never in
    the extension's.
    """
    if OWN_NAME == NAME:
        return
    if NAME not in sys.modules:
        from ..job.start_worker import load_package

        load_package(ROOT)
        _loaded.append(NAME)
    for name in [OWN_NAME, *([NAME] if is_ours() else [])]:
        import_module(f"{name}.scope_addon.machine_code.code_folders").keep_in(cache().kernels)
    if is_ours():
        import_module(f"{NAME}.solver")


def is_ours() -> bool:
    """Return whether the package ``scope`` is this extension and not somebody else's package of
    that name.
    """
    paths = list(getattr(sys.modules.get(NAME), "__path__", []))
    return bool(paths) and Path(paths[0]).resolve() == ROOT


def detach() -> None:
    """Forget the package, so that another version of the extension is not mixed with it."""
    while _loaded:
        package = _loaded.pop()
        for name in [
            name for name in sys.modules if name == package or name.startswith(f"{package}.")
        ]:
            del sys.modules[name]
