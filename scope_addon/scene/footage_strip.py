# SPDX-License-Identifier: GPL-3.0-or-later
"""The footage in the video sequencer: picture and sound, synchronized with the motion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy

from ..errors import VideoError
from ..footage import PICTURE_SUFFIXES


def add_footage_strips(scene: bpy.types.Scene, footage: str | Path, start_frame: float) -> list[bpy.types.Strip]:
    """Add the footage on free channels above existing strips; return the new strips.

    A scene without strips continues to render its camera; otherwise, the render would show the footage alone.

    :param start_frame: scene frame of timestamp 0.
    :raises VideoError: when the file is missing, or Blender cannot read it.
    """
    path = Path(footage)
    if not path.is_file():
        raise VideoError(f"the footage {path} does not exist; choose the video or image again and repeat the capture")
    editor = scene.sequence_editor or scene.sequence_editor_create()
    strips = strips_of(editor)
    if not len(strips):
        scene.render.use_sequencer = False
    channel = max((strip.channel for strip in strips), default=0) + 1
    start = round(start_frame)
    added = []
    try:
        if path.suffix.lower() in PICTURE_SUFFIXES:
            added.append(strips.new_image(path.stem, str(path), channel, start))
        else:
            sound = _sound(strips, path, channel, start)
            added += [sound] if sound else []
            added.append(strips.new_movie(path.stem, str(path), channel + len(added), start))
        if not added[-1].elements[0].orig_width:  # Blender's only sign that it cannot open the file
            raise RuntimeError
    except RuntimeError as error:
        for strip in added:
            strips.remove(strip)
        raise VideoError(f"Blender cannot read {path}; convert a video to MP4 (H.264), an image to JPEG") from error
    return added


def strips_of(editor: bpy.types.SequenceEditor) -> Any:
    """Return the editor's top-level strips; the attribute was renamed after 4.3, and the old one removed in 5.0."""
    return editor.strips if hasattr(editor, "strips") else editor.sequences


def _sound(strips: Any, path: Path, channel: int, start: int) -> bpy.types.Strip | None:
    """Add the sound; return None for silent footage, for which Blender fails or adds a strip without length."""
    try:
        strip = strips.new_sound(path.stem, str(path), channel, start)
    except RuntimeError:
        return None
    if strip.frame_duration > 1:
        return strip
    sound = strip.sound
    strips.remove(strip)
    if sound is not None and sound.users == 0:
        bpy.data.sounds.remove(sound)
    return None
