# SPDX-License-Identifier: GPL-3.0-or-later
"""Somebody who is followed and goes behind something: an invented body whose landmarks leap, fade, or both."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.perception.landmark_network import PoseEstimate
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.tracked_target import LATE_FRAMES, Followed

SIDE = 400.0
BODY = np.random.default_rng(1).normal(scale=0.2 * SIDE, size=(33, 2))


def at(x: float, confidence: float = 0.9) -> PoseEstimate:
    region = Region((x, 300.0), SIDE, 0.0)
    sure = np.full(33, confidence)
    return PoseEstimate(BODY + [x, 300.0], sure, np.ones(33), np.zeros((33, 3)), 0.99, region, region)


def walker(frames: int, fps: float, speed_px: float = 12.0) -> Followed:
    """Followed for so many frames, and would be at ``frames * speed_px`` in the next one."""
    followed = Followed(0, at(0.0), np.zeros(2), 0.0)
    for t in range(1, frames):
        followed.go_on(at(speed_px * t), False, t / fps, 1 / fps)
    return followed


@pytest.mark.parametrize(
    ("leap", "confidence", "behind"), [(0, 0.9, False), (60, 0.9, False), (0, 0.4, False), (60, 0.4, True)]
)
def test_who_leaps_and_fades_at_once_goes_behind_something(leap: float, confidence: float, behind: bool) -> None:
    assert walker(30, 30).goes_behind(at(30 * 12.0 + leap, confidence)) == behind


def test_somebody_dim_all_the_time_is_not_hidden() -> None:
    followed = Followed(0, at(0.0, 0.4), np.zeros(2), 0.0)
    for t in range(1, 30):
        followed.go_on(at(0.0, 0.4), False, t / 30, 1 / 30)
    assert not followed.goes_behind(at(60.0, 0.38))


@pytest.mark.parametrize("fps", [5, 30, 120])
def test_the_confidence_of_late_is_that_of_half_a_second(fps: int) -> None:
    followed = walker(3 * fps, fps)
    times = [time for time, _ in followed.confidences]
    assert len(times) == max(LATE_FRAMES, fps // 2 + 1)
    assert times[-1] == followed.seen_s


def test_what_hides_somebody_is_told_from_them_by_confidence_and_place() -> None:
    followed = walker(30, 30)
    dim, sure, elsewhere = at(360.0, 0.4), at(360.0), at(360.0 + SIDE, 0.4)
    assert not followed.is_hidden_by(dim)  # they were lost for another reason
    followed.is_hidden, followed.lost = True, 3
    assert followed.is_hidden_by(dim)
    assert not followed.is_hidden_by(sure)
    assert not followed.is_hidden_by(elsewhere)
    larger = replace(dim, region=replace(dim.region, side_px=3 * SIDE))
    assert not followed.is_hidden_by(larger)
