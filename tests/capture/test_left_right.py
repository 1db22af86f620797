# SPDX-License-Identifier: GPL-3.0-or-later
"""Exchanged left and right are found, and real turns are left alone."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.left_right import SWAPPED, find_swapped_frames


def walker(count: int, turn_rad: float = 0.0) -> np.ndarray:
    """A body with noise that turns about its vertical axis by ``turn_rad`` over the clip."""
    rng = np.random.default_rng(2)
    body = rng.normal(0, 0.3, (33, 3))
    body[:, 0] = [0.2 if "left" in n else -0.2 if "right" in n else 0.0 for n in KEYPOINT_NAMES]
    angle = np.linspace(0, turn_rad, count)
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros(count), np.ones(count)
    turns = np.stack([c, zero, s, zero, one, zero, -s, zero, c], axis=1).reshape(-1, 3, 3)
    return np.einsum("tij,kj->tki", turns, body) + rng.normal(0, 0.01, (count, 33, 3))


def test_partners() -> None:
    assert SWAPPED[0] == 0
    assert KEYPOINT_NAMES[SWAPPED[KEYPOINT_NAMES.index("mouth_left")]] == "mouth_right"
    np.testing.assert_array_equal(SWAPPED[SWAPPED], np.arange(33))


@pytest.mark.parametrize("turn_rad", [0.0, 2 * np.pi])
@pytest.mark.parametrize("stretch", [slice(0, 0), slice(20, 21), slice(30, 75), slice(0, 25), slice(90, 120)])
def test_minority_stretch_is_found(stretch: slice, turn_rad: float) -> None:
    world = walker(120, turn_rad)
    expected = np.zeros(120, bool)
    expected[stretch] = True
    world[stretch] = world[stretch][:, SWAPPED]
    np.testing.assert_array_equal(find_swapped_frames(world), expected)


def test_gaps_and_new_people() -> None:
    world = walker(60)
    expected = np.zeros(60, bool)
    expected[10:30] = True
    world[expected] = world[expected][:, SWAPPED]
    world[28:33] = np.nan
    expected[28:30] = False
    np.testing.assert_array_equal(find_swapped_frames(world), expected)
    # someone else, seen from behind, for the second half: no exchange
    other = np.concatenate([walker(40), walker(30)[:, SWAPPED]])
    starts = np.arange(70) == 40
    assert not find_swapped_frames(other, starts).any()
    assert find_swapped_frames(other)[40:].all()


def test_nothing_to_do() -> None:
    assert find_swapped_frames(np.zeros((0, 33, 3))).shape == (0,)
    assert not find_swapped_frames(np.full((5, 33, 3), np.nan)).any()
    assert not find_swapped_frames(np.zeros((5, 33, 3))).any()
