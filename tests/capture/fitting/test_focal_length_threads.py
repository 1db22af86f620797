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
from scope.scope_addon.capture.fitting.focal_length import (
    LOG_RATIOS,
    BackgroundEstimators,
    FocalFits,
)


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
        BackgroundEstimators(assumed_camera(64, 48, 64.0), 64, 48, live, None) as background,
    ):
        background.wait_for_solver(cancel)


TIMES = np.arange(34) / 8.0
SEEN = (TIMES >= 0.5) & ~((TIMES > 1.8) & (TIMES < 2.4))
# after at least 0.2, 0.4, 0.8 and 1.6 s, where somebody is seen
FITTED = [0.5, 0.75, 1.25, 2.5, 4.125]
PEOPLE = [(time_s, SimpleNamespace(time_s=time_s)) for time_s in TIMES[SEEN].tolist()]
BARS = [np.array([0.0, 0.0, 8.0, 48.0]), np.array([56.0, 0.0, 64.0, 48.0])]


class RecordedFits(FocalFits):
    """Fits that record the times of their frames, and prefer focal lengths that are longer by a
    third.
    """

    def __init__(self):
        super().__init__(None)
        self.times = []
        self.cameras = []

    def costs(self, observation, camera):
        self.times.append(observation.time_s)
        self.cameras.append(camera)
        return 50.0 * (LOG_RATIOS - 0.3) ** 2 * (1.0 + observation.time_s)


class Background:
    """A background that is searched for edges in the first frame in which somebody is seen."""

    def __init__(self):
        self.edge_frames = []
        self.bars = []

    def add(self, row):
        if SEEN[row] and not self.edge_frames:
            self.bars = BARS
            self.edge_frames.append(FrameEdges(row, Segments.none()))


def estimate(frames, replayed=(), lag=0, given=None):
    """The camera, and the fits, if some frames are added one by one and some of `PEOPLE` at the
    end.

    :param lag: 1: the background of a frame is ready only when the next one is added.
    """
    fits, followed, live = RecordedFits(), Background(), SimpleNamespace(load=lambda: None)
    largest = dict(PEOPLE)
    with BackgroundEstimators(
        given or assumed_camera(64, 48, 64.0), 64, 48, live, fits
    ) as background:
        for row in range(frames):
            if row >= lag:
                followed.add(row - lag)
            background.add(TIMES[row], largest.get(TIMES[row]), followed)
        for row in range(len(TIMES)):
            followed.add(row)
        for time_s, person in replayed:
            background.add(time_s, person, followed)
        camera = background.camera(followed)
    return camera, fits


def test_an_error_in_a_parallel_thread_is_raised(monkeypatch):
    def broken(*_):
        raise ValueError("no edges today")

    monkeypatch.setattr(focal_length, "camera_by_edges", broken)
    with pytest.raises(ValueError, match="no edges today"):
        estimate(len(TIMES))


def test_a_given_focal_length_is_not_estimated():
    given = choose_camera(64, 48, fov_deg=40.0)
    camera, fits = estimate(len(TIMES), given=given)
    assert fits.times == []
    expected = given.between_bars(48.0, 64, 48)
    assert (camera.source, camera.focal_deviation) == (expected.source, 0.0)
    np.testing.assert_array_equal(camera.intrinsics, expected.intrinsics)


@pytest.mark.parametrize(("frames", "lag"), [(len(TIMES), 0), (len(TIMES), 1), (17, 0), (3, 1)])
def test_the_focal_length_is_the_same_from_frames_that_were_added_and_from_people_at_the_end(
    frames, lag
):
    alone, alone_fits = estimate(0, PEOPLE)
    both, both_fits = estimate(frames, PEOPLE, lag)
    assert alone_fits.times == FITTED
    assert both_fits.times == alone_fits.times
    np.testing.assert_array_equal(both.intrinsics, alone.intrinsics)
    assert (both.focal_deviation, both.source) == (alone.focal_deviation, alone.source)
    assumed = assumed_camera(64, 48, 48.0)  # of the picture between the bars
    assert alone.intrinsics[0, 0] > 1.2 * assumed.intrinsics[0, 0]
    for camera in alone_fits.cameras + both_fits.cameras:
        np.testing.assert_array_equal(camera.intrinsics, assumed.intrinsics)
