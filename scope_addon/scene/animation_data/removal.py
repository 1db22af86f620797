# SPDX-License-Identifier: GPL-3.0-or-later
"""Removing datablocks of scenes that the window may not show."""

from __future__ import annotations

from collections.abc import Sequence

import bpy


def remove_blocks(blocks: Sequence[bpy.types.ID]) -> None:
    """Remove datablocks, and update the scenes that had the objects among them.

    Blender updates only the scenes that a window shows. The dependency graph of a scene that was shown before goes on
    pointing to removed objects, and Blender 4.3 crashes when it reads them there to free unused drawing data.
    """
    scenes = {scene for block in blocks if isinstance(block, bpy.types.Object) for scene in block.users_scene}
    bpy.data.batch_remove(blocks)
    for scene in scenes:
        for layer in scene.view_layers:
            layer.update()
