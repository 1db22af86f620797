# SPDX-License-Identifier: GPL-3.0-or-later
"""What counts as a body, as the same body, and as one in the image: each limit from both of its
sides.

Which frames get person masks, and that a track keeps them with their rows.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from scope.scope_addon.capture.perception.landmark_network import LandmarkNetwork, PoseEstimate
from scope.scope_addon.capture.perception.observation import Observation, PersonMask
from scope.scope_addon.capture.perception.region import MARGIN, Region
from scope.scope_addon.capture.tracking import plausibility
from scope.scope_addon.capture.tracking.search_schedule import MASKS, MIN_STRIDE, MaskSchedule
from scope.scope_addon.capture.tracking.track import Tracklet, make_track, single_frame_track

IMAGE = np.zeros((480, 640, 3), np.uint8)


REGION = Region((320.0, 240.0), 250.0, 0.0)


def body(
    spread: float = 0.6, presence: float = 0.9, confident: int = 33, twist: float = 0.0
) -> PoseEstimate:
    """Return an estimate whose keypoints have this spread; `twist` spoils the landmarks in space by
    that share.
    """
    rng = np.random.default_rng(3)
    shape = rng.normal(size=(33, 3))
    shape -= shape.mean(axis=0)
    flat = shape[:, :2] / np.sqrt((shape[:, :2] ** 2).sum(axis=1).mean())
    keypoints = np.array(REGION.center_px) + spread * REGION.side_px / (2 * MARGIN) * flat
    confidence = np.where(np.arange(33) < confident, 0.8, 0.1)
    space = shape + twist * rng.normal(size=(33, 3))
    return PoseEstimate(keypoints, confidence, space, presence, REGION, REGION)


@pytest.mark.parametrize(
    ("estimate", "expected", "unsure"),
    [
        (body(), True, True),
        (body(presence=0.49), False, False),
        (body(confident=3), False, False),
        (body(spread=0.37), False, False),
        # a hand may look so: something else has to say that there is a body
        (body(spread=0.42), True, False),
        (body(twist=2.0), False, False),
    ],
)
def test_a_body_is_present_confident_spread_and_consistent(estimate, expected, unsure) -> None:
    assert plausibility.is_plausible(estimate) is expected
    assert plausibility.is_plausible(estimate, sure=False) is unsure


@pytest.mark.parametrize(("shift_px", "same"), [(24.0, True), (26.0, False)])
def test_two_estimates_within_a_tenth_of_a_region_are_one_body(shift_px: float, same: bool) -> None:
    moved = replace(body(), keypoints_px=body().keypoints_px + [shift_px, 0.0])
    assert plausibility.is_same_body(body(), moved) is same


@pytest.mark.parametrize(
    ("other", "same"),
    [
        (Region((320.0, 240.0), 250.0, 2 * math.pi), True),
        (Region((342.0, 240.0), 250.0, 0.0), False),
        (Region((320.0, 240.0), 300.0, 0.0), False),
        (Region((320.0, 240.0), 250.0, -0.16), False),
    ],
)
def test_a_predicted_region_may_be_slightly_off(other: Region, same: bool) -> None:
    assert plausibility.is_same_region(other, REGION) is same


@pytest.mark.parametrize(
    ("region", "usable"),
    [
        (Region((-100.0, 240.0), 250.0, 0.0), True),
        (Region((-130.0, 240.0), 250.0, 0.0), False),
        (Region((320.0, 610.0), 250.0, 0.0), False),
        (Region((320.0, 240.0), 23.0, 0.0), False),
        (Region((320.0, 240.0), 4000.0, 0.0), False),
        (Region((320.0, 240.0), math.nan, 0.0), False),
    ],
)
def test_a_region_overlaps_the_image_and_has_a_usable_size(region: Region, usable: bool) -> None:
    assert plausibility.is_in_image(region, IMAGE) is usable


MASK_SCHEDULE_IMAGE = np.zeros((48, 64, 3), np.uint8)


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
    return [
        k
        for k in range(frames)
        if schedule.add(MASK_SCHEDULE_IMAGE, [(0, seen())])[0][1].mask is not None
    ]


@pytest.mark.parametrize("expected", [3000, 0])
def test_masks_spread_over_a_long_clip_whether_or_not_its_length_is_known(expected: int) -> None:
    frames = masked(schedule(expected), 3000)
    assert MASKS <= len(frames) <= 6 * MASKS
    assert frames[-1] > 2400


def test_a_mask_that_the_tracker_gives_is_not_computed_again() -> None:
    network = Network()
    masks = MaskSchedule(cast(LandmarkNetwork, network), 40)
    given = PersonMask(
        Region((30.0, 20.0), 40.0, 0.0), np.full((256, 256), 0.7, np.float16), (64, 48)
    )
    ((_, kept),) = masks.add(MASK_SCHEDULE_IMAGE, [(0, seen(mask=given))])
    assert kept.mask is given
    assert network.calls == 0
    other = MaskSchedule(cast(LandmarkNetwork, network), 40)
    ((_, doubtful),) = other.add(MASK_SCHEDULE_IMAGE, [(0, seen(presence=0.3, mask=given))])
    assert doubtful.mask is None
    ((_, not_due),) = masks.add(MASK_SCHEDULE_IMAGE, [(0, seen(mask=given))])
    assert not_due.mask is None


def test_a_track_keeps_masks_with_their_rows() -> None:
    masks = schedule(40)
    tracklet = Tracklet()
    for row in range(20):
        tracklet.add(row, masks.add(MASK_SCHEDULE_IMAGE, [(0, seen())])[0][1])
    track = make_track(range(20), [row / 30 for row in range(20)], [tracklet])
    expected = [(row, 1.0 + number) for number, row in enumerate(range(0, 20, MIN_STRIDE))]
    assert [(row, float(mask.probability[0, 0])) for row, mask in track.masks] == expected
    assert track.masks[0][1].image_size == (64, 48)
    tracklet.truncate(MIN_STRIDE)
    assert [row for row, _ in tracklet.masks] == [0]
    observation = masks.add(MASK_SCHEDULE_IMAGE, [(0, seen())])[0][1]
    assert single_frame_track(observation).masks == ()
