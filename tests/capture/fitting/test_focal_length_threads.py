# SPDX-License-Identifier: GPL-3.0-or-later
"""The focal length is that of the frames, whenever they are added, and only compiling is reported
as such.
"""

import threading
from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon.capture.camera.heading_drift import FrameEdges
from scope.scope_addon.capture.camera.intrinsics import assumed_camera, choose_camera
from scope.scope_addon.capture.camera.line_segments import Segments
from scope.scope_addon.capture.fitting import focal_length
from scope.scope_addon.capture.fitting.focal_length import BackgroundEstimators


class SlowBody:
    """Loads until told."""

    def __init__(self):
        self.may_end = threading.Event()
        self.is_ready = False

    def load(self):
        assert self.may_end.wait(300)
        self.is_ready = True


def test_a_cancel_while_compiling_is_passed_on(monkeypatch):
    live = SlowBody()
    monkeypatch.setattr(focal_length, "compiled_kernels", lambda: 1)

    def cancel(_):
        live.may_end.set()
        raise KeyboardInterrupt

    with (
        pytest.raises(KeyboardInterrupt),
        BackgroundEstimators(assumed_camera(64, 48, (64.0, 48.0)), 64, 48, live) as background,
    ):
        background.wait_for_solver(cancel)


BARS = [np.array([0.0, 0.0, 8.0, 48.0]), np.array([56.0, 0.0, 64.0, 48.0])]
FIRST_EDGES = 4  # frame in which the background is searched for edges first


class Background:
    """A background that is searched for edges in some frames."""

    def __init__(self):
        self.edge_frames = []
        self.bars = []

    def add(self, row):
        if row in (FIRST_EDGES, FIRST_EDGES + 3):
            self.bars = BARS
            self.edge_frames.append(FrameEdges(row, Segments.none()))


def estimate(frames, given=None):
    """The camera, if its background is looked at in the first frames, and at the end."""
    followed, live = Background(), SimpleNamespace(load=lambda: None)
    with BackgroundEstimators(
        given or assumed_camera(64, 48, (64.0, 48.0)), 64, 48, live
    ) as background:
        for row in range(10):
            followed.add(row)
            if row < frames:
                background.use_edges(followed)
        return background.camera(followed)


def test_an_error_in_a_parallel_thread_is_raised(monkeypatch):
    def broken(*_):
        raise ValueError("no edges today")

    monkeypatch.setattr(focal_length, "camera_by_edges", broken)
    with pytest.raises(ValueError, match="no edges today"):
        estimate(10)


def test_a_given_focal_length_is_not_estimated(monkeypatch):
    monkeypatch.setattr(focal_length, "camera_by_edges", None)
    given = choose_camera(64, 48, fov_deg=40.0)
    camera = estimate(10, given)
    expected = given.between_bars((48.0, 48.0), 64, 48)
    assert (camera.source, camera.focal_deviation) == (expected.source, 0.0)
    np.testing.assert_array_equal(camera.intrinsics, expected.intrinsics)


@pytest.mark.parametrize("frames", [0, FIRST_EDGES, 10])
def test_the_focal_length_is_that_of_the_first_edges_whenever_these_are_looked_at(
    monkeypatch, frames
):
    seen = []
    by_edges = focal_length.camera_by_edges

    def recorded(segments, *size):
        seen.append((segments, size))
        return by_edges(segments, *size)

    monkeypatch.setattr(focal_length, "camera_by_edges", recorded)
    camera = estimate(frames)
    assert len(seen) == 1
    assert seen[0][1] == (64, 48, (48.0, 48.0))  # of the picture between the bars
    np.testing.assert_array_equal(
        camera.intrinsics, assumed_camera(64, 48, (48.0, 48.0)).intrinsics
    )
