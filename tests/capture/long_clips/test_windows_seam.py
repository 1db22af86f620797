# SPDX-License-Identifier: GPL-3.0-or-later
"""Who is who in the frames that two windows share, and how their keypoints go over into each
other.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.camera.background_record import BackgroundRecord
from scope.scope_addon.capture.frame_observer import Observed
from scope.scope_addon.capture.long_clips.windows import (
    faded,
    missed_people,
    same_people,
)
from scope.scope_addon.capture.tracking.track import Tracklet
from scope.scope_addon.scene_gaps import SCENE_GAP_S

# pixels; frames
SIDE = 200.0
OVERLAP = 12
BEFORE = 30


def tracklet(rows: range, x: float, side: float = SIDE, speed: float = 0.0) -> Tracklet:
    """Return somebody whose keypoints are all at x, and move by some pixels a frame."""
    values = [np.full((33, 6), x + speed * k, np.float32) for k in range(len(rows))]
    return Tracklet(list(rows), values, [np.full(2, x)] * len(rows), [side] * len(rows))


def record(count: int, first: int, anchor: int, tracklets: dict[int, Tracklet]) -> Observed:
    times = np.arange(count) / 30
    background = BackgroundRecord(
        times, np.tile(np.eye(3), (count, 1, 1)), np.ones(count, bool), []
    )
    return Observed(
        list(range(count)), times.tolist(), [], tracklets, background, first=first, anchor=anchor
    )


def windows(before: dict[int, Tracklet], after: dict[int, Tracklet]) -> tuple[Observed, Observed]:
    """Return two windows, of which the first OVERLAP frames of the second are the last ones of the
    first.
    """
    return record(BEFORE, 0, BEFORE - OVERLAP, before), record(40, OVERLAP, 40, after)


@pytest.mark.parametrize("speed", [1.0, 8.0])
def test_the_gap_at_a_cut_is_as_long_in_what_slow_motion_shows(speed: float) -> None:
    observed = record(40, 0, 40, {0: tracklet(range(40), 100.0)})
    observed.cut_rows = [15]
    ((track,), _) = observed.tracks(1, speed=speed)
    steps_s = np.diff(track.times) / speed
    assert steps_s[14] == pytest.approx(SCENE_GAP_S + 1 / 30 / speed)
    np.testing.assert_allclose(np.delete(steps_s, 14), 1 / 30 / speed)


def test_people_in_the_same_places_are_the_same_whatever_their_numbers() -> None:
    before = {3: tracklet(range(BEFORE), 100.0), 5: tracklet(range(20, BEFORE), 600.0)}
    after = {
        0: tracklet(range(40), 605.0),
        1: tracklet(range(40), 96.0),
        2: tracklet(range(40), 900.0),
    }
    assert same_people(*windows(before, after)) == {0: 5, 1: 3}


def test_only_the_last_frames_are_compared_and_both_must_last() -> None:
    met = {3: tracklet(range(BEFORE), 100.0)}
    late = tracklet(range(40), 100.0)
    # before the last ten shared frames
    late.values[0] = late.values[1] = np.full((33, 6), 900.0, np.float32)
    assert same_people(*windows(met, {0: late})) == {0: 3}
    assert same_people(*windows(met, {0: tracklet(range(OVERLAP - 1), 100.0)})) == {}
    assert (
        same_people(
            *windows({3: tracklet(range(BEFORE - 1), 100.0)}, {0: tracklet(range(40), 100.0)})
        )
        == {}
    )


def test_somebody_is_missed_who_was_followed_throughout_the_shared_frames() -> None:
    nobody: dict[int, Tracklet] = {}
    throughout = tracklet(range(BEFORE), 100.0)
    newcomer = tracklet(range(BEFORE - OVERLAP + 1, BEFORE), 100.0)
    interrupted = tracklet(range(BEFORE), 100.0)
    del (
        interrupted.rows[-5],
        interrupted.values[-5],
        interrupted.centers_px[-5],
        interrupted.sides_px[-5],
    )
    found = [
        missed_people(*windows({3: each}, nobody)) for each in (throughout, newcomer, interrupted)
    ]
    assert found == [True, False, False]
    assert not missed_people(*windows({3: throughout}, {0: tracklet(range(40), 100.0)}))


def test_keypoints_go_over_evenly() -> None:
    earlier = tracklet(range(BEFORE), 100.0)
    later = tracklet(range(40), 104.0)
    values = faded(earlier, later, BEFORE - OVERLAP, OVERLAP)
    assert sorted(values) == list(range(BEFORE - OVERLAP, BEFORE))
    rising = [float(values[k][0, 0]) for k in sorted(values)]
    np.testing.assert_allclose(
        rising, 100 + 4 * np.arange(1, OVERLAP + 1) / (OVERLAP + 1), atol=1e-4
    )
    # 0.07 of the region apart
    assert faded(earlier, tracklet(range(40), 110.0), BEFORE - OVERLAP, OVERLAP) == {}


@pytest.mark.parametrize(
    ("x", "sides", "is_same"),
    [
        (119.0, (SIDE, SIDE), True),
        (119.0, (SIDE, 60.0), False),
        (119.0, (60.0, SIDE), False),
    ],
)
def test_how_near_is_measured_by_the_smaller_region(
    x: float, sides: tuple[float, float], is_same: bool
) -> None:
    """Keypoints lie 1.41 times as far apart as their coordinates: 0.15 of 200 pixels are 21 in
    each.
    """
    before = tracklet(range(BEFORE), 100.0, sides[0])
    after = tracklet(range(40), x, sides[1])
    assert same_people(*windows({3: before}, {0: after})) == ({0: 3} if is_same else {})


def test_windows_that_do_not_share_their_frames_share_nobody() -> None:
    before, after = windows({3: tracklet(range(BEFORE), 100.0)}, {0: tracklet(range(40), 100.0)})
    before.anchor += 1
    assert same_people(before, after) == {}
    before.anchor = BEFORE
    after.first = 0
    assert same_people(before, after) == {}
    assert not missed_people(before, after)
