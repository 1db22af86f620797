# SPDX-License-Identifier: GPL-3.0-or-later
"""The preview: complete, small, bottom row first, and with the skeleton or body where the person
is.
"""

import threading

import numpy as np
from scope.scope_addon.capture.media.frame import Frame
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.observation import Observation
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.job import preview
from scope.scope_addon.job.preview import FILE, LONGER_SIDE, PreviewWriter, draw

from .processes import wait_for


def observation(pixels, confidence=1.0):
    return Observation(
        np.asarray(pixels, float),
        np.full(33, confidence),
        np.zeros((33, 3)),
        1.0,
        Region((0.0, 0.0), 1.0, 0.0),
        True,
    )


def test_lines_join_the_keypoints_of_everybody():
    image = np.zeros((720, 1280, 3), np.uint8)
    people = []
    for x in (300, 900):
        pixels = np.full((33, 2), -1000.0)
        pixels[KEYPOINT_NAMES.index("left_hip")] = x, 100
        pixels[KEYPOINT_NAMES.index("left_knee")] = x, 600
        people.append(observation(pixels, np.where(pixels[:, 0] > 0, 1.0, 0.0)))
    picture = draw(image, people)
    assert picture.shape == (144, 256, 4)
    assert (picture[..., 3] == 255).all()
    assert picture[70, 60, 0] > 200  # half-way down a thigh
    assert picture[70, 180, 0] > 200
    assert picture[70, 120, :3].max() == 0
    assert draw(image, [observation(pixels, confidence=0.0)])[..., :3].max() == 0
    assert draw(image, [])[..., :3].max() == 0


class NotReady:
    """A live body that is not loaded yet."""

    is_ready = False


def test_the_file_is_complete_and_bottom_row_first(tmp_path, monkeypatch):
    monkeypatch.setattr(preview, "INTERVAL_S", 600.0)
    image = np.zeros((100, 50, 3), np.uint8)
    image[50:] = 200  # the lower half
    sent = []
    with PreviewWriter(tmp_path, lambda event, **values: sent.append((event, values))) as writer:
        writer(Frame(7, 0.1, image), [], NotReady())
        writer(Frame(8, 0.2, image), [], NotReady())  # too soon
        wait_for(lambda: sent)
        assert sent == [("preview", {"file": FILE, "width": 128, "height": 256, "frame": 7})]
        pixels = np.frombuffer((tmp_path / FILE).read_bytes(), np.uint8).reshape(256, 128, 4)
        assert pixels[0, 0, 0] == 200
        assert pixels[-1, 0, 0] == 0
        assert [p.name for p in tmp_path.iterdir()] == [FILE]
    assert not list(tmp_path.iterdir())


def test_a_full_disk_does_not_stop_the_capture(tmp_path, monkeypatch):
    monkeypatch.setattr(preview, "INTERVAL_S", 0.0)
    sent = []
    image = np.zeros((10, 10, 3), np.uint8)
    with PreviewWriter(tmp_path / "gone", lambda event, **values: sent.append(event)) as writer:
        writer(Frame(0, 0.0, image), [], NotReady())
        wait_for(writer._drawing.done)
        assert sent == []
        (tmp_path / "gone").mkdir()
        writer(Frame(1, 0.1, image), [], NotReady())
        wait_for(lambda: sent == ["preview"])


def test_a_preview_that_is_being_read_does_not_stop_the_capture(tmp_path, monkeypatch):
    """Windows does not remove a file that is open."""
    sent = []
    refused = []

    def in_use(self, missing_ok=False):
        refused.append(self)
        raise PermissionError(13, "it is being used by another process")

    with PreviewWriter(tmp_path, lambda event, **values: sent.append(event)) as writer:
        writer(Frame(0, 0.0, np.zeros((10, 10, 3), np.uint8)), [], NotReady())
        wait_for(lambda: sent == ["preview"])
        monkeypatch.setattr(preview.Path, "unlink", in_use)
    assert refused == [tmp_path / FILE]
    assert (tmp_path / FILE).is_file()


def test_the_skeleton_is_drawn_if_the_body_cannot_be_fitted(tmp_path):
    class Broken:
        is_ready = True

        def fit(self, observation):
            raise ArithmeticError("a defect")

    sent = []
    with PreviewWriter(tmp_path, lambda event, **values: sent.append(event)) as writer:
        writer._rasterizer.result()
        image = np.zeros((50, 50, 3), np.uint8)
        seen = observation(np.linspace([5.0, 5.0], [45.0, 40.0], 33))
        writer(Frame(0, 0.0, image), [seen], Broken())
        wait_for(lambda: sent == ["preview"])
        shown = np.frombuffer((tmp_path / FILE).read_bytes(), np.uint8).reshape(
            LONGER_SIDE, LONGER_SIDE, 4
        )
    np.testing.assert_array_equal(shown[::-1], draw(image, [seen]))
    assert shown[..., :3].max() > 200


def test_previews_do_not_wait_for_the_rasterizer_to_compile(tmp_path, monkeypatch):
    class Ready:
        is_ready = True

        def fit(self, observation):
            sent.append("fitted")

    sent = []
    compiled = threading.Event()
    monkeypatch.setattr(preview, "INTERVAL_S", 0.0)
    monkeypatch.setattr(preview, "load_rasterizer", compiled.wait)
    with PreviewWriter(tmp_path, lambda event, **values: sent.append(event)) as writer:
        for k, expected in ((0, ["preview"]), (1, ["preview", "fitted", "preview"])):
            writer(
                Frame(k, 0.0, np.zeros((50, 50, 3), np.uint8)),
                [observation(np.full((33, 2), 20.0))],
                Ready(),
            )
            writer._drawing.result()
            assert sent == expected
            compiled.set()
            writer._rasterizer.result()
