# SPDX-License-Identifier: GPL-3.0-or-later
"""Removing datablocks: those that are new since a moment, and those of scenes that the window may
not show.
"""

from __future__ import annotations

from collections.abc import Sequence

import bpy


class NewDatablocks:
    """The datablocks of some kinds that are new since a moment.

    :param kinds: names of collections of ``bpy.data``.
    """

    def __init__(self, kinds: Sequence[str]) -> None:
        self._before = {
            kind: {block.session_uid for block in getattr(bpy.data, kind)} for kind in kinds
        }

    def all(self) -> list[tuple[str, bpy.types.ID]]:
        """Return each with its kind, in the order of the kinds."""
        blocks = ((kind, block) for kind in self._before for block in getattr(bpy.data, kind))
        return [
            (kind, block) for kind, block in blocks if block.session_uid not in self._before[kind]
        ]

    def remove(self) -> None:
        """Remove them."""
        bpy.data.batch_remove([block for _, block in self.all()])


def remove_blocks(blocks: Sequence[bpy.types.ID]) -> None:
    """Remove datablocks, and update the scenes that had the objects among them.

    Blender updates only the scenes that a window shows. The dependency graph of a scene that was
    shown before goes on pointing to removed objects, and Blender 4.3 crashes when it reads them
    there to free unused drawing data.
    """
    scenes = {
        scene
        for block in blocks
        if isinstance(block, bpy.types.Object)
        for scene in block.users_scene
    }
    bpy.data.batch_remove(blocks)
    for scene in scenes:
        for layer in scene.view_layers:
            layer.update()
