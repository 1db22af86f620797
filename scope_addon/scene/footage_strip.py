# SPDX-License-Identifier: GPL-3.0-or-later
"""The footage in the video sequencer: picture and sound, synchronized with the motion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy
from bpy.types import CameraBackgroundImage, Scene

from ..errors import VideoError
from ..footage import PICTURE_SUFFIXES, sequence_from
from ..motion import Motion
from .datablocks import check_local
from .timing import key_frames, rows_of_scene_frames

_OURS = "scope_footage"  # custom property of the strips that are added here


def pictures_of_frames(motion: Motion, start_frame: float, rate: float) -> tuple[float, list[int]]:
    """Return the first scene frame of a motion, and which picture of its sequence each scene frame
    from there on shows.

    :param start_frame: scene frame of timestamp 0.
    :param rate: of the scene, frames per second.
    """
    frames = key_frames(motion.timestamps, rate, start_frame)
    scene_frames, rows = rows_of_scene_frames(frames)
    return float(scene_frames[0]), motion.frames[rows].tolist()


def add_footage_strips(
    scene: Scene,
    footage: str | Path,
    start_frame: float,
    pictures: Sequence[int] = (),
    with_sound: bool = True,
) -> list[bpy.types.Strip]:
    """Add the footage on free channels above existing strips, and return its strips, the picture
    last.

    Strips that were added before are moved instead. A scene without strips continues to render its
    camera; otherwise, the render would show the footage alone.

    :param start_frame: scene frame of timestamp 0, or of the first of ``pictures``.
    :param pictures: of numbered images, which of them each scene frame shows, from 0 on; empty: a
        video or a still image.
    :param with_sound: False: of slow motion, whose sound does not last as long as what happened.
    :raises VideoError: when the file is missing, or Blender cannot read it.
    :raises UsageError: when the scene is linked.
    """
    check_local(scene)
    path = Path(footage)
    if not path.is_file():
        raise VideoError(
            f"the footage {path} does not exist; choose the video or image again and "
            "repeat the capture"
        )
    had_editor = scene.sequence_editor is not None
    sounds = set(bpy.data.sounds)
    editor = scene.sequence_editor or scene.sequence_editor_create()
    strips = strips_of(editor)
    if present := _added_before(strips, path):
        for strip in present:
            move_to(strip, round(start_frame))
        return present
    render_strips = scene.render.use_sequencer and len(strips) > 0
    channel = max((strip.channel for strip in strips), default=0) + 1
    start = round(start_frame)
    added = []
    try:
        if path.suffix.lower() in PICTURE_SUFFIXES:
            found = sequence_from(path) if any(pictures) else [path]
            shown = [found[min(number, len(found) - 1)] for number in pictures] or [path]
            added.append(strips.new_image(path.stem, str(shown[0]), channel, start))
            for picture in shown[1:]:
                added[-1].elements.append(picture.name)
        else:
            sound = _sound(strips, path, channel, start) if with_sound else None
            added += [sound] if sound else []
            added.append(strips.new_movie(path.stem, str(path), channel + len(added), start))
        if not added[-1].elements[0].orig_width:  # Blender's only sign that it cannot open the file
            raise RuntimeError
    except RuntimeError as error:
        for strip in added:
            strips.remove(strip)
        bpy.data.batch_remove(list(set(bpy.data.sounds) - sounds))
        if not had_editor:
            scene.sequence_editor_clear()
        raise VideoError(
            f"Blender cannot read {path}; convert a video to MP4 (H.264), an image to JPEG"
        ) from error
    for strip in added:
        strip[_OURS] = True
    scene.render.use_sequencer = render_strips
    return added


def turn_strip(strip: bpy.types.Strip, background: CameraBackgroundImage) -> None:
    """Turn and mirror the picture as the camera's background shows it: where the footage was turned
    for the capture.

    A strip turns counterclockwise, and exchanges its sides after it has turned, unlike the
    background.
    """
    strip.transform.rotation = -background.rotation
    flips = background.use_flip_x, background.use_flip_y
    is_quarter_turn = abs(math.sin(background.rotation)) > 0.5
    strip.use_flip_x, strip.use_flip_y = reversed(flips) if is_quarter_turn else flips


def strips_of(editor: bpy.types.SequenceEditor) -> Any:
    """Return the editor's top-level strips; the attribute was renamed after 4.3, and the old one
    removed in 5.0.
    """
    return editor.strips if hasattr(editor, "strips") else editor.sequences


def is_footage(strip: bpy.types.Strip) -> bool:
    """Return whether ``add_footage_strips`` has made a strip."""
    return _OURS in strip


def _added_before(strips: Any, path: Path) -> list[bpy.types.Strip]:
    """Return the strips that ``add_footage_strips`` has made of a file: its sound first, then its
    picture.
    """
    found = [strip for strip in strips if is_footage(strip) and _file_of(strip) == path.resolve()]
    return sorted(found, key=lambda strip: strip.type != "SOUND")


def _file_of(strip: bpy.types.Strip) -> Path | None:
    """Return the file of a movie, sound or image strip, which may be stored relative to the .blend
    file.
    """
    if strip.type == "SOUND":
        path = strip.sound.filepath if strip.sound else ""
    elif strip.type == "IMAGE":
        path = f"{strip.directory}/{strip.elements[0].filename}"
    else:
        path = strip.filepath if strip.type == "MOVIE" else ""
    return Path(bpy.path.abspath(path)).resolve() if path else None


# Blender 5.1 renamed these properties of strips, and 6.0 removes the old names.


def length_of(strip: bpy.types.Strip) -> int:
    """Return the number of frames of the strip's source."""
    return int(
        strip.content_duration if hasattr(strip, "content_duration") else strip.frame_duration
    )


def move_to(strip: bpy.types.Strip, frame: int) -> None:
    """Move a strip so that its source starts at a scene frame."""
    setattr(strip, "content_start" if hasattr(strip, "content_start") else "frame_start", frame)


def _sound(strips: Any, path: Path, channel: int, start: int) -> bpy.types.Strip | None:
    """Add the sound; return None for silent footage, for which Blender fails or adds a strip
    without length.
    """
    try:
        strip = strips.new_sound(path.stem, str(path), channel, start)
    except RuntimeError:
        return None
    if length_of(strip) > 1:
        return strip
    sound = strip.sound
    strips.remove(strip)
    if sound is not None and sound.users == 0:
        bpy.data.sounds.remove(sound)
    return None
