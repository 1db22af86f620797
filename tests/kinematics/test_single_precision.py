# SPDX-License-Identifier: GPL-3.0-or-later
"""Per-frame results of long clips take little memory and lose no relevant accuracy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scope.scope_addon.capture.fitting.frame_sequence import FittedTrack
from scope.scope_addon.capture.tracking.track import Track
from scope.scope_addon.capture.world.placement import place_track
from scope.scope_addon.kinematics.frame_blocks import to_single_precision
from scope.solver.body_file import load_body
from scope.solver.rotations import exp


@dataclass(frozen=True)
class Record:
    large: np.ndarray
    quaternion: np.ndarray
    point: np.ndarray
    times: np.ndarray
    frames: np.ndarray
    name: str


def test_only_large_arrays_are_rounded() -> None:
    rng = np.random.default_rng(0)
    large, quaternion, point = (rng.normal(0, 5, (50, *shape)) for shape in ((33, 3), (4,), (3,)))
    record = Record(
        large, quaternion, point, np.arange(50) / 30, np.arange(400).reshape(50, 8), "a"
    )
    small = to_single_precision(record)
    assert small.large.dtype == np.float32
    np.testing.assert_allclose(small.large, record.large, atol=1e-6)
    assert small.quaternion.dtype == np.float32
    assert small.point is record.point
    assert small.times is record.times
    assert small.frames is record.frames
    assert to_single_precision(small) is small


def walk(frames: int) -> tuple[Track, FittedTrack]:
    body = load_body("scope")
    times = np.arange(frames) / 30
    pose = 0.3 * np.sin(times[:, None, None] * np.linspace(1, 3, 3 * (body.K + 1)).reshape(-1, 3))
    root = np.stack([np.sin(times), 0 * times, 4 + 0.5 * np.cos(times)], axis=1)
    valid = np.ones(frames, bool)
    valid[10:13] = False
    nothing = np.zeros((frames, 33, 3), np.float32)
    track = Track(
        np.arange(frames),
        times,
        valid,
        nothing[..., :2],
        nothing[..., 0],
        nothing,
        np.arange(frames) == 0,
    )
    return track, FittedTrack(
        exp(pose), root, np.zeros(body.P), valid, np.ones((frames, body.K + 1)), 1.0
    )


def test_a_fit_in_single_precision_is_placed_within_a_hundredth_of_a_millimetre() -> None:
    body = load_body("scope")
    (track, fitted) = walk(120)
    exact = place_track(body, track, fitted, True)
    small = place_track(body, track, to_single_precision(fitted), True)
    np.testing.assert_allclose(small.joints, exact.joints, atol=1e-5)
    np.testing.assert_allclose(small.soles, exact.soles, atol=1e-5)
    # and as the same formula in double precision has it
    joints = exact.body.forward_kinematics(
        exact.rotations, exact.root - exact.body.rest_joints(exact.betas)[0]
    )[1]
    np.testing.assert_allclose(small.joints, joints, atol=1e-5)
