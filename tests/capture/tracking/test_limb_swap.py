# SPDX-License-Identifier: GPL-3.0-or-later
"""Swapped legs or arms are repaired, and limbs that only pass each other are left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.tracking.left_right import MIRROR_PARTNER
from scope.scope_addon.capture.tracking.limb_swap import (
    ARMS,
    LEGS,
    find_limb_swaps,
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


def test_the_points_that_are_swapped() -> None:
    names = {key: {KEYPOINT_NAMES[k] for k in limbs.all_points} for key, limbs in LIMBS.items()}
    assert names["legs"] == {
        f"{side}_{part}"
        for side in ("left", "right")
        for part in ("knee", "ankle", "heel", "foot_index")
    }
    assert {"left_elbow", "right_wrist", "left_thumb", "right_pinky", "left_index"} < names["arms"]
    assert not any("shoulder" in name or "foot" in name for name in names["arms"])
    for limbs in LIMBS.values():
        np.testing.assert_array_equal(MIRROR_PARTNER[limbs.joints], limbs.joints[[1, 0, 3, 2]])


@pytest.mark.parametrize("has_depth", [False, True])
@pytest.mark.parametrize(
    ("which", "name"),
    # from the side the arms of this walk are nearly in one place
    [(which, name) for which in LIMBS for name in HEADINGS if (which, name) != ("arms", "side")],
)
def test_an_interval_is_repaired(which: str, name: str, has_depth: bool) -> None:
    right = walker(HEADINGS[name], has_depth=has_depth)
    for where in (slice(20, 32), slice(38, 61), slice(0, 9), slice(80, 90)):
        repaired = repair_limb_swaps(swapped(right, LIMBS[which].all_points, where))
        off = np.linalg.norm(repaired.keypoints_px - right.keypoints_px, axis=-1).max(axis=1)
        assert (off > 12.0).sum() <= 1  # where the limbs meet, either reading is right
        if has_depth:
            assert (
                np.linalg.norm(repaired.world_landmarks - right.world_landmarks, axis=-1) > 0.45
            ).sum() <= 2


@pytest.mark.parametrize("rate", [60.0, 15.0, 5.0])
@pytest.mark.parametrize("heading", HEADINGS.values(), ids=HEADINGS)
def test_walking_is_left_alone(heading: float, rate: float) -> None:
    for has_depth in (False, True):
        track = walker(heading, rate, has_depth=has_depth)
        assert repair_limb_swaps(track) is track


def test_the_reference_decides_where_more_than_half_is_wrong() -> None:
    right = walker(HEADINGS["aslant"], has_depth=True)
    rows = np.array([5, 20, 35, 50])
    wrong = swapped(right, LEGS.all_points, slice(12, 60))
    referenced = replace(
        wrong, reference_rows=rows, reference_landmarks=right.world_landmarks[rows]
    )
    alone, helped = (
        np.linalg.norm(repair_limb_swaps(track).keypoints_px - right.keypoints_px, axis=-1)
        for track in (wrong, referenced)
    )
    assert (alone.max(axis=1) > 12.0).sum() > 40
    assert (helped.max(axis=1) > 12.0).sum() <= 1


def test_hands_go_with_the_arms() -> None:
    true_hands = np.random.default_rng(0).normal(size=(90, 2, 21, 6))
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


def test_another_person_need_not_continue_the_motion() -> None:
    one = walker(0.0, count=40)
    other = walker(np.pi, count=50)
    both = replace(
        walker(0.0),
        keypoints_px=np.concatenate([one.keypoints_px, other.keypoints_px]),
        acquired=np.isin(np.arange(90), [0, 40]),
    )
    assert not find_limb_swaps(both, LEGS).any()


def test_nothing_to_do() -> None:
    track = walker(0.0, count=5)
    assert repair_limb_swaps(replace(track, seen=np.zeros(5, bool))) is not None
    for count in (0, 1, 2):
        rows = slice(0, count)
        short = replace(
            track,
            **{
                key: getattr(track, key)[rows]
                for key in (
                    "frames",
                    "times",
                    "seen",
                    "keypoints_px",
                    "confidence",
                    "world_landmarks",
                    "acquired",
                )
            },
        )
        assert repair_limb_swaps(short) is short
