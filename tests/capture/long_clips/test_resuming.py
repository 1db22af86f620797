# SPDX-License-Identifier: GPL-3.0-or-later
"""A capture that was stopped continues with what its networks had found, to the same result, bit
for bit.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from scope.scope_addon.capture.long_clips import kept_estimates
from scope.scope_addon.capture.long_clips.windowed_clip import lasting
from scope.scope_addon.capture.media.video_range import VideoRange
from scope.scope_addon.capture.options import CaptureOptions
from scope.scope_addon.capture.perception import landmark_network
from scope.scope_addon.capture.pipeline import capture
from scope.scope_addon.errors import CancelledError

from ...conftest import ROOT

SAMPLE = ROOT / "assets" / "sample" / "sample.mp4"
FRAMES = 20


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The runs of landmark networks; every estimate is written when it is added."""
    monkeypatch.setattr(kept_estimates, "INTERVAL_S", 0.0)
    made: list[str] = []
    interpret = landmark_network.interpret

    def counting(*arguments):
        made.append("run")
        return interpret(*arguments)

    monkeypatch.setattr(landmark_network, "interpret", counting)
    return made


def stop_at(frame: int):
    """Progress that cancels the capture at a frame."""

    def progress(stage: str, done: int, total: int) -> None:
        if done >= frame and stage == "finding the person":
            raise CancelledError("cancelled")

    return progress


def assert_same(resumed, whole):
    assert len(whole) >= FRAMES - 3
    for name in ("poses", "trans", "betas", "keypoints2d", "joints_cam", "joint_confidence"):
        assert np.array_equal(getattr(resumed, name), getattr(whole, name)), name


@pytest.mark.slow
def test_a_stopped_capture_continues_to_the_same_result(tmp_path, body, networks, runs):
    options = CaptureOptions(quality="fast", threads=1, wanted=VideoRange(0.0, 0.6, Fraction(30)))
    folder = tmp_path / "unfinished"
    with pytest.raises(CancelledError):
        capture(SAMPLE, body, options, stop_at(FRAMES - 5), observe_frames=lasting(folder))
    before = len(runs)
    resumed = capture(SAMPLE, body, options, observe_frames=lasting(folder)).motions[0]
    after = len(runs) - before
    whole = capture(SAMPLE, body, options).motions[0]
    # what was under way at the stop is run again
    assert len(runs) - before - after > before > 2 * after > 0
    assert_same(resumed, whole)
