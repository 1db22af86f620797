# SPDX-License-Identifier: GPL-3.0-or-later
"""When the detector searches, counted in seconds of footage at several frame rates."""

from __future__ import annotations

import numpy as np
from scope.scope_addon.capture.perception.landmark_network import PoseEstimate
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.frame_clock import FrameClock
from scope.scope_addon.capture.tracking.search_schedule import SearchSchedule
from scope.scope_addon.capture.tracking.tracked_target import TrackedTarget

IMAGE = np.zeros((480, 640, 3), np.uint8)


def person(side_px: float, seen_s: float = 0.0) -> TrackedTarget:
    region = Region((320.0, 240.0), side_px, 0.0)
    keypoints = np.random.default_rng(1).normal(scale=0.2 * side_px, size=(33, 2)) + 300.0
    estimate = PoseEstimate(keypoints, np.ones(33), np.zeros((33, 3)), 0.99, region, region)
    return TrackedTarget(0, estimate, np.zeros(2), seen_s)


def test_small_people_are_searched_once_a_second_and_only_where_nobody_is_tracked() -> None:
    clock = FrameClock()
    schedule = SearchSchedule(clock, None)
    times = []
    for t in range(150):
        clock.advance(t / 30)
        assert not schedule.begin_small(IMAGE, [person(300.0)], [])
        if schedule.begin_small(IMAGE, [], []):
            times.append(t / 30)
    np.testing.assert_allclose(times, [0, 1, 2, 3, 4], atol=0.02)
    clock.advance(6.0)
    # a plain detection would find them again
    assert not schedule.begin_small(IMAGE, [], [person(300.0)])


def test_the_thorough_search_becomes_rare_until_their_number_changes() -> None:
    clock = FrameClock()
    schedule = SearchSchedule(clock, 4)
    times = []
    for t in range(600):
        clock.advance(t / 30)
        live = [person(300.0)] * (1 if t < 450 else 2)
        if schedule.begin_thorough(live):
            times.append(t)
    gaps = np.diff([t for t in times if t < 450])
    assert list(gaps[:4]) == [8, 16, 32, 64]  # frames; it doubles
    assert gaps.max() == 64
    after = [t for t in times if t >= 450]
    assert np.diff(after)[0] == 8
    assert not schedule.begin_thorough([])
    assert not schedule.begin_thorough([person(300.0)] * 4)
    assert not SearchSchedule(clock, None).begin_thorough([person(300.0)])
