# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows over a clip: every frame is kept once, from a window in which it has neighbours."""

import numpy as np
import pytest
from scope.solver.motion.fit import FitWindow, combined, overlapping


def frames_kept(windows: list[FitWindow]) -> list[int]:
    """The frames that windows are kept for, none of them empty, in their order."""
    for w in windows:
        assert w.frames.start <= w.kept.start < w.kept.stop <= w.frames.stop
    return [frame for w in windows for frame in range(w.kept.start, w.kept.stop)]


@pytest.mark.parametrize(
    ("span", "length", "overlap"), [(10.0, 3.0, 1.0), (60.0, 8.0, 2.0), (8.1, 8.0, 2.0)]
)
def test_every_frame_is_kept_once_and_has_neighbours(
    span: float, length: float, overlap: float
) -> None:
    rng = np.random.default_rng(0)
    steps = rng.uniform(0.2, 1.8, round(60 * span))
    times = span * np.cumsum(steps) / steps.sum() + rng.uniform(-100, 100)
    windows = overlapping(times, length, overlap)
    assert frames_kept(windows) == list(range(len(times)))
    for w in windows:
        frames = times[w.frames]
        own = times[w.kept]
        assert frames[-1] - frames[0] <= length + 1e-9
        least = 0.4 * overlap  # half of it, but for the unevenness of the frames
        assert own[0] == times[0] or own[0] - frames[0] > least
        assert own[-1] == times[-1] or frames[-1] - own[-1] > least


def test_a_short_clip_is_one_window() -> None:
    (window,) = overlapping(np.arange(5) / 30, 8.0, 2.0)
    assert (window.frames, window.kept) == (slice(0, 5), slice(0, 5))
    (window,) = overlapping(np.array([3.0]), 8.0, 2.0)
    assert window.kept == slice(0, 1)


def test_a_gap_longer_than_a_window_leaves_none_empty() -> None:
    """`fit_motion` failed on a window without frames."""
    times = np.concatenate([np.arange(90) / 30, 40.0 + np.arange(90) / 30, [70.0, 100.0]])
    windows = overlapping(times, 8.0, 2.0)
    assert frames_kept(windows) == list(range(len(times)))


@pytest.mark.parametrize(("rate", "length"), [(5.0, 0.6), (10.0, 0.1)])
def test_windows_without_overlap_lose_no_frame_to_rounding(rate: float, length: float) -> None:
    """The end of one and the start of the next are one time, computed in two ways: a frame may lie
    between them.
    """
    for count in range(20, 300):
        times = np.arange(count) / rate
        windows = overlapping(times, length, 0.0)
        assert frames_kept(windows) == list(range(count))


def test_a_shape_that_nothing_measures_stays_where_it_was() -> None:
    """Without a prior, the windows' information of it is zero: the sum has no inverse."""
    rng = np.random.default_rng(0)
    A, B = (rng.standard_normal((4, 2)) for _ in range(2))
    x, y = rng.standard_normal((2, 2))
    nothing = np.zeros((3, 3))
    informations = [nothing.copy(), nothing.copy()]
    informations[0][:2, :2] = A.T @ A
    informations[1][:2, :2] = B.T @ B
    estimates = [np.append(x, 0.0), np.append(y, 0.0)]
    found = combined(estimates, informations, np.zeros(3), nothing)
    rows = np.concatenate([A, B])
    expected = np.linalg.lstsq(rows, np.concatenate([A @ x, B @ y]), rcond=None)[0]
    np.testing.assert_allclose(found, np.append(expected, 0.0), atol=1e-12)
