# SPDX-License-Identifier: GPL-3.0-or-later
"""Corrections as values and as arrays.

A motion that is moved in the world, with its camera: every joint and the image stay where they
belong.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.edit.clip import clip_from_motion
from scope.scope_addon.edit.corrections import (
    Contact,
    DepthFlip,
    Exchange,
    FeetOnFloor,
    Floor,
    Interpolation,
    Pin,
    Upright,
    added,
    from_arrays,
    removed,
    to_arrays,
    without,
)
from scope.scope_addon.edit.edits import moved_motion
from scope.scope_addon.errors import MotionFileError, UsageError
from scope.solver.rotations import exp

from .walking import BETAS, BODY, motion_of, walk

ALL = (
    Pin(3, "left_wrist", pixel=(10.5, 20.25)),
    Pin(9, "head", position=(0.1, -0.2, 1.7), reach=0.25),
    Contact(4, 8, "left"),
    Exchange(2, 6, "legs"),
    DepthFlip(3, 5, "left_forearm"),
    DepthFlip(7, 9, "body"),
    Interpolation(4, 7),
    Interpolation(1, 2),
    Upright((1.0, 0, 0, 0.5, 0, 0, -1.0, 0, 0, 1.0, 0, 2.0, 0, 0, 0, 1.0)),
    Floor(7, -0.125),
    FeetOnFloor(level=True, lift=False, height=-0.125),
)


RESTS = (Contact(4, 8, "right_knee"), Contact(5, 9, "back"))


@pytest.mark.parametrize("corrections", [ALL, RESTS, ()])
def test_arrays_give_the_corrections_back(tmp_path, corrections):
    arrays = to_arrays(corrections)
    np.savez(tmp_path / "a.npz", **arrays)
    with np.load(tmp_path / "a.npz", allow_pickle=False) as file:
        assert from_arrays(file) == corrections
    assert from_arrays({}) == ()


def test_exchanged_limbs_keep_their_flips_and_contacts_under_the_other_name():
    arms = (DepthFlip(40, 80, "left_arm"), DepthFlip(50, 60, "right_forearm"))
    legs = (Contact(42, 46, "left"), DepthFlip(40, 44, "right_shin"), Contact(50, 55, "left_knee"))
    others = (DepthFlip(40, 80, "body"), Contact(41, 45, "back"), Contact(90, 95, "left"))
    new_arms = (DepthFlip(40, 80, "right_arm"), DepthFlip(50, 60, "left_forearm"))
    new_legs = (
        Contact(42, 46, "right"),
        DepthFlip(40, 44, "left_shin"),
        Contact(50, 55, "right_knee"),
    )
    present = (*arms, *legs, *others)
    for limbs, expected in (
        ("arms", (*new_arms, *legs, *others)),
        ("legs", (*arms, *new_legs, *others)),
        ("both", (*new_arms, *new_legs, *others)),
    ):
        exchange = Exchange(40, 80, limbs)
        exchanged = added(present, exchange)
        assert exchanged == (*expected, exchange)
        assert added(exchanged, exchange) == present
        assert without(exchanged, len(present)) == present
    assert without(present, 1) == (*present[:1], *present[2:])


@pytest.mark.parametrize("span", [(50, 90), (30, 70), (45, 55)])
def test_sides_are_not_exchanged_in_a_part_of_a_flip(span):
    flips = (DepthFlip(40, 80, "left_arm"),)
    with pytest.raises(UsageError, match="of the left arm is only partly"):
        added(flips, Exchange(*span, "arms"))
    assert added(flips, Exchange(*span, "legs"))[0] == flips[0]
    later = (Exchange(*span, "both"), *flips)  # The flip was added to what is shown.
    with pytest.raises(UsageError, match="remove it first"):
        without(later, 0)


def test_damaged_arrays_are_an_error():
    arrays = to_arrays(ALL)
    for name, value in (
        ("pin_uv", np.zeros((2, 3))),
        ("pin_frames", np.zeros(5)),
        ("contact_feet", np.array(["none"])),
        ("depth_parts", np.array(["body", "tail"])),
        ("depth_spans", np.array([[5, 4], [1, 2]])),
        ("upright", np.full((1, 4, 4), np.nan)),
        ("floor_heights", np.array([np.inf])),
        ("interpolated_spans", np.array([[0, np.inf]])),
        ("interpolated_spans", np.array([["a", "b"]])),
        ("interpolated_spans", np.array([[0, 2**63]], np.uint64)),
        ("interpolated_spans", np.zeros((1001, 2), int)),
        ("snap_level", np.array([1.0])),
    ):
        with pytest.raises(MotionFileError):
            from_arrays(arrays | {name: value})


@pytest.mark.parametrize(
    "make",
    [
        lambda: Pin(1, "head"),
        lambda: Pin(1, "head", (np.nan, 2.0)),
        lambda: Pin(1, "head", (1.0, 2.0), reach=0.0),
        lambda: Contact(1, 4, "both"),
        lambda: Exchange(1, 4, "feet"),
        lambda: DepthFlip(5, 4, "body"),
        lambda: FeetOnFloor(height=np.inf),
        lambda: Upright.of(2 * np.eye(4)),
    ],
)
def test_impossible_values_are_refused(make):
    with pytest.raises(UsageError):
        make()


def test_a_new_pin_replaces_that_of_the_same_joint_and_frame():
    moved = Pin(3, "left_wrist", pixel=(1.0, 2.0))
    assert added(ALL, moved) == (*ALL[1:], moved)
    assert added(ALL, Pin(4, "left_wrist", pixel=(1.0, 2.0)))[:-1] == ALL


def test_without_the_corrected_floor_feet_are_put_on_the_captured_one():
    assert removed(ALL, (Floor,)) == (*ALL[:-2], FeetOnFloor(level=True, lift=False))
    assert removed(ALL, (Upright,)) == (*ALL[:8], *ALL[9:])


def test_an_upright_line_contains_what_was_levelled():
    line = Upright.of(np.eye(4))
    assert added((FeetOnFloor(level=True, lift=False),), line) == (
        FeetOnFloor(level=False, lift=False),
        line,
    )


@pytest.mark.parametrize("raw", [False, True])
def test_joints_move_with_the_world_and_the_image_stays(raw: bool) -> None:
    rng = np.random.default_rng(8)
    T = np.eye(4)
    T[:3, :3] = exp(rng.normal(size=3))
    T[:3, 3] = rng.normal(size=3)
    motion = motion_of(walk(1.0), noise=0.02)
    moved = moved_motion(motion, BODY, T)
    before, after = (
        clip_from_motion(BODY, m, raw=raw).joints(BODY, BETAS) for m in (motion, moved)
    )
    np.testing.assert_allclose(after, before @ T[:3, :3].T + T[:3, 3], atol=2e-6)
    seen = [
        np.einsum(
            "tji,tkj->tki",
            m.world_from_camera[:, :3, :3],
            joints - m.world_from_camera[:, None, :3, 3],
        )
        for m, joints in ((motion, before), (moved, after))
    ]
    np.testing.assert_allclose(seen[1], seen[0], atol=5e-6)
