# SPDX-License-Identifier: GPL-3.0-or-later
"""What a warning says about footage that its metadata mirrors, against how Blender shows that footage."""

from __future__ import annotations

import re

import bpy
import numpy as np
import pytest
from scope.scope_addon.capture.media.video import open_video

from ..capture.media.corner_picture import corner_image, corners
from ..capture.media.made_video import patch_track_header, write_video

END = (0, 0, 0, 1 << 30)
MIRRORED = {
    "left and right": (-65536, 0, 0, 0, 65536, *END),
    "up and down": (65536, 0, 0, 0, -65536, *END),
    "transposed": (0, 65536, 0, 65536, 0, *END),
    "across": (0, -65536, 0, -65536, 0, *END),
}
FLIPS = {"Y": np.flipud, "X": np.fliplr}


def shown_by_blender(path) -> np.ndarray:
    """Return the first image (H, W, 3) uint8 of a video as Blender shows it in a camera's background."""
    image = bpy.data.images.load(str(path))
    width, height = image.size
    pixels = np.array(image.pixels[:]).reshape(height, width, 4)[::-1, :, :3]  # Blender's rows begin at the bottom
    return (255 * pixels).round().astype(np.uint8)


@pytest.mark.parametrize("matrix", MIRRORED.values(), ids=MIRRORED)
def test_with_the_flip_that_is_advised_blender_shows_what_was_captured(tmp_path, matrix):
    path = write_video(tmp_path / "a.mp4", [corner_image()] * 2)
    patch_track_header(path, matrix=matrix)
    with open_video(path) as video:
        captured = next(iter(video)).image_rgb
    advice = [re.search("mirrored by its metadata, .* switch on Flip ([XY])", text) for text in video.warnings]
    flip = FLIPS[next(match.group(1) for match in advice if match)]
    assert corners(flip(shown_by_blender(path))) == corners(captured)


@pytest.mark.parametrize("matrix", [None, (0, 65536, 0, -65536, 0, *END), (-65536, 0, 0, 0, -65536, *END)])
def test_rotated_footage_is_shown_as_captured_and_brings_no_warning(tmp_path, matrix):
    path = write_video(tmp_path / "a.mp4", [corner_image()] * 2)
    patch_track_header(path, matrix=matrix)
    with open_video(path) as video:
        captured = next(iter(video)).image_rgb
    assert not video.warnings
    assert corners(shown_by_blender(path)) == corners(captured)
