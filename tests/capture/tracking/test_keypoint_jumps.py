# SPDX-License-Identifier: GPL-3.0-or-later
"""Impossible jumps are repaired; possible motion, noise and unseen frames are left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.tracking.keypoint_jumps import (
    CONFIDENCE,
    find_keypoint_jumps,
    repair_keypoint_jumps,
)
from scope.scope_addon.capture.tracking.track import Track

WRIST = KEYPOINT_NAMES.index("left_wrist")
ANKLE = KEYPOINT_NAMES.index("right_ankle")
PX = 400.0  # per metre


def standing_at(times: np.ndarray) -> Track:
    """A person whose left wrist swings by 0.4 m, 1.5 times per second, with a detector's noise."""
    count = len(times)
    rng = np.random.default_rng(1)
    heights = {
        "shoulder": -0.5,
        "elbow": -0.3,
        "wrist": -0.1,
        "hip": 0.0,
        "knee": 0.45,
        "ankle": 0.9,
    }
    body = np.array([[0.2 if "left" in n else -0.2, 0.0, 0.0] for n in KEYPOINT_NAMES])
    body[:, 1] = [next((h for key, h in heights.items() if key in n), -0.7) for n in KEYPOINT_NAMES]
    world = np.tile(body, (count, 1, 1))
    world[:, WRIST, 0] += 0.4 * np.sin(2 * np.pi * 1.5 * times)
    world += rng.normal(0, 0.005, world.shape)
    return Track(
        frames=np.arange(count),
        times=times,
        seen=np.ones(count, bool),
        keypoints_px=(world[..., :2] * PX + 500).astype(np.float32),
        confidence=np.full((count, 33), 0.9, np.float32),
        world_landmarks=world.astype(np.float32),
        acquired=np.arange(count) == 0,
    )


@pytest.mark.parametrize(("rate", "frames"), [(25.0, 2), (30.0, 1), (120.0, 2)])
def test_a_jump_is_moved_back_onto_the_path(rate: float, frames: int) -> None:
    track = standing_at(np.arange(90) / rate)
    right = track.keypoints_px.copy()
    off = slice(40, 40 + frames)
    track.keypoints_px[off, ANKLE] += [0.6 * PX, 0.0]
    repaired = repair_keypoint_jumps(track)
    np.testing.assert_allclose(repaired.keypoints_px[off, ANKLE], right[off, ANKLE], atol=0.03 * PX)
    np.testing.assert_allclose(repaired.confidence[off, ANKLE], 0.9 * CONFIDENCE, rtol=1e-5)
    others = np.arange(33) != ANKLE
    np.testing.assert_array_equal(repaired.keypoints_px[:, others], right[:, others])
    assert (repaired.confidence[:, others] == track.confidence[:, others]).all()
    assert repaired.keypoints_px.dtype == repaired.confidence.dtype == np.float32


@pytest.mark.parametrize("rate", [6.0, 15.0, 60.0])
def test_possible_motion_is_left_alone(rate: float) -> None:
    """A swing, a punch of 0.5 m to and fro in 0.25 s (some 130 m/s2), a step of 0.6 m in 0.15 s."""
    track = standing_at(np.arange(120) / rate)
    strike(track, 1.0)
    assert repair_keypoint_jumps(track) is track


def strike(track: Track, start_s: float) -> None:
    """Let the person punch, and step 0.6 s later."""
    time = track.times - start_s
    punch = 0.25 * (1 - np.cos(2 * np.pi * time / 0.25)) * ((time > 0.0) & (time < 0.25))
    for values, metre in ((track.keypoints_px, PX), (track.world_landmarks, 1.0)):
        values[:, WRIST, 1] += metre * punch
        values[:, ANKLE, 0] += (
            metre * 0.3 * (1 - np.cos(np.pi * np.clip((time - 0.6) / 0.15, 0, 1)))
        )


def varying(*parts: tuple[int, float]) -> np.ndarray:
    """Times of a number of frames at one rate, and then others at other rates."""
    steps = np.concatenate([np.full(count, 1 / rate) for count, rate in parts])
    return np.concatenate([[0.0], np.cumsum(steps)])


def test_possible_motion_is_left_alone_where_the_frame_rate_falls() -> None:
    """6 s at 30 frames/s, in which most frames are, and 4 s at 15, in which the person strikes."""
    track = standing_at(varying((180, 30.0), (60, 15.0)))
    strike(track, 8.0)
    assert repair_keypoint_jumps(track) is track


@pytest.mark.parametrize("parts", [((20, 30.0), (60, 15.0)), ((60, 15.0), (40, 30.0))])
def test_a_jump_is_moved_back_by_the_time_that_its_frames_have(
    parts: tuple[tuple[int, float], ...],
) -> None:
    """Of two frames that come at 30 frames/s, where most come at 15."""
    times = varying(*parts)
    track = standing_at(times)
    first = 19 if parts[0][1] == 30.0 else 61
    off = slice(first, first + 2)
    track.keypoints_px[..., 0] += 4.0 * PX * times[:, None]  # runs to the right
    right = track.keypoints_px.copy()
    track.keypoints_px[off, ANKLE] += [0.0, 0.9 * PX]
    repaired = repair_keypoint_jumps(track)
    np.testing.assert_allclose(repaired.keypoints_px[off, ANKLE], right[off, ANKLE], atol=0.03 * PX)


@pytest.mark.parametrize("rate", [24.0, 60.0, 240.0])
def test_times_that_a_container_rounds_to_milliseconds_change_nothing(rate: float) -> None:
    track = standing_at(np.arange(90) / rate)
    track.keypoints_px[40:42, ANKLE] += [0.6 * PX, 0.0]
    track.world_landmarks[60, WRIST] += [0.0, 0.7, 0.0]
    rounded = replace(track, times=np.round(track.times, 3))
    step_s = float(np.median(np.diff(rounded.times)))
    even = replace(track, times=step_s * np.arange(90))
    found = [repair_keypoint_jumps(each) for each in (rounded, even)]
    for name in ("keypoints_px", "world_landmarks", "confidence"):
        np.testing.assert_array_equal(*(getattr(each, name) for each in found))


def test_no_line_is_drawn_across_a_cut() -> None:
    """The scenes on both sides are far apart in time, however few frames lie between."""
    points = np.zeros((12, 1, 2))
    points[5] = 3.0
    times = np.arange(12) / 30 + 10.0 * (np.arange(12) > 5)
    assert not find_keypoint_jumps(points, np.ones(12, bool), times).any()


def test_gaps_and_ends() -> None:
    points = np.zeros((12, 1, 2))
    points[[0, 5, 11]] = 3.0
    seen = np.ones(12, bool)
    times = np.arange(12) / 30
    np.testing.assert_array_equal(
        np.flatnonzero(find_keypoint_jumps(points, seen, times)[:, 0]), [5]
    )
    seen[6] = False
    assert not find_keypoint_jumps(points, seen, times).any()
    assert not find_keypoint_jumps(points[:2], seen[:2], times[:2]).any()
    short = standing_at(np.arange(2) / 30)
    assert repair_keypoint_jumps(short) is short
