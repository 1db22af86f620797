# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits that a motion keeps, against the walk from which it was made."""

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.edit.clip import Clip, clip_from_motion
from scope.scope_addon.edit.corrected_motion import with_corrections
from scope.scope_addon.edit.corrections import FeetOnFloor, Interpolation, Upright
from scope.scope_addon.edit.edits import moved_motion, refloor
from scope.scope_addon.edit.smooth import smoothed
from scope.solver.rotations import exp

from .walking import ARMS_DOWN, BETAS, BODY, NAMES, angle, motion_of, walk

TRUTH = walk(3.0)
BAD = slice(40, 45)
STRENGTHS = (0.5, 2.5)


def damaged():
    """A capture of the walk whose arms and legs are elsewhere in five frames, before and after
    smoothing.
    """
    clip = walk(3.0)
    clip.rotations[BAD, 1:] = clip.rotations[BAD, 1:] @ exp(np.array([0.5, 0.3, -0.4]))
    clip.root[BAD] += [0.1, 0.0, 0.2]
    return motion_of(clip)


def raised():
    """A capture of the walk in a world that is too high; 20 cm lower in half a second of it."""
    clip = walk(3.0)
    clip.root[:, 2] += 0.3
    clip.root[60:75, 2] -= 0.2
    return motion_of(clip, noise=0.01)


def lowest(clip):
    return clip.soles(BODY, BETAS)[..., 2].min(axis=1)


@pytest.mark.parametrize("strength", STRENGTHS)
def test_interpolated_frames_stay_so_in_every_smoothing(strength):
    before = smoothed(BODY, damaged(), strength)
    after = smoothed(BODY, with_corrections(damaged(), BODY, (Interpolation(38, 46),)), strength)
    wrong = np.degrees(angle(before.rotations, TRUTH.rotations)[BAD]).max()
    left = np.degrees(angle(after.rotations, TRUTH.rotations)[BAD]).max()
    assert wrong > 15
    assert left < 0.4 * wrong
    astray = [np.linalg.norm(clip.root - TRUTH.root, axis=1)[BAD].max() for clip in (before, after)]
    assert astray[1] < 0.5 * astray[0]
    far = np.r_[0:38, 47 : len(TRUTH)]
    np.testing.assert_array_equal(after.rotations[far], before.rotations[far])


@pytest.mark.parametrize("strength", STRENGTHS)
def test_feet_stay_on_the_floor_in_every_smoothing(strength):
    """Also in a world that an upright line has turned."""
    T = np.eye(4)
    T[:3, :3] = exp(np.array([0.0, 0.3, 0.0]))
    T[:3, 3] = [0.5, 1.0, 0.2]
    motion = moved_motion(raised(), BODY, np.linalg.inv(T))
    corrections = (Upright.of(T), FeetOnFloor())
    before = smoothed(BODY, motion, strength)
    assert np.abs(lowest(before)).max() > 0.2
    clip = smoothed(BODY, with_corrections(motion, BODY, corrections), strength)
    assert lowest(clip).min() > -1e-3
    assert lowest(clip).max() < 0.13  # while it is raised smoothly out of the floor
    far = np.r_[0:50, 85 : len(TRUTH)]
    assert lowest(clip)[far].max() < 0.06  # the feet of this walk are not exactly on one plane


def test_a_levelled_world_is_level_in_every_smoothing():
    clip = walk(6.0, speed=0.2)  # so slow that a foot which is down counts as standing
    clip.root[:, 0] = 0.4 * np.sin(0.5 * clip.times)
    clip.root[:, 2] -= lowest(clip)
    T = np.eye(4)
    T[:3, :3] = exp(np.array([0.1, 0.05, 0.0]))
    motion = moved_motion(motion_of(clip), BODY, T)
    level = with_corrections(motion, BODY, (FeetOnFloor(level=True),))
    for strength in STRENGTHS:
        tilt = [leaning(smoothed(BODY, m, strength), clip) for m in (motion, level)]
        assert tilt[0] > 6
        assert tilt[1] < 1.5


def still():
    """Somebody who does not move for two seconds."""
    stand = walk(2.0, speed=0.0)
    stand.rotations[:] = stand.rotations[0]
    stand.root[:] = stand.root[0]
    return stand


def test_feet_come_back_to_the_floor():
    stand = still()
    stand.rotations[:, 1:] = exp(np.array([ARMS_DOWN.get(n, [0, 0, 0]) for n in NAMES[1:]]))
    stand.root[:, 2] -= stand.soles(BODY, BETAS)[0, :, 2].min()
    floating = Clip(stand.times, stand.rotations, stand.root + [0, 0, 0.17])
    lowered = refloor(floating, BODY, BETAS, FeetOnFloor())
    np.testing.assert_allclose(lowered.root, stand.root, atol=1e-3)
    sunk = Clip(stand.times, stand.rotations, stand.root.copy())
    sunk.root[25:32, 2] -= 0.08
    mended = refloor(sunk, BODY, BETAS, FeetOnFloor())
    assert mended.soles(BODY, BETAS)[..., 2].min() > -1e-6
    assert np.abs(np.diff(mended.root[:, 2], 2)).max() < 0.08


def test_frames_in_which_the_person_was_not_seen_say_nothing_of_the_floor():
    """As in a capture: the pose from before is kept there, which seems to stand."""
    stand = still()
    seen = np.arange(len(stand)) < 20
    stand.root[~seen, 2] -= 0.5
    motion = replace(motion_of(stand), valid=seen)
    put = with_corrections(motion, BODY, (FeetOnFloor(),))
    soles = clip_from_motion(BODY, put, raw=False).soles(BODY, BETAS)
    assert abs(np.median(soles[:18, :, 2].min(axis=1))) < 0.01


def test_a_foot_that_is_lifted_before_a_cut_lifts_nothing_after_it():
    stand = still()
    stand.root[20:30, 2] -= 0.1
    motion = replace(motion_of(stand), scene_starts=[30])
    put = with_corrections(motion, BODY, (FeetOnFloor(),))
    lowest = clip_from_motion(BODY, put, raw=False).soles(BODY, BETAS)[:, :, 2].min(axis=1)
    np.testing.assert_allclose(lowest[30:], lowest[-1], atol=1e-6)


def test_standing_on_one_spot_says_nothing_of_the_floors_slope():
    spot = walk(2.0, speed=0.0)
    level = refloor(spot, BODY, BETAS, FeetOnFloor(level=True))
    np.testing.assert_array_equal(level.rotations, spot.rotations)


def leaning(clip, truth):
    """The largest angle between the pelvis's up axis and that of the truth, degrees."""
    up = clip.rotations[:, 0] @ np.swapaxes(truth.rotations[:, 0], 1, 2)
    return np.degrees(np.arccos(np.clip(up[:, 2, 2], -1, 1))).max()
