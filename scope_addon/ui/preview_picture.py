# SPDX-License-Identifier: GPL-3.0-or-later
"""The preview of the current frame as an icon for the panel; it is not a datablock, so no .blend
file contains it.
"""

from __future__ import annotations

import bpy
import bpy.utils.previews

_collection: bpy.utils.previews.ImagePreviewCollection | None = None


def show(pixels: bytes, width: int, height: int) -> None:
    """Replace the picture; incomplete pictures are ignored.

    :param pixels: RGBA bytes, bottom row first.
    """
    import numpy as np  # imported here, so that Blender starts without it

    if len(pixels) != 4 * width * height or not pixels:
        return
    global _collection
    if _collection is None:
        _collection = bpy.utils.previews.new()
    icon = _collection.get("frame") or _collection.new("frame")
    icon.image_size = width, height
    icon.image_pixels.foreach_set(np.frombuffer(pixels, np.int32))


def icon_id() -> int:
    """Return the icon for ``template_icon``; 0 if there is no picture."""
    return _collection["frame"].icon_id if _collection is not None and "frame" in _collection else 0


def clear() -> None:
    """Remove the picture."""
    global _collection
    if _collection is not None:
        bpy.utils.previews.remove(_collection)
    _collection = None
