# SPDX-License-Identifier: GPL-3.0-or-later
"""Left-right swaps are found, and real turns are left alone."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import Camera, pinhole
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.tracking.left_right import (
    LEFT_RIGHT_SWAPPED,
    MIRROR_PARTNER,
    find_labels,
    repair_left_right,
)
from scope.scope_addon.capture.tracking.track import Track
from scope.solver.rotations import exp

from ..walking import someone_walking, track_without_depth

CAMERA = Camera(pinhole(1280, 720, 1100.0), np.zeros(5), "of the test")


def walker(count: int, turn_rad: float = 0.0) -> np.ndarray:
    """A body with noise that turns about its vertical axis by ``turn_rad`` over the clip."""
    rng = np.random.default_rng(2)
    body = rng.normal(0, 0.3, (33, 3))
    body[:, 0] = [0.2 if "left" in n else -0.2 if "right" in n else 0.0 for n in KEYPOINT_NAMES]
    turns = exp(np.linspace(0, turn_rad, count)[:, None] * [0.0, 1.0, 0.0])
    return np.einsum("tij,kj->tki", turns, body) + rng.normal(0, 0.01, (count, 33, 3))


@pytest.mark.parametrize("turn_rad", [0.0, 2 * np.pi])
@pytest.mark.parametrize("stretch", [slice(0, 0), slice(20, 21), slice(30, 75), slice(90, 120)])
def test_a_swap_of_less_than_half_the_clip_is_found(stretch: slice, turn_rad: float) -> None:
    world = walker(120, turn_rad)
    expected = np.zeros(120, bool)
    expected[stretch] = True
    world[stretch] = world[stretch][:, MIRROR_PARTNER]
    np.testing.assert_array_equal(find_labels(world) == LEFT_RIGHT_SWAPPED, expected)


def test_a_track_is_repaired_and_left_alone_where_nobody_was_seen() -> None:
    right = walker(90)
    wrong = right.copy()
    seen = np.ones(90, bool)
    wrong[10:70] = wrong[10:70][:, MIRROR_PARTNER]
    wrong[80:85] += [0.0, 0.0, 0.5]  # the reference differs
    seen[40:44] = False
    rows = np.array([0, 30, 60, 82])
    track = Track(
        frames=np.arange(90),
        times=np.arange(90) / 30,
        seen=seen,
        keypoints_px=np.where(seen[:, None, None], wrong[..., :2], 0),
        confidence=np.where(seen[:, None], wrong[..., 0], 0),
        world_landmarks=np.where(seen[:, None, None], wrong, 0),
        acquired=np.arange(90) == 0,
        reference_rows=rows,
        reference_landmarks=right[rows],
    )
    repaired = repair_left_right(track, CAMERA)
    undisturbed = seen & (np.arange(90) < 75)
    np.testing.assert_allclose(repaired.world_landmarks[undisturbed], right[undisturbed], atol=1e-9)
    np.testing.assert_allclose(repaired.keypoints_px[undisturbed], right[undisturbed][..., :2])
    np.testing.assert_allclose(repaired.confidence[undisturbed], right[undisturbed][..., 0])
    np.testing.assert_allclose(repaired.world_landmarks[82], right[82], atol=1e-9)
    assert (np.abs(repaired.world_landmarks - wrong)[81:84, :, 2].mean(axis=1) > 0.3).all()
    assert not repaired.world_landmarks[~seen].any()
    assert not repaired.keypoints_px[~seen].any()


HEADINGS = {"aslant": 0.8, "side": np.pi / 2, "back": np.pi}


# In a side view both readings are equally continuous where the legs pass each other: only the
# reference decides.
@pytest.mark.parametrize(
    ("name", "has_reference"),
    [("side", True), ("back", True), ("aslant", False), ("back", False)],
)
def test_keypoints_without_depth_are_repaired(name: str, has_reference: bool) -> None:
    """Swaps by a user's network are found by continuity, or with few reference frames even for most
    of the clip.
    """
    right, world = someone_walking(90, 30.0, HEADINGS[name])
    stretch = slice(8, 85) if has_reference else slice(30, 55)
    wrong = right.copy()
    wrong[stretch] = wrong[stretch][:, MIRROR_PARTNER]
    track = track_without_depth(
        wrong, 30.0, {k: world[k] for k in (5, 35, 65)} if has_reference else {}
    )
    repaired = repair_left_right(track, CAMERA)
    off = np.linalg.norm(repaired.keypoints_px - right, axis=-1)[:, 11:29].mean(axis=1)
    assert (off > 1.0).mean() <= 0.01
    np.testing.assert_array_equal(repaired.confidence[40], track.confidence[40][MIRROR_PARTNER])
    assert not repaired.world_landmarks.any()


@pytest.mark.parametrize(("rate", "turn"), [(30.0, 1.5), (10.0, 0.0), (6.0, 1.5)])
def test_walking_and_turning_are_left_alone(rate: float, turn: float) -> None:
    """At a low rate, swapped legs are often nearer to those of the frame before, in the image."""
    pixels, _ = someone_walking(60, rate, np.pi / 2, turn)
    track = track_without_depth(pixels, rate, {})
    assert repair_left_right(track, CAMERA) is track
