# SPDX-License-Identifier: GPL-3.0-or-later
"""A clip's rotation from windows of it that were followed apart, each from its own first frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scope.scope_addon.capture.camera.background_record import BackgroundRecord, joined_backgrounds
from scope.scope_addon.capture.camera.heading_drift import FrameEdges
from scope.scope_addon.capture.camera.line_segments import Segments
from scope.solver.rotations import exp, log

TIMES = np.arange(90) / 30
TRUTH = exp(np.stack([0.1 * np.sin(2 * TIMES), 0.3 * TIMES, 0.05 * TIMES], axis=1))
# first and last frame, and those that the window before has as well
WINDOWS = ((0, 40, 0), (25, 70, 15), (60, 90, 10))


def followed(first: int, end: int, every: int, edges: tuple[int, ...] = ()) -> BackgroundRecord:
    """The record of a tracker that has measured the true rotation in every n-th frame."""
    known = np.arange(end - first) % every == 0
    R = np.swapaxes(TRUTH[first], 0, 1) @ TRUTH[first:end]
    frames = [
        FrameEdges(row, Segments(np.full((1, 2, 2), float(first)), np.ones(1))) for row in edges
    ]
    return BackgroundRecord(
        TIMES[first:end], np.where(known[:, None, None], R, np.eye(3)), known, [1.0], frames
    )


def test_windows_are_joined_to_the_rotation_of_the_clip() -> None:
    parts = [followed(first, end, 5) for first, end, _ in WINDOWS]
    whole = joined_backgrounds(parts, [overlap for _, _, overlap in WINDOWS])
    assert np.array_equal(whole.times, TIMES)
    assert whole.known.sum() == 18
    assert np.allclose(whole.R_first_camera[whole.known], TRUTH[whole.known], atol=1e-9)


def test_windows_that_disagree_go_over_into_each_other_without_a_jump() -> None:
    """The second window has drifted: by half a degree a second, which is 0.25 degrees over the
    common frames.
    """
    first = followed(0, 60, 1)
    second = followed(45, 90, 1)
    drift = exp(np.radians(0.5) * np.stack([np.zeros(45), TIMES[:45], np.zeros(45)], axis=1))
    second = replace(second, R_first_camera=second.R_first_camera @ drift)
    whole = joined_backgrounds([first, second], [0, 15])
    steps = np.swapaxes(whole.R_first_camera[:-1], 1, 2) @ whole.R_first_camera[1:]
    true_steps = np.swapaxes(TRUTH[:-1], 1, 2) @ TRUTH[1:]
    errors_deg = np.degrees(np.linalg.norm(log(np.swapaxes(true_steps, 1, 2) @ steps), axis=-1))
    # of the drift, 0.017 in every frame, and of the difference that is left
    assert errors_deg.max() < 0.04
    assert np.array_equal(whole.R_first_camera[:45], TRUTH[:45])


def test_a_window_without_common_frames_continues_in_the_last_direction_that_is_known() -> None:
    parts = [followed(0, 40, 1), followed(40, 60, 1)]
    whole = joined_backgrounds(parts, [0, 0])
    assert np.allclose(whole.R_first_camera[40], TRUTH[39], atol=1e-9)
