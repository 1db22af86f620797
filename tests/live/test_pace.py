# SPDX-License-Identifier: GPL-3.0-or-later
"""Which frames are processed by machines of known speed."""

import numpy as np
import pytest
from scope.scope_addon.live.newest_frame import IN_TIME_S, Pace


def processed(rate, seconds, took_s, pace=None):
    """Numbers of the frames that a machine processes which always takes the newest one that is due.

    :param took_s: of the frame that is taken at a time.
    """
    pace = pace or Pace()
    taken = []
    busy_until_s = 0.0
    waiting = None
    for k in range(round(rate * seconds)):
        due_s = k / rate
        while waiting is not None and busy_until_s <= due_s:
            taken.append(waiting)
            started_s = max(busy_until_s, taken[-1] / rate)
            waiting = None
            pace.take(taken[-1] / rate)
            busy_until_s = started_s + took_s(started_s)
            pace.add_duration(busy_until_s - started_s)
        if pace.is_due(due_s):
            waiting = k
        if waiting is not None and busy_until_s <= due_s:
            taken.append(waiting)
            waiting = None
            pace.take(taken[-1] / rate)
            busy_until_s = due_s + took_s(due_s)
            pace.add_duration(busy_until_s - due_s)
    return np.array(taken)


def steps_after(frames, rate, seconds):
    return np.diff(frames[frames > seconds * rate])


@pytest.mark.parametrize(
    ("rate", "took_s", "every"), [(60, 0.02, 2), (60, 0.03, 2), (120, 0.012, 2), (120, 0.022, 4)]
)
def test_frames_that_take_too_long_are_processed_evenly(rate, took_s, every):
    steps = steps_after(processed(rate, 10, lambda _: took_s), rate, IN_TIME_S + 1.0)
    assert set(steps) == {every}


def test_a_slow_machine_that_becomes_faster_processes_more_frames_again():
    pace = Pace()
    frames = processed(60, 20, lambda now_s: 0.06 if now_s < 8.0 else 0.02, pace)
    assert set(np.diff(frames[(frames > 3 * 60) & (frames < 8 * 60)])) == {4}
    assert set(steps_after(frames, 60, 8.0 + IN_TIME_S + 1.0)) == {2}


def test_a_fast_machine_processes_every_frame_though_some_take_longer():
    frames = processed(60, 15, lambda s: 0.025 if s % 1.0 < 0.02 else 0.012)
    assert np.mean(steps_after(frames, 60, IN_TIME_S + 1.0) == 1) > 0.95


def test_a_machine_that_becomes_faster_processes_every_frame_again_and_does_not_waver():
    pace = Pace()
    changes = []
    every = None

    def took_s(now_s):
        nonlocal every
        if pace.every != every:
            every = pace.every
            changes.append((now_s, every))
        return 0.02 if now_s < 3.0 else 0.01

    frames = processed(60, 20, took_s, pace)
    assert [n for _, n in changes] == [2, 1]
    assert changes[-1][0] < 3.0 + IN_TIME_S + 1.0
    assert set(steps_after(frames, 60, 10)) == {1}


def test_a_source_that_becomes_slower_is_not_thinned_any_more():
    pace = Pace()
    processed(60, 5, lambda _: 0.03, pace)
    assert pace.every == 2
    for k in range(60):
        time_s = 5.0 + k / 30
        if pace.is_due(time_s):
            pace.take(time_s)
            pace.add_duration(0.03)
    assert pace.every == 1
