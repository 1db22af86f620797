# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits that a motion keeps, against the walk from which it was made."""

import numpy as np
import pytest
from scope.scope_addon.edit.corrected_motion import with_corrections
from scope.scope_addon.edit.corrections import FeetOnFloor, Interpolation, Upright
from scope.scope_addon.edit.edits import moved_motion
from scope.scope_addon.edit.smooth import smoothed
from scope.solver.rotations import exp

from .walking import BETAS, BODY, angle, motion_of, walk

TRUTH = walk(3.0)
BAD = slice(40, 45)
STRENGTHS = (0.0, 0.5, 1.0, 2.5)


def damaged():
    """A capture of the walk whose arms and legs are elsewhere in five frames, before and after
    smoothing.
    """
    clip = walk(3.0)
    clip.rotations[BAD, 1:] = clip.rotations[BAD, 1:] @ exp(np.array([0.5, 0.3, -0.4]))
    clip.root[BAD] += [0.1, 0.0, 0.2]
    return motion_of(clip)


def raised(height=0.3, sunk=0.0):
    """A capture of the walk in a world that is too high; ``sunk`` metres lower in half a second of
    it.
    """
    clip = walk(3.0)
    clip.root[:, 2] += height
    clip.root[60:75, 2] -= sunk
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
@pytest.mark.parametrize("world", [None, [[0.0, 0.3, 0.0], [0.5, 1.0, 0.2]]])
def test_feet_stay_on_the_floor_in_every_smoothing(strength, world):
    motion = raised(sunk=0.2)
    corrections = (FeetOnFloor(),)
    if world is not None:  # an upright line that undoes a tilt
        T = np.eye(4)
        T[:3, :3] = exp(np.array(world[0]))
        T[:3, 3] = world[1]
        motion = moved_motion(motion, BODY, np.linalg.inv(T))
        corrections = (Upright.of(T), *corrections)
    before = smoothed(BODY, motion, strength)
    assert np.abs(lowest(before)).max() > 0.2
    clip = smoothed(BODY, with_corrections(motion, BODY, corrections), strength)
    assert lowest(clip).min() > -1e-3
    assert lowest(clip).max() < 0.13  # while it is raised smoothly out of the floor
    far = np.r_[0:50, 85 : len(TRUTH)]
    assert lowest(clip)[far].max() < 0.06  # the feet of this walk are not exactly on one plane
    if world is None:
        np.testing.assert_array_equal(clip.root[:, :2], before.root[:, :2])


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


def leaning(clip, truth):
    """The largest angle between the pelvis's up axis and that of the truth, degrees."""
    up = clip.rotations[:, 0] @ np.swapaxes(truth.rotations[:, 0], 1, 2)
    return np.degrees(np.arccos(np.clip(up[:, 2, 2], -1, 1))).max()
