# SPDX-License-Identifier: GPL-3.0-or-later
"""A frame of the footage from a process of its own: upright, turned and mirrored as a capture sees
it.
"""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import scope
from scope.scope_addon.job.footage_picture import LONGER_SIDE, PictureProcess
from scope.scope_addon.job.process import WorkerFailedError
from scope.scope_addon.job.request import PictureRequest
from scope.solver.errors import ScopeError

from .processes import wait_for

SAMPLE = Path(scope.__file__).parent / "assets" / "sample" / "sample.mp4"


@pytest.fixture
def picture_of(tmp_path):
    """Ask for a frame, and wait for it."""

    def ask(footage, time_s=0.0, rotate="0", mirror=False):
        folder = tmp_path / "job"
        folder.mkdir()
        request = PictureRequest(str(footage), time_s=time_s, rotate=rotate, mirror=mirror)
        process = PictureProcess(request, folder)
        answers = []
        try:
            wait_for(lambda: answers.append(process.answer()) or answers[-1] is not None)
        finally:
            process.close()
        assert not folder.exists()
        return answers[-1]

    return ask


def rows_of(picture):
    """The pixels, (H, W, 3) RGB, the top row first."""
    width, height = picture.shown_size
    return np.frombuffer(picture.pixels, np.uint8).reshape(height, width, 4)[::-1, :, :3]


def test_a_frame_is_turned_and_mirrored_as_for_a_capture(picture_of, tmp_path):
    image = np.zeros((30, 40, 3), np.uint8)
    image[:10, :10] = 0, 0, 255  # red at the top left
    path = tmp_path / "picture.png"
    cv2.imwrite(str(path), image)
    turned = picture_of(path, rotate="90")
    assert (turned.size, turned.shown_size, turned.time_s) == ((30, 40), (30, 40), 0.0)
    assert rows_of(turned)[2, 27].tolist() == [255, 0, 0]
    assert rows_of(picture_of(path, rotate="90", mirror=True))[2, 2].tolist() == [255, 0, 0]


def test_a_large_frame_is_scaled_down_and_says_its_size(picture_of, tmp_path):
    path = tmp_path / "large.png"
    cv2.imwrite(str(path), np.zeros((900, 2560, 3), np.uint8))
    picture = picture_of(path)
    assert picture.size == (2560, 900)
    assert picture.shown_size == (LONGER_SIDE, 450)


def test_the_frame_at_a_time(picture_of):
    picture = picture_of(SAMPLE, 2.0)
    assert picture.time_s == pytest.approx(2.0, abs=0.02)
    assert picture.size == (640, 480)
    with pytest.raises(WorkerFailedError, match=r"sample\.mp4 lasts 5\.0 s"):
        picture_of(SAMPLE, 60.0)


@pytest.mark.parametrize(
    "changed",
    [{"picture_of": 3}, {"time_s": -1.0}, {"time_s": "0"}, {"rotate": "45"}, {"mirror": 1}],
)
def test_what_is_no_request_is_refused(changed):
    request = PictureRequest("a.mp4", time_s=1.5, rotate="90", mirror=True).to_json()
    assert PictureRequest.is_in(request)
    assert PictureRequest.from_json(request).to_json() == request
    with pytest.raises(ScopeError):
        PictureRequest.from_json(json.dumps(json.loads(request) | changed))
