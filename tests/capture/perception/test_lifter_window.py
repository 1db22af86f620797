# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows around frames, against samples calculated by hand."""

import numpy as np
from scope.scope_addon.capture.perception.lifter import (
    LONGEST_GAP_S,
    MIDDLE,
    OFFSETS_S,
    windows_around,
)


def samples(times, seen, values=None):
    """Sample the windows of all frames, of their times or other values."""
    windows = windows_around(times, seen)
    rows = np.arange(len(times))
    first, end = windows.span(rows)
    x = (times if values is None else values).astype(float)[first:end, None]
    return windows.gather(x, rows, first)[..., 0]


def test_frames_of_variable_rate_are_interpolated_in_time():
    times = np.cumsum(np.random.default_rng(0).uniform(0.01, 0.2, 100))
    found = samples(times, np.ones(100, bool))
    expected = np.clip(times[:, None] + OFFSETS_S, times[0], times[-1])
    assert np.allclose(found, expected, atol=1e-6)


def test_a_short_gap_is_interpolated_and_a_long_one_ends_the_window():
    times = np.arange(90) / 30
    seen = np.ones(90, bool)
    seen[40:44] = False
    assert np.allclose(samples(times, seen)[39], times[39] + OFFSETS_S, atol=1e-6)
    seen[40:60] = False
    assert samples(times, seen)[39].max() <= times[39] + 1e-9
    assert samples(times, seen)[60].min() >= times[60] - 1e-9


def test_unseen_frames_do_not_contribute():
    times = np.arange(90) / 30
    seen = np.ones(90, bool)
    seen[[10, 33, 34, 70]] = False
    values = np.where(seen, 1.0, np.nan)
    assert np.isfinite(samples(times, seen, np.where(seen, values, 1e6))[seen]).all()
    assert np.allclose(samples(times, seen, np.where(seen, 1.0, 1e6))[seen], 1.0)


def test_windows_of_sparse_frames_and_stills_repeat_one_frame():
    times = np.arange(5) * 2 * LONGEST_GAP_S
    assert np.allclose(samples(times, np.ones(5, bool)), times[:, None])
    assert np.allclose(samples(np.zeros(1), np.ones(1, bool)), 0)
    # no frame was seen: all are used
    assert np.allclose(samples(times, np.zeros(5, bool))[:, MIDDLE], times)


def test_a_block_of_frames_needs_only_the_rows_around_it():
    times = np.arange(9000) / 60
    windows = windows_around(times, np.ones(9000, bool))
    rows = np.arange(4096, 8192)
    first, end = windows.span(rows)
    assert 24 <= 4096 - first <= 25
    assert 24 <= end - 8192 <= 25
    whole = windows.gather(times[:, None], rows, 0)
    assert np.array_equal(windows.gather(times[first:end, None], rows, first), whole)
