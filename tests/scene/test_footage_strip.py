# SPDX-License-Identifier: GPL-3.0-or-later
from pathlib import Path

import bpy
import cv2
import numpy as np
import pytest
import scope
from scope.scope_addon.errors import VideoError
from scope.scope_addon.scene.footage_strip import (
    add_footage_strips,
    pictures_of_frames,
    strips_of,
)


def start_of(strip):
    """Return the scene frame of a strip's first visible frame; Blender 5.1 renamed the property."""
    return strip.left_handle if hasattr(strip, "left_handle") else strip.frame_final_start


SAMPLE = Path(scope.__file__).resolve().parent / "assets" / "sample" / "sample.mp4"


def test_the_footage_begins_where_the_motion_does():
    scene = bpy.context.scene
    added = add_footage_strips(scene, SAMPLE, 101.0)
    assert [(s.type, start_of(s)) for s in added] == [("MOVIE", 101)]
    assert not scene.render.use_sequencer  # else a render would give the footage alone


def test_existing_strips_are_kept_and_rendered():
    scene = bpy.context.scene
    strips = strips_of(scene.sequence_editor_create())
    strips.new_effect("mine", "COLOR", 2, 1, **effect_end(60))
    added = add_footage_strips(scene, SAMPLE, 1.0)
    assert added[0].channel == 3
    assert scene.render.use_sequencer
    assert "mine" in strips


def test_the_same_footage_is_not_added_twice_but_moved():
    scene = bpy.context.scene
    first = add_footage_strips(scene, SAMPLE, 1.0)
    again = add_footage_strips(scene, SAMPLE.parent / ".." / SAMPLE.parent.name / SAMPLE.name, 21.0)
    assert [s.name for s in strips_of(scene.sequence_editor)] == [s.name for s in first]
    assert [start_of(s) for s in again] == [21]


def test_a_strip_of_the_users_own_is_left_alone():
    strips = strips_of(bpy.context.scene.sequence_editor_create())
    own = strips.new_movie("mine", str(SAMPLE), 1, 100)
    add_footage_strips(bpy.context.scene, SAMPLE, 1.0)
    assert start_of(own) == 100
    assert len(strips) == 2


def effect_end(frame: int) -> dict:
    """``new_effect`` takes a length from 5.0 on, before that an end."""
    return {"length": frame} if bpy.app.version >= (5, 0, 0) else {"frame_end": frame}


@pytest.mark.skipif(
    not bpy.app.build_options.audaspace, reason="this Blender was built without sound"
)
def test_sound_is_added(shared):
    added = add_footage_strips(
        bpy.context.scene, shared / "data" / "clips" / "walk_side_static.mp4", 1.0
    )
    assert [s.type for s in added] == ["SOUND", "MOVIE"]
    assert added[0].channel != added[1].channel


def test_a_picture_becomes_an_image_strip(tmp_path):
    image = bpy.data.images.new("still", 8, 8)
    image.filepath_raw = str(tmp_path / "still.png")
    image.file_format = "PNG"
    image.save()
    assert add_footage_strips(bpy.context.scene, tmp_path / "still.png", 1.0)[0].type == "IMAGE"


@pytest.mark.parametrize("name", ["w_{:04d}.png", "{}_1080p.png"])
def test_a_sequence_shows_the_picture_of_each_frame(body, make_motion, tmp_path, name):
    """Five pictures at 30 frames/s, the third of which is missing, in a scene with 60."""
    for number in (1, 2, 4, 5):
        cv2.imwrite(str(tmp_path / name.format(number)), np.zeros((16, 16, 3), np.uint8))
    motion = make_motion(body, 4)
    motion.frames[:] = range(4)
    motion.timestamps[:] = np.array([0, 1, 3, 4]) / 30.0
    start, pictures = pictures_of_frames(motion, 11.0, 60.0)
    (strip,) = add_footage_strips(
        bpy.context.scene, tmp_path / name.format(1), start, pictures, with_sound=False
    )
    shown = [element.filename for element in strip.elements]
    assert start == 11.0
    assert [shown[k] for k in (0, 2, 6, 8)] == [name.format(n) for n in (1, 2, 4, 5)]
    assert len(shown) == 9


def test_missing_or_unreadable_footage_is_reported(tmp_path):
    with pytest.raises(VideoError, match="does not exist"):
        add_footage_strips(bpy.context.scene, tmp_path / "gone.mp4", 1.0)
    scene = bpy.context.scene
    scene.sequence_editor_clear()
    broken = tmp_path / "broken.mp4"
    broken.write_bytes(b"not a film")
    with pytest.raises(VideoError, match="cannot read"):
        add_footage_strips(bpy.context.scene, broken, 1.0)
    assert scene.sequence_editor is None
    assert scene.render.use_sequencer
    assert not len(bpy.data.sounds)
    strips_of(scene.sequence_editor_create())
    with pytest.raises(VideoError, match="cannot read"):
        add_footage_strips(scene, broken, 1.0)
    assert not strips_of(scene.sequence_editor)
