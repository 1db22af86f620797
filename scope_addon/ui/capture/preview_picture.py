# SPDX-License-Identifier: GPL-3.0-or-later
"""The worker's picture of the current frame as an icon for the panel. It is no datablock, so no .blend holds it."""

from __future__ import annotations

import bpy
import bpy.utils.previews

_collection: bpy.utils.previews.ImagePreviewCollection | None = None


def show(pixels: bytes, width: int, height: int) -> None:
    """Take a new picture: RGBA bytes, the lowest row first. A picture that is not whole is passed over."""
    import numpy as np  # here: Blender does not need it to start

    if len(pixels) != 4 * width * height or not pixels:
        return
    global _collection
    if _collection is None:
        _collection = bpy.utils.previews.new()
    icon = _collection.get("frame") or _collection.new("frame")
    icon.image_size = width, height
    icon.image_pixels.foreach_set(np.frombuffer(pixels, np.int32))


def icon_id() -> int:
    """For ``template_icon``; 0 when there is nothing to show."""
    return _collection["frame"].icon_id if _collection is not None and "frame" in _collection else 0


def clear() -> None:
    """Forget the picture."""
    global _collection
    if _collection is not None:
        bpy.utils.previews.remove(_collection)
    _collection = None
