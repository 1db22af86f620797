# SPDX-License-Identifier: GPL-3.0-or-later
"""Which frames get person masks, and that a track keeps them with their rows."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest
from scope.scope_addon.capture.perception.landmark_network import LandmarkNetwork
from scope.scope_addon.capture.perception.observation import Observation, PersonMask
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.mask_schedule import MASKS, MIN_STRIDE, MaskSchedule
from scope.scope_addon.capture.tracking.track import Tracklet, make_track, single_frame_track

IMAGE = np.zeros((48, 64, 3), np.uint8)


class Network:
    """Gives masks of one value each, counted from 1."""

    calls = 0

    def mask(self, image_rgb: np.ndarray, region: Region) -> np.ndarray:
        self.calls += 1
        return np.full((256, 256), self.calls, np.float32)


def schedule(frames: int) -> MaskSchedule:
    return MaskSchedule(cast(LandmarkNetwork, Network()), frames)


def seen(presence: float = 1.0, **more: Any) -> Observation:
    points = np.random.default_rng(0).uniform(10, 40, (33, 2))
    return Observation(
        points,
        np.ones(33),
        np.zeros((33, 3)),
        presence,
        Region((30.0, 20.0), 40.0, 0.0),
        acquired=False,
        **more,
    )


def masked(schedule: MaskSchedule, frames: int) -> list[int]:
    return [k for k in range(frames) if schedule.add(IMAGE, [(0, seen())])[0][1].mask is not None]


def test_a_short_clip_has_a_mask_in_its_first_frame_and_then_every_few() -> None:
    assert masked(schedule(40), 40) == list(range(0, 40, MIN_STRIDE))


@pytest.mark.parametrize("expected", [3000, 0])
def test_masks_spread_over_a_long_clip_whether_or_not_its_length_is_known(expected: int) -> None:
    frames = masked(schedule(expected), 3000)
    assert MASKS <= len(frames) <= 6 * MASKS
    assert frames[-1] > 2400


@pytest.mark.parametrize("expected", [3000, 40, 0])
def test_the_frame_before_knows_which_one_is_due(expected: int) -> None:
    masks = schedule(expected)
    due = []
    told = []
    for k in range(600):
        told += [k + 1] if masks.upcoming_is_due else []
        due += [k] if masks.add(IMAGE, [(0, seen())])[0][1].mask is not None else []
    assert due[1:] == [k for k in told if k < 600]
    assert len(due) > 3


def test_a_mask_that_the_tracker_gives_is_not_computed_again() -> None:
    network = Network()
    masks = MaskSchedule(cast(LandmarkNetwork, network), 40)
    given = PersonMask(
        Region((30.0, 20.0), 40.0, 0.0), np.full((256, 256), 0.7, np.float16), (64, 48)
    )
    ((_, kept),) = masks.add(IMAGE, [(0, seen(mask=given))])
    assert kept.mask is given
    assert network.calls == 0
    other = MaskSchedule(cast(LandmarkNetwork, network), 40)
    ((_, doubtful),) = other.add(IMAGE, [(0, seen(presence=0.3, mask=given))])
    assert doubtful.mask is None
    ((_, not_due),) = masks.add(IMAGE, [(0, seen(mask=given))])
    assert not_due.mask is None


def test_nobody_has_no_mask_and_does_not_use_up_a_turn() -> None:
    masks = schedule(40)
    assert masks.add(IMAGE, []) == []
    ((_, doubtful),) = masks.add(IMAGE, [(0, seen(presence=0.3))])
    assert doubtful.mask is None
    assert masked(MaskSchedule(None, 40), 40) == []


def test_a_track_keeps_masks_with_their_rows() -> None:
    masks = schedule(40)
    tracklet = Tracklet()
    for row in range(20):
        tracklet.add(row, masks.add(IMAGE, [(0, seen())])[0][1])
    track = make_track(range(20), [row / 30 for row in range(20)], [tracklet])
    expected = [(row, 1.0 + number) for number, row in enumerate(range(0, 20, MIN_STRIDE))]
    assert [(row, float(mask.probability[0, 0])) for row, mask in track.masks] == expected
    assert track.masks[0][1].image_size == (64, 48)
    tracklet.truncate(MIN_STRIDE)
    assert [row for row, _ in tracklet.masks] == [0]
    observation = masks.add(IMAGE, [(0, seen())])[0][1]
    assert single_frame_track(observation).masks == ()
