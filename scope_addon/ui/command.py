# SPDX-License-Identifier: GPL-3.0-or-later
"""``blender --background --command scope capture …``: the shell's command line, inside Blender."""

from __future__ import annotations

import os

import bpy

from .preferences import cache

_handle: object | None = None


def run(argv: list[str]) -> int:
    """Run the command line with the arguments after ``scope``; return the exit status. Blender
    calls this.
    """
    os.environ.setdefault("NUMBA_CACHE_DIR", str(cache().kernels))
    from ..cli import main

    # A batch starts one Blender process per clip, because exports need Blender.
    return int(main(argv, program=(bpy.app.binary_path, "--background", "--command", "scope")))


def register() -> None:
    """Register the command."""
    global _handle
    _handle = bpy.utils.register_cli_command("scope", run)


def unregister() -> None:
    """Unregister the command."""
    global _handle
    if _handle is not None:
        bpy.utils.unregister_cli_command(_handle)
    _handle = None
