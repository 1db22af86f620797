# SPDX-License-Identifier: GPL-3.0-or-later
"""What counts as a body, as the same body, and as one in the image: each limit from both of its
sides.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.perception.landmark_network import PoseEstimate
from scope.scope_addon.capture.perception.region import MARGIN, Region
from scope.scope_addon.capture.tracking import plausibility

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
        (body(confident=4), True, True),
        (body(spread=0.37), False, False),
        # a hand may look so: something else has to say that there is a body
        (body(spread=0.42), True, False),
        (body(twist=2.0), False, False),
    ],
)
def test_a_body_is_present_confident_spread_and_consistent(estimate, expected, unsure) -> None:
    assert plausibility.is_plausible(estimate) is expected
    assert plausibility.is_plausible(estimate, sure=False) is unsure


@pytest.mark.parametrize(("shift_px", "same"), [(0.0, True), (24.0, True), (26.0, False)])
def test_two_estimates_within_a_tenth_of_a_region_are_one_body(shift_px: float, same: bool) -> None:
    moved = replace(body(), keypoints_px=body().keypoints_px + [shift_px, 0.0])
    assert plausibility.is_same_body(body(), moved) is same
    assert plausibility.is_same_body(moved, body()) is same


def test_shares_count_keypoints() -> None:
    estimate = replace(
        body(), keypoints_px=np.stack([np.linspace(-160, 639, 33), np.full(33, 100.0)], axis=1)
    )
    inside = (estimate.keypoints_px[:, 0] >= 0).mean()
    assert plausibility.share_in_image(estimate, IMAGE) == pytest.approx(inside)
    assert plausibility.is_center_in_image(estimate, IMAGE)
    left = replace(estimate, keypoints_px=estimate.keypoints_px - [400.0, 0.0])
    assert not plausibility.is_center_in_image(left, IMAGE)
    # the outermost are its border
    assert plausibility.share_within(body(), body()) == pytest.approx(1.0, abs=0.13)
    assert plausibility.share_within(body(), left) == 0.0


@pytest.mark.parametrize(
    ("other", "same"),
    [
        (Region((320.0, 240.0), 250.0, 2 * math.pi), True),
        (Region((338.0, 240.0), 250.0, 0.0), True),
        (Region((342.0, 240.0), 250.0, 0.0), False),
        (Region((320.0, 240.0), 275.0, 0.0), True),
        (Region((320.0, 240.0), 300.0, 0.0), False),
        (Region((320.0, 240.0), 250.0, 0.14), True),
        (Region((320.0, 240.0), 250.0, -0.16), False),
    ],
)
def test_a_predicted_region_may_be_slightly_off(other: Region, same: bool) -> None:
    assert plausibility.is_same_region(other, REGION) is same


@pytest.mark.parametrize(
    ("region", "usable"),
    [
        (REGION, True),
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
