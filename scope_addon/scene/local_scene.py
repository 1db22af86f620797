# SPDX-License-Identifier: GPL-3.0-or-later
"""Refusing to change a scene that is linked from another file, whose changes Blender refuses or
does not save.
"""

from __future__ import annotations

import bpy

from ..errors import UsageError


def check_local(scene: bpy.types.Scene) -> None:
    """Check that a scene is stored in this file.

    :raises UsageError: it is linked from another one.
    """
    if scene.library is not None:
        raise UsageError(
            f"the scene is linked from {scene.library.filepath}, so nothing can be added to it; "
            "use a scene of this "
            "file"
        )
