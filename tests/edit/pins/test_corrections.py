# SPDX-License-Identifier: GPL-3.0-or-later
"""Corrections as values and as arrays."""

import numpy as np
import pytest
from scope.scope_addon.edit.pins.corrections import (
    Contact,
    Exchange,
    Floor,
    Pin,
    Upright,
    added,
    from_arrays,
    to_arrays,
)
from scope.scope_addon.errors import MotionFileError, UsageError

ALL = (
    Pin(3, "left_wrist", pixel=(10.5, 20.25)),
    Pin(9, "head", position=(0.1, -0.2, 1.7), reach=0.25),
    Contact(4, 8, "left"),
    Exchange(2, 6, "legs"),
    Upright((1.0, 0, 0, 0.5, 0, 0, -1.0, 0, 0, 1.0, 0, 2.0, 0, 0, 0, 1.0)),
    Floor(7, -0.125),
)


@pytest.mark.parametrize("corrections", [ALL, ALL[:1], ALL[2:3], ()])
def test_arrays_give_the_corrections_back(tmp_path, corrections):
    arrays = to_arrays(corrections)
    np.savez(tmp_path / "a.npz", **arrays)
    with np.load(tmp_path / "a.npz", allow_pickle=False) as file:
        assert from_arrays(file) == corrections
    assert from_arrays({}) == ()


def test_damaged_arrays_are_an_error():
    arrays = to_arrays(ALL)
    for name, value in (
        ("pin_uv", np.zeros((2, 3))),
        ("pin_frames", np.zeros(5)),
        ("contact_feet", np.array(["none"])),
        ("upright", 2 * np.eye(4)[None]),
        ("upright", np.full((1, 4, 4), np.nan)),
        ("floor_heights", np.array([np.inf])),
        ("floor_heights", np.zeros(2)),
        ("floor_frames", np.zeros((1, 2))),
    ):
        with pytest.raises(MotionFileError):
            from_arrays(arrays | {name: value})


@pytest.mark.parametrize(
    "make",
    [
        lambda: Pin(1, "head"),
        lambda: Pin(1, "head", (1.0, 2.0), (1.0, 2.0, 3.0)),
        lambda: Pin(1, "head", (np.nan, 2.0)),
        lambda: Pin(1, "head", (1.0, 2.0), reach=0.0),
        lambda: Contact(5, 4, "left"),
        lambda: Contact(1, 4, "both"),
        lambda: Exchange(1, 4, "feet"),
    ],
)
def test_impossible_values_are_refused(make):
    with pytest.raises(UsageError):
        make()


def test_a_new_pin_replaces_that_of_the_same_joint_and_frame():
    moved = Pin(3, "left_wrist", pixel=(1.0, 2.0))
    assert added(ALL, moved) == (*ALL[1:], moved)
    assert added(ALL, Pin(4, "left_wrist", pixel=(1.0, 2.0)))[:-1] == ALL


def test_a_second_upright_line_turns_what_the_first_has_made():
    first, second = np.eye(4), np.eye(4)
    first[:3, :3], second[:3, 3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]], [1, 2, 3]
    (both,) = added((Upright.of(first),), Upright.of(second))
    np.testing.assert_array_equal(both.transform, second @ first)


def test_the_same_exchange_again_undoes_the_first():
    assert added(ALL, ALL[3]) == (*ALL[:3], *ALL[4:])
