# SPDX-License-Identifier: GPL-3.0-or-later
"""Swapped legs or arms are repaired, and limbs that only pass each other are left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.tracking.left_right import MIRROR_PARTNER
from scope.scope_addon.capture.tracking.limb_swap import (
    ARMS,
    LEGS,
    repair_limb_swaps,
)
from scope.scope_addon.capture.tracking.track import Track

from ..walking import someone_walking, track_without_depth

HEADINGS = {"front": 0.0, "aslant": 0.8, "side": np.pi / 2, "back": np.pi}
LIMBS = {"legs": LEGS, "arms": ARMS}


def swapped(track: Track, points: np.ndarray, where: slice) -> Track:
    order = np.arange(33)
    order[points] = MIRROR_PARTNER[points]
    keypoints, confidence, world = (
        v.copy() for v in (track.keypoints_px, track.confidence, track.world_landmarks)
    )
    for values in (keypoints, confidence, world):
        values[where] = values[where][:, order]
    return replace(track, keypoints_px=keypoints, confidence=confidence, world_landmarks=world)


def walker(heading: float, rate: float = 30.0, count: int = 90, has_depth: bool = False) -> Track:
    """Half a pixel of noise and equal confidence on both sides: only positions carry
    information.
    """
    pixels, world = someone_walking(count, rate, heading)
    noise = np.random.default_rng(3).normal(0, 0.5, pixels.shape)
    track = track_without_depth(pixels + noise, rate, {})
    return replace(
        track,
        confidence=np.full((count, 33), 0.9),
        world_landmarks=world if has_depth else np.zeros_like(world),
    )


@pytest.mark.parametrize("has_depth", [False, True])
@pytest.mark.parametrize(
    ("which", "name"),
    # from the side the arms of this walk are nearly in one place
    [("legs", "side"), ("legs", "back"), ("arms", "aslant")],
)
def test_an_interval_is_repaired(which: str, name: str, has_depth: bool) -> None:
    right = walker(HEADINGS[name], has_depth=has_depth)
    for where in (slice(38, 61), slice(0, 9), slice(80, 90)):
        repaired = repair_limb_swaps(swapped(right, LIMBS[which].all_points, where))
        off = np.linalg.norm(repaired.keypoints_px - right.keypoints_px, axis=-1).max(axis=1)
        assert (off > 12.0).sum() <= 1  # where the limbs meet, either reading is right
        if has_depth:
            assert (
                np.linalg.norm(repaired.world_landmarks - right.world_landmarks, axis=-1) > 0.45
            ).sum() <= 2


def test_an_interval_of_slow_motion_is_repaired() -> None:
    right = walker(0.0, rate=240.0, count=240)
    repaired = repair_limb_swaps(swapped(right, LEGS.all_points, slice(80, 180)))
    off = np.linalg.norm(repaired.keypoints_px - right.keypoints_px, axis=-1).max(axis=1)
    assert (off > 12.0).sum() <= 6


@pytest.mark.parametrize("has_depth", [False, True])
@pytest.mark.parametrize(
    ("name", "rate"), [("side", 60.0), ("aslant", 15.0), ("front", 5.0), ("back", 5.0)]
)
def test_walking_is_left_alone(name: str, rate: float, has_depth: bool) -> None:
    track = walker(HEADINGS[name], rate, has_depth=has_depth)
    assert repair_limb_swaps(track) is track


def test_hands_go_with_the_arms() -> None:
    true_hands = np.random.default_rng(0).normal(size=(90, 2, 21, 7))
    true_hands[..., 6] = 0.5  # The network does not know which hand it is.
    right = replace(walker(HEADINGS["front"]), hands=true_hands)
    wrong = swapped(right, ARMS.all_points, slice(30, 50))
    hands = true_hands.copy()
    hands[30:50] = hands[30:50, ::-1]
    arms = repair_limb_swaps(replace(wrong, hands=hands))
    assert arms.hands is not None
    np.testing.assert_array_equal(arms.hands, true_hands)
    legs = repair_limb_swaps(swapped(right, LEGS.all_points, slice(30, 50)))
    assert legs.hands is not None
    np.testing.assert_array_equal(legs.hands, true_hands)
