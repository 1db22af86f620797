# SPDX-License-Identifier: GPL-3.0-or-later
"""What a warning says about footage that its metadata mirrors, against how Blender shows that
footage.
"""

from __future__ import annotations

import re

import bpy
import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.footage_view import FootageView
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.scene.footage_strip import add_footage_strips, turn_strip

from ..capture.media.corner_picture import corner_image, corners, encode
from ..capture.media.made_video import patch_track_header, write_video

END = (0, 0, 0, 1 << 30)
MIRRORED = {
    "left and right": (-65536, 0, 0, 0, 65536, *END),
    "up and down": (65536, 0, 0, 0, -65536, *END),
    "transposed": (0, 65536, 0, 65536, 0, *END),
    "across": (0, -65536, 0, -65536, 0, *END),
}
FLIPS = {"Y": np.flipud, "X": np.fliplr}


def rendered(scene, tmp_path, size) -> np.ndarray:
    """Return what the scene renders in its first frame, (H, W, 3) uint8."""
    render = scene.render
    render.resolution_x, render.resolution_y = size
    render.resolution_percentage = 100
    render.filepath = str(tmp_path / "rendered.png")
    render.image_settings.file_format = "PNG"
    scene.view_settings.view_transform = "Standard"
    scene.frame_set(1)
    bpy.ops.render.render(write_still=True)
    return cv2.imread(render.filepath)[:, :, ::-1]


def mirrored(tmp_path, matrix):
    """Return a mirrored video, its first captured image, and the letter of the flip that its
    warning advises.
    """
    path = write_video(tmp_path / "a.mp4", [corner_image()] * 2)
    patch_track_header(path, matrix=matrix)
    with open_video(path) as video:
        captured = next(iter(video)).image_rgb
    advice = [
        re.search("mirrored by its metadata, .* switch on Flip ([XY])", text)
        for text in map(str, video.warnings)
    ]
    return path, captured, next(match.group(1) for match in advice if match)


def flip_setting(letter: str) -> str:
    return f"use_flip_{letter.lower()}"


@pytest.mark.parametrize("kind", ["up and down", "transposed"])
def test_a_strip_with_that_flip_renders_what_was_captured(tmp_path, kind):
    """*Mirror* of a strip has the same letters; without it, Blender shows something else."""
    path, captured, letter = mirrored(tmp_path, MIRRORED[kind])
    scene = bpy.context.scene
    (strip,) = add_footage_strips(scene, path, 1.0)
    scene.render.use_sequencer = True
    size = captured.shape[1::-1]
    assert corners(rendered(scene, tmp_path, size)) != corners(captured)
    setattr(strip, flip_setting(letter), True)
    assert corners(rendered(scene, tmp_path, size)) == corners(captured)


@pytest.mark.parametrize(
    ("kind", "dist"), [("left and right", 0.0), ("transposed", 0.0), ("across", 0.1)]
)
def test_the_picture_behind_the_camera_is_the_captured_one_with_that_flip(
    tmp_path, body, make_motion, kind, dist
):
    """What Blender makes of the file, and how the background's setting turns it: its flips mirror
    what they name.
    """
    path, captured, letter = mirrored(tmp_path, MIRRORED[kind])
    motion = make_motion(body, 2, source=str(path), image_size=captured.shape[1::-1])
    motion.dist = np.array([dist, 0.0, 0.0, 0.0, 0.0])
    objects = build_scene([motion], body, path, BuildOptions()).collection.all_objects
    camera = next(obj for obj in objects if obj.type == "CAMERA")
    (background,) = camera.data.background_images
    # the warning asks for it
    assert [background.use_flip_x, background.use_flip_y] == [False, False]
    assert hasattr(background, flip_setting(letter))
    shown = (
        pixels_of(background.image)
        if dist == 0.0
        else clip_rendered(background.clip, tmp_path, captured)
    )
    assert corners(FLIPS[letter](shown)) == corners(captured)


def pixels_of(image) -> np.ndarray:
    """Return an image as Blender shows it, (H, W, 3) uint8."""
    width, height = image.size
    # Blender's rows begin at the bottom
    pixels = np.array(image.pixels[:]).reshape(height, width, 4)[::-1, :, :3]
    return (255 * pixels).round().astype(np.uint8)


def clip_rendered(clip, tmp_path, captured) -> np.ndarray:
    """Return what the compositor shows of a movie clip."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.use_sequencer = False
    scene.render.use_compositing = True
    scene.cycles.samples = 1
    if hasattr(scene, "compositing_node_group"):
        tree = scene.compositing_node_group = bpy.data.node_groups.new("clip", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        output = tree.nodes.new("NodeGroupOutput")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.remove(next(node for node in tree.nodes if node.type == "R_LAYERS"))
        output = next(node for node in tree.nodes if node.type == "COMPOSITE")
    node = tree.nodes.new("CompositorNodeMovieClip")
    node.clip = clip
    tree.links.new(node.outputs["Image"], output.inputs[0])
    return rendered(scene, tmp_path, captured.shape[1::-1])


def test_rotated_footage_is_shown_as_captured_and_brings_no_warning(tmp_path):
    path = write_video(tmp_path / "a.mp4", [corner_image()] * 2)
    patch_track_header(path, matrix=(0, 65536, 0, -65536, 0, *END))
    with open_video(path) as video:
        captured = next(iter(video)).image_rgb
    assert not video.warnings
    assert corners(pixels_of(bpy.data.images.load(str(path)))) == corners(captured)


@pytest.mark.parametrize(("turn", "is_mirrored"), [(90, False), (180, True), (270, True)])
def test_a_strip_is_turned_as_the_footage_was_for_the_capture(
    tmp_path, body, make_motion, turn, is_mirrored
):
    path = tmp_path / "still.png"
    path.write_bytes(encode(".png", corner_image()))
    view = FootageView(turn, is_mirrored)
    captured = view.show(corner_image())
    size = captured.shape[1::-1]
    motion = make_motion(body, 1, image_size=size)
    motion.footage_rotation, motion.footage_mirrored = turn, is_mirrored
    camera = build_scene([motion], body, path, BuildOptions()).people[0].camera
    scene = bpy.context.scene
    (strip,) = add_footage_strips(scene, path, 1.0)
    turn_strip(strip, camera.data.background_images[0])
    scene.render.use_sequencer = True
    assert corners(rendered(scene, tmp_path, size)) == corners(captured)
