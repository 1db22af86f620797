# SPDX-License-Identifier: GPL-3.0-or-later
"""Corrections that stay with a motion: through files, smoothing and removal."""

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.edit.clip import Clip, clip_from_motion
from scope.scope_addon.edit.corrected_motion import (
    corrections_of,
    shot_of,
    uncorrected,
    with_corrections,
)
from scope.scope_addon.edit.corrections import (
    Contact,
    DepthFlip,
    Exchange,
    FeetOnFloor,
    Interpolation,
    Pin,
    added,
)
from scope.scope_addon.edit.smooth import smoothed
from scope.scope_addon.edit.solve_pins import missed
from scope.scope_addon.edit.spans import swap_sides
from scope.scope_addon.errors import MotionFileError
from scope.scope_addon.kinematics.smoothing import smooth_rotations
from scope.scope_addon.motion import CORRECTION_KEYS, Motion
from scope.solver.rotations import exp, log

from ..made_motion import made_motion
from .walking import BODY, NAMES, RATE, angle, motion_of, walk

TRUTH = walk(3.0)
MOTION = motion_of(TRUTH, noise=0.05)
ARM = ("collar", "shoulder", "elbow", "wrist", "hand")
LEG = ("hip", "knee", "ankle", "foot")


def pin(name="right_wrist", frame=45, shift=(40.0, -25.0)):
    where = clip_from_motion(BODY, MOTION, raw=False).joints(BODY, MOTION.betas)[
        frame, NAMES.index(name)
    ]
    return Pin(frame, name, tuple(shot_of(MOTION).project(frame, where) + np.array(shift)))


@pytest.mark.parametrize("strength", [0.0, 2.5])
def test_pins_hold_whatever_the_smoothing(strength):
    pins = (pin(), pin("left_ankle", 50, (15.0, -10.0)))
    motion = with_corrections(MOTION, BODY, pins)
    clip = smoothed(BODY, motion, strength)
    assert max(missed(clip, BODY, motion.betas, p, shot_of(motion)) for p in pins) < 2.0
    plain = smoothed(BODY, MOTION, strength)
    far = np.abs(TRUTH.times - 47 / RATE) > 0.6
    np.testing.assert_array_equal(clip.rotations[far], plain.rotations[far])


def test_the_file_keeps_the_corrections_and_removing_them_restores_the_motion(tmp_path):
    corrections = (
        pin(),
        Contact(60, 66, "left"),
        Exchange(10, 16),
        Interpolation(70, 74),
        FeetOnFloor(),
    )
    motion = with_corrections(MOTION, BODY, corrections)
    motion.save(tmp_path / "a.npz")
    back = Motion.load(tmp_path / "a.npz")
    assert corrections_of(back) == corrections
    assert set(back.corrections) == set(CORRECTION_KEYS) - {"uncorrected_world_from_camera"}
    for restored in (with_corrections(back, BODY, ()), uncorrected(back)):
        for name, value in vars(MOTION).items():
            np.testing.assert_array_equal(getattr(restored, name), value, err_msg=name)


def swapped():
    """A capture whose detector swaps the sides from frame 30 to 50; smoothing mixes them at both
    ends of the span.
    """
    wrong = swap_sides(TRUTH, BODY, TRUTH.times[30], TRUTH.times[50])
    poses = log(smooth_rotations(wrong.rotations, wrong.times)).reshape(len(TRUTH), -1)
    raw = log(wrong.rotations).reshape(len(TRUTH), -1)
    trans = TRUTH.root - BODY.rest_joints(np.zeros(BODY.P))[0]
    return made_motion(BODY, poses, trans, RATE, poses_raw=raw)


def test_sides_are_exchanged_before_pins():
    """So a pin is on the limb that has its name in the user's eyes, and at the truth it changes
    nothing.
    """
    captured = swapped()
    right = Clip(TRUTH.times, smooth_rotations(TRUTH.rotations, TRUTH.times), TRUTH.root).joints(
        BODY, captured.betas
    )
    at = right[40, NAMES.index("left_wrist")]
    pin = Pin(40, "left_wrist", tuple(shot_of(captured).project(40, at)))
    exchange = Exchange(30, 50)
    fixed = with_corrections(captured, BODY, (pin, exchange))
    alone = with_corrections(captured, BODY, (exchange,))
    for motion in (fixed, alone):
        joints = clip_from_motion(BODY, motion, raw=False).joints(BODY, motion.betas)
        assert np.linalg.norm(joints - right, axis=-1).max() < 0.005


def test_a_scene_whose_sides_are_exchanged_is_mixed_with_no_other():
    motion = replace(MOTION, scene_starts=[30, 51])
    found = clip_from_motion(BODY, with_corrections(motion, BODY, (Exchange(30, 50),)), raw=False)
    before = clip_from_motion(BODY, MOTION, raw=False)
    expected = swap_sides(before, BODY, TRUTH.times[30], TRUTH.times[50])
    np.testing.assert_allclose(found.rotations, expected.rotations, atol=1e-6)


def test_a_pin_changes_nothing_beyond_a_cut():
    motion = replace(MOTION, scene_starts=[48])
    before = clip_from_motion(BODY, motion, raw=False)
    found = clip_from_motion(BODY, with_corrections(motion, BODY, (pin(frame=45),)), raw=False)
    assert angle(found.rotations, before.rotations)[45:48].max() > 0.01
    np.testing.assert_array_equal(found.rotations[48:], before.rotations[48:])
    np.testing.assert_array_equal(found.times, before.times)


@pytest.mark.parametrize(("limbs", "kept"), [("arms", LEG), ("legs", ARM)])
def test_limbs_that_are_not_exchanged_stay_as_they_were(limbs, kept):
    """Also around the span's ends, where the others are smoothed again."""
    exchanged = with_corrections(MOTION, BODY, (Exchange(30, 50, limbs),))
    others = [NAMES.index(f"{side}_{joint}") for side in ("left", "right") for joint in kept]
    before, after = (clip_from_motion(BODY, m, raw=False) for m in (MOTION, exchanged))
    assert angle(before.rotations, after.rotations)[:, others].max() < 1e-6
    assert angle(before.rotations, after.rotations).max() > 0.1


def test_a_flipped_arm_stays_flipped_when_arms_are_exchanged_afterwards():
    clip = walk(3.0)
    clip.rotations[:, NAMES.index("left_elbow")] = exp(np.array([0.0, -0.9, 0.0]))
    clip.rotations[:, NAMES.index("left_shoulder")] = exp(np.array([0.0, -0.5, -0.9]))
    captured = motion_of(clip)
    flips = (DepthFlip(30, 60, "left_arm"),)
    flipped = clip_from_motion(BODY, with_corrections(captured, BODY, flips), raw=False)
    expected = swap_sides(flipped, BODY, flipped.times[30], flipped.times[60], "arms")
    both = with_corrections(captured, BODY, added(flips, Exchange(30, 60, "arms")))
    found = clip_from_motion(BODY, both, raw=False)
    wrists = [NAMES.index(f"{side}_wrist") for side in ("left", "right")]
    off = (found.joints(BODY, captured.betas) - expected.joints(BODY, captured.betas))[36:55]
    assert np.linalg.norm(off[:, wrists], axis=-1).max() < 0.02


@pytest.mark.parametrize("limbs", ["legs", "arms"])
def test_the_foot_that_rests_in_the_users_eyes_is_held_when_smoothed(limbs):
    """A walker whose left foot rests, of whom a span was captured with left and right exchanged."""
    rests = np.tile([1.0, 1.0, 0.0, 0.0], (len(TRUTH), 1))
    right = replace(motion_of(TRUTH), foot_contact=rests)
    span = slice(20, 71)
    wrong = swap_sides(TRUTH, BODY, TRUTH.times[20], TRUTH.times[70], limbs)
    contact = rests.copy()
    if limbs != "arms":
        contact[span] = [0.0, 0.0, 1.0, 1.0]
    captured = replace(motion_of(wrong), foot_contact=contact)
    corrected = with_corrections(captured, BODY, (Exchange(20, 70, limbs),))
    ankles = [NAMES.index(f"{side}_ankle") for side in ("left", "right")]
    found, expected = (
        smoothed(BODY, motion, 2.5).joints(BODY, motion.betas)[35:56, ankles]
        for motion in (corrected, right)
    )
    assert np.linalg.norm(found - expected, axis=-1).max() < 0.001
    np.testing.assert_array_equal(corrected.foot_contact, contact)


def test_damaged_corrections_are_an_error():
    motion = with_corrections(MOTION, BODY, (pin(),))
    motion.corrections["uncorrected_rows"] = np.array([10_000])
    with pytest.raises(MotionFileError, match="corrections are damaged"):
        uncorrected(motion)
