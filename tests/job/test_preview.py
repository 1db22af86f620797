# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of the current frame: whole, small, upside down for Blender, the skeleton where the person is."""

import numpy as np
from scope.scope_addon.capture.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.region import Region
from scope.scope_addon.capture.tracker import Observation
from scope.scope_addon.capture.video import Frame
from scope.scope_addon.job.preview import FILE, PreviewWriter, draw


def observation(pixels, confidence=1.0):
    return Observation(
        np.asarray(pixels, float), np.full(33, confidence), np.zeros((33, 3)), 1.0, Region((0.0, 0.0), 1.0, 0.0), True
    )


def test_lines_join_the_keypoints():
    image = np.zeros((720, 1280, 3), np.uint8)
    pixels = np.full((33, 2), -1000.0)
    pixels[KEYPOINT_NAMES.index("left_hip")] = 640, 100
    pixels[KEYPOINT_NAMES.index("left_knee")] = 640, 600
    picture = draw(image, observation(pixels))
    assert picture.shape == (144, 256, 4)
    assert (picture[..., 3] == 255).all()
    assert picture[70, 128, 0] > 200  # half-way down the thigh
    assert picture[70, 100, :3].max() == 0
    assert draw(image, observation(pixels, confidence=0.0))[..., :3].max() == 0
    assert draw(image, None)[..., :3].max() == 0


def test_the_file_is_whole_and_lowest_row_first(tmp_path):
    image = np.zeros((100, 50, 3), np.uint8)
    image[50:] = 200  # the lower half
    told = []
    writer = PreviewWriter(tmp_path, lambda event, **values: told.append((event, values)))
    writer(Frame(7, 0.1, image), None)
    writer(Frame(8, 0.2, image), None)  # too soon
    assert told == [("preview", {"file": FILE, "width": 128, "height": 256, "frame": 7})]
    pixels = np.frombuffer((tmp_path / FILE).read_bytes(), np.uint8).reshape(256, 128, 4)
    assert pixels[0, 0, 0] == 200
    assert pixels[-1, 0, 0] == 0
    assert [p.name for p in tmp_path.iterdir()] == [FILE]


def test_a_full_disk_does_not_stop_the_capture(tmp_path):
    told = []
    writer = PreviewWriter(tmp_path / "gone", lambda event, **values: told.append(event))
    writer(Frame(0, 0.0, np.zeros((10, 10, 3), np.uint8)), None)
    assert told == []
