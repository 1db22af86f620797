# SPDX-License-Identifier: GPL-3.0-or-later
"""Tidy up after an armature was appended: Blender puts the rings that its bones show into the
scene. Before 4.3, Blender says nothing of appended files, and they stay there.
"""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent


def attach() -> None:
    """Add the handler."""
    if hasattr(bpy.app.handlers, "blend_import_post"):
        bpy.app.handlers.blend_import_post.append(_unlink_rings)


def detach() -> None:
    """Remove the handler."""
    if hasattr(bpy.app.handlers, "blend_import_post"):
        bpy.app.handlers.blend_import_post.remove(_unlink_rings)


@persistent
def _unlink_rings(*_: object) -> None:
    from ..scene.character.bone_display import unlink_rings

    unlink_rings()
