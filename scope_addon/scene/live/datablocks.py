# SPDX-License-Identifier: GPL-3.0-or-later
"""Datablocks that are looked up again at every use: undo may have removed or replaced them since
the last one.
"""

from __future__ import annotations

import bpy

from ...errors import UsageError
from ..animation_data.removal import remove_blocks

KINDS = ("objects", "meshes", "armatures", "collections", "materials")


def found(kind: str, name: str, uid: int) -> bpy.types.ID | None:
    """Return the datablock with a session's identifier; None if it was removed.

    :param kind: the collection of ``bpy.data``.
    :param name: which it had last.
    """
    blocks = getattr(bpy.data, kind)
    block = blocks.get(name)
    if block is not None and block.session_uid == uid:
        return block
    return next((block for block in blocks if block.session_uid == uid), None)


def scene_of(uid: int) -> bpy.types.Scene:
    """Return the scene with a session's identifier.

    :raises UsageError: it was removed.
    """
    scene = found("scenes", "", uid)
    if scene is None:
        raise UsageError("the scene was removed during the live capture; start in another scene")
    return scene


def remove(blocks: set[tuple[str, int]]) -> None:
    """Remove those of the datablocks that still exist."""
    if not blocks:
        return
    remove_blocks([block for kind, uid in blocks if (block := found(kind, "", uid)) is not None])
    bpy.context.view_layer.update()  # it would still list removed objects
