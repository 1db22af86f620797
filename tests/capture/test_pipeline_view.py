# SPDX-License-Identifier: GPL-3.0-or-later
"""A capture of footage that was filmed sideways and in slow motion."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.media.video import open_video
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.perception.region import Crop
from scope.scope_addon.capture.pipeline import capture
from scope.scope_addon.capture.tracking.tracker import PeopleTracker
from scope.scope_addon.footage_view import FootageView
from scope.solver.body import Body

from .media.made_video import write_video

SAMPLE = Path(__file__).parents[2] / "assets/sample/sample.mp4"
FRAMES = 14


@pytest.fixture(scope="module")
def sample_frames() -> list[np.ndarray]:
    with open_video(SAMPLE, VideoRange(end_s=FRAMES / 30)) as video:
        return [frame.image_rgb for frame in video][:FRAMES]


@pytest.mark.usefixtures("networks")
def test_a_clip_filmed_sideways_and_in_slow_motion(
    sample_frames: list[np.ndarray], body: Body, tmp_path: Path
) -> None:
    turned = [np.ascontiguousarray(np.rot90(image)) for image in sample_frames]
    path = write_video(tmp_path / "side.mp4", turned)
    wanted = VideoRange(view=FootageView(90))
    options = CaptureOptions(quality="fast", wanted=wanted, speed=2.0)
    result = capture(path, body, options)
    (motion,) = result.motions
    assert motion.footage_rotation == 90
    assert motion.mocap_framerate == 60.0
    assert result.report.frame_rate == [60, 1]
    np.testing.assert_allclose(np.diff(motion.timestamps), 1 / 60, atol=1e-3)
    np.testing.assert_allclose(np.diff(motion.footage_times_s), 1 / 30, atol=2e-3)
    assert motion.image_size.tolist() == list(sample_frames[0].shape[1::-1])
    # The head is above the pelvis, in the picture and in the world.
    joints = motion.joints_cam[:, [15, 0]].astype(float)
    T = motion.world_from_camera
    world = np.einsum("tij,tkj->tki", T[:, :3, :3], joints) + T[:, None, :3, 3]
    assert (world[:, 0, 2] - world[:, 1, 2] > 0.5).all()
    assert "turned_footage" not in [warning.code for warning in result.report.warnings]


@pytest.mark.usefixtures("networks")
def test_people_are_found_in_a_part_of_the_picture(sample_frames: list[np.ndarray]) -> None:
    """As in footage of that part alone, but in pixels of the whole picture."""
    height, width = sample_frames[0].shape[:2]
    crop = Crop(width, 2 * height, width, height)
    alone = PeopleTracker("fast", 1)
    cropped = PeopleTracker("fast", 1, crop=crop)
    for image in sample_frames[:4]:
        whole = np.full((4 * height, 4 * width, 3), 90, np.uint8)
        whole[crop.y : crop.y + height, crop.x : crop.x + width] = image
        (expected,) = alone.step(image)
        (found,) = cropped.step(whole)
        offset = [crop.x, crop.y]
        np.testing.assert_allclose(
            found[1].keypoints_px, expected[1].keypoints_px + offset, atol=1e-6
        )
        np.testing.assert_allclose(
            found[1].region.center_px, np.add(expected[1].region.center_px, offset)
        )
    restarted = cropped.restarted([found[1].region])
    (again,) = restarted.step(whole)
    assert cv2.norm(again[1].keypoints_px, found[1].keypoints_px, cv2.NORM_INF) < 20
