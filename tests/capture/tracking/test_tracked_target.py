# SPDX-License-Identifier: GPL-3.0-or-later
"""A target that becomes occluded: a synthetic body whose landmarks jump, lose confidence, or
both.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.perception.landmark_network import PoseEstimate
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.tracked_target import TrackedTarget

SIDE = 400.0
BODY = np.random.default_rng(1).normal(scale=0.2 * SIDE, size=(33, 2))


def at(x: float, confidence: float = 0.9) -> PoseEstimate:
    region = Region((x, 300.0), SIDE, 0.0)
    sure = np.full(33, confidence)
    return PoseEstimate(BODY + [x, 300.0], sure, np.zeros((33, 3)), 0.99, region, region)


def walker() -> TrackedTarget:
    """A target that was tracked for 30 frames, last seen at 348 px, predicted at 360 px."""
    target = TrackedTarget(0, at(0.0), np.zeros(2), 0.0)
    for t in range(1, 30):
        target.update(at(12.0 * t), False, t / 30, 1 / 30)
    return target


@pytest.mark.parametrize(
    ("jump", "confidence", "occluded"),
    [(0, 0.9, False), (60, 0.9, False), (0, 0.4, False), (60, 0.4, True)],
)
def test_a_jump_with_less_confidence_is_an_occlusion(
    jump: float, confidence: float, occluded: bool
) -> None:
    assert walker().becomes_occluded(at(360.0 + jump, confidence)) == occluded


def test_a_person_is_predicted_at_constant_velocity() -> None:
    target = walker()
    assert target.prefetch_region.center_px == pytest.approx((360.0, 300.0))
    for lost, x in ((0, 348.0), (1, 360.0), (5, 408.0)):
        target.frames_lost = lost
        assert target.predicted_region.center_px == pytest.approx((x, 300.0))
        assert target.innovation(at(max(x, 360.0))) == pytest.approx(0.0, abs=1e-9)
        assert target.innovation(at(max(x, 360.0) + 40.0)) == pytest.approx(40.0 / SIDE)


def test_an_occluder_is_distinguished_by_confidence_and_position() -> None:
    target = walker()
    dim = at(360.0, 0.4)
    sure = at(360.0)
    elsewhere = at(360.0 + SIDE, 0.4)
    assert not target.is_occluded_by(dim)  # lost for another reason
    target.is_occluded = True
    target.frames_lost = 3
    assert target.is_occluded_by(dim)
    assert not target.is_occluded_by(sure)
    assert not target.is_occluded_by(elsewhere)
    larger = replace(dim, region=replace(dim.region, side_px=3 * SIDE))
    assert not target.is_occluded_by(larger)
