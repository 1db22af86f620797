# SPDX-License-Identifier: GPL-3.0-or-later
"""The body in single frames, on our own clip with exact ground truth."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import choose_camera
from scope.scope_addon.capture.fitting import focal_length
from scope.scope_addon.capture.fitting.live_body import LiveBody
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.pipeline import capture
from scope.scope_addon.cli import SAMPLE
from scope.scope_addon.job.preview import LONGER_SIDE, draw
from scope.solver.body_file import load_body

from ..exact_tracks import pixels_of

WANTED = CaptureOptions(quality="fast", wanted=VideoRange(end_s=0.6))
LIMBS = [1, 2, 4, 5, 7, 8, 16, 17, 18, 19, 20, 21]


@pytest.fixture(scope="module")
def watched(body):
    """The sample's capture, and the live pose of every fourth frame: (frame index, picture, pose),
    and what becomes of its observation where that is not finite.
    """
    seen = []
    unusable = []

    def watch(frame, people, live):
        if frame.index % 4 == 0 and people:
            seen.append((frame.index, frame.image_rgb, people, [live.fit(people[0])]))
            lost = np.full_like(people[0].keypoints_px, np.nan)
            unusable.append(live.fit(replace(people[0], keypoints_px=lost)))

    return capture(SAMPLE, body, WANTED, watch=watch), seen, unusable


def test_the_previews_body_covers_the_true_joints(watched):
    truth = np.load(SAMPLE.with_name("sample_truth.npz"))
    _, seen, unusable = watched
    assert len(seen) >= 5
    assert unusable == [None] * len(seen)
    for index, image, people, poses in seen:
        scale = LONGER_SIDE / max(image.shape)
        pixels = scale * pixels_of(truth["joints_cam"][index][LIMBS], truth["intrinsics"])
        drawn = (draw(image, people[:1], poses) != draw(image, [])).any(axis=2)
        assert 0.005 < drawn.mean() < 0.5
        at = pixels.round().astype(int)
        near = [drawn[max(v - 3, 0) : v + 4, max(u - 3, 0) : u + 4].any() for u, v in at]
        assert np.mean(near) > 0.9, index


def test_the_result_depends_on_no_watcher_and_no_thread_s_speed(watched, body, monkeypatch):
    """Nobody watches, and bodies and edges come late."""

    class Slow(LiveBody):
        def load(self):
            time.sleep(0.2)
            super().load()

    by_edges = focal_length.camera_by_edges

    def slow_edges(*arguments):
        time.sleep(0.2)
        return by_edges(*arguments)

    monkeypatch.setattr("scope.scope_addon.capture.observe.LiveBody", Slow)
    monkeypatch.setattr(focal_length, "camera_by_edges", slow_edges)
    slowly = capture(SAMPLE, body, WANTED).motions[0]
    for name in ("poses", "trans", "betas", "joints_cam", "intrinsics"):
        np.testing.assert_array_equal(getattr(slowly, name), getattr(watched[0].motions[0], name))


@pytest.mark.parametrize("name", ["scope", "scope_h"])
def test_a_body_is_ready_once_it_is_loaded(name):
    live = LiveBody(load_body(name), choose_camera(640, 480))
    assert not live.is_ready
    live.load()
    assert live.is_ready
