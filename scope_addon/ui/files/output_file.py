# SPDX-License-Identifier: GPL-3.0-or-later
"""The file that an operator writes."""

from __future__ import annotations

from pathlib import Path

import bpy

from ...errors import UsageError


def output_file(typed: str, suffix: str) -> Path:
    """Return the path of a file to write, with its suffix.

    :param typed: as the user has entered it; ``//`` at its beginning is the folder of the .blend
        file.
    :param suffix: with its dot.
    :raises UsageError: the file has no name, or is beside a .blend file that was never saved.
    """
    if not bpy.path.basename(typed).removesuffix(suffix):
        raise UsageError("the file has no name; enter one")
    if typed.startswith("//") and not bpy.data.filepath:
        raise UsageError(
            f"'{typed}' is relative to this .blend file, which was never saved; save it, or choose "
            "a folder"
        )
    return Path(bpy.path.ensure_ext(bpy.path.abspath(typed), suffix))
