# SPDX-License-Identifier: GPL-3.0-or-later
"""Which frames are processed by machines of known speed."""

import numpy as np
import pytest
from scope.scope_addon.live.newest_frame import IN_TIME_S, SLOWEST_S, Pace


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


@pytest.mark.parametrize(
    ("rate", "took_s", "every"), [(60, 0.06, 4), (60, 0.045, 3), (30, 0.06, 2), (120, 0.045, 6)]
)
def test_a_slow_machine_processes_evenly_what_is_hardly_less(rate, took_s, every):
    frames = processed(rate, 20, lambda _: took_s)
    assert set(steps_after(frames, rate, 3.0)) == {every}
    assert len(frames) > 20 / (1.25 * took_s) - 10


def test_a_slow_machine_whose_times_vary_does_not_waver():
    """As where one network more is asked in most frames, and now and then in none for a while."""
    pace = Pace()
    random = np.random.default_rng(0)
    chosen = []

    def took_s(now_s):
        chosen.append(pace.every)
        network_s = 0.0 if now_s % 3.0 < 0.15 else 0.042
        return 0.0185 * np.exp(random.normal(0, 0.12)) + network_s

    processed(60, 30, took_s, pace)
    assert set(chosen[60:]) == {4}


def test_a_slow_machine_that_becomes_faster_processes_more_frames_again():
    pace = Pace()
    frames = processed(60, 20, lambda now_s: 0.06 if now_s < 8.0 else 0.02, pace)
    assert set(np.diff(frames[(frames > 3 * 60) & (frames < 8 * 60)])) == {4}
    assert set(steps_after(frames, 60, 8.0 + IN_TIME_S + 1.0)) == {2}


def test_the_first_seconds_begin_evenly():
    """As soon as it is known how far apart frames are: the first one takes long."""
    frames = processed(60, 3, lambda s: 0.3 if s == 0.0 else 0.012)
    assert set(np.diff(frames)[1:]) == {2}


def test_uneven_times_too_give_even_frames():
    random = np.random.default_rng(0)
    steps = steps_after(processed(60, 20, lambda _: 0.02 * np.exp(random.normal(0, 0.2))), 60, 1.5)
    assert np.mean(steps == 2) > 0.98


def test_a_fast_machine_processes_every_frame_though_some_take_longer():
    frames = processed(60, 15, lambda s: 0.025 if s % 1.0 < 0.02 else 0.012)
    assert np.mean(steps_after(frames, 60, IN_TIME_S + 1.0) == 1) > 0.95


@pytest.mark.parametrize(("rate", "took_s"), [(30, 0.04), (50, 0.03), (25, 0.2)])
def test_a_source_is_not_made_slower_than_28_frames_per_second(rate, took_s):
    pace = Pace()
    processed(rate, 10, lambda _: took_s, pace)
    assert pace.every == 1
    assert pace.every / rate <= max(SLOWEST_S, 1 / rate)


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


def test_a_machine_that_is_barely_fast_enough_does_not_waver():
    pace = Pace()
    chosen = []
    processed(
        60, 20, lambda _: chosen.append(pace.every) or 0.0145 * (1 + 0.1 * (len(chosen) % 3)), pace
    )
    assert set(chosen[10:]) == {2}


def test_times_that_vary_by_some_milliseconds_do_not_matter():
    """As those of a camera, whose frames are timed when they come."""
    pace = Pace()
    random = np.random.default_rng(0)
    due = []
    pace.every = 2
    for k in range(300):
        time_s = k / 60 + random.uniform(-0.003, 0.003)
        if pace.is_due(time_s):
            pace.take(time_s)
            due.append(k)
    assert set(np.diff(due[20:])) == {2}


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
