# SPDX-License-Identifier: GPL-3.0-or-later
"""Place feet on the floor and level a tilted world."""

from dataclasses import replace

import numpy as np
from scope.scope_addon.edit.clip import Clip, clip_from_motion
from scope.scope_addon.edit.corrected_motion import with_corrections
from scope.scope_addon.edit.corrections import FeetOnFloor
from scope.scope_addon.edit.edits import refloor
from scope.solver.rotations import exp

from .walking import ARMS_DOWN, BETAS, BODY, NAMES, motion_of, walk


def test_feet_come_back_to_the_floor():
    stand = walk(2.0, speed=0.0)
    stand.rotations[:, 1:] = exp(np.array([ARMS_DOWN.get(n, [0, 0, 0]) for n in NAMES[1:]]))
    stand.root[:, 2] = 0.95
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
    stand = walk(2.0, speed=0.0)
    stand.rotations[:] = stand.rotations[0]
    stand.root[:] = stand.root[0]
    seen = np.arange(len(stand)) < 20
    stand.root[~seen, 2] -= 0.5
    motion = replace(motion_of(stand), valid=seen)
    put = with_corrections(motion, BODY, (FeetOnFloor(),))
    soles = clip_from_motion(BODY, put, raw=False).soles(BODY, BETAS)
    assert abs(np.median(soles[:18, :, 2].min(axis=1))) < 0.01


def test_a_foot_that_is_lifted_before_a_cut_lifts_nothing_after_it():
    stand = walk(2.0, speed=0.0)
    stand.rotations[:] = stand.rotations[0]
    stand.root[:] = stand.root[0]
    stand.root[20:30, 2] -= 0.1
    motion = replace(motion_of(stand), scene_starts=[30])
    put = with_corrections(motion, BODY, (FeetOnFloor(),))
    lowest = clip_from_motion(BODY, put, raw=False).soles(BODY, BETAS)[:, :, 2].min(axis=1)
    np.testing.assert_allclose(lowest[30:], lowest[-1], atol=1e-6)


def test_a_sloping_world_is_levelled():
    clip = walk(6.0, speed=0.2)  # so slow that a foot which is down counts as standing
    clip.root[:, 0] = 0.4 * np.sin(0.5 * clip.times)
    clip.root[:, 2] -= clip.soles(BODY, BETAS)[..., 2].min(axis=1)
    tilt = exp([0.1, 0.05, 0.0])
    tilted = Clip(clip.times, clip.rotations.copy(), clip.root @ tilt.T)
    tilted.rotations[:, 0] = tilt @ tilted.rotations[:, 0]
    level = refloor(tilted, BODY, BETAS, FeetOnFloor(level=True))
    up = level.rotations[:, 0] @ np.swapaxes(clip.rotations[:, 0], 1, 2)
    assert np.degrees(np.arccos(np.clip(up[:, 2, 2], -1, 1))).max() < 1.5
    spot = walk(2.0, speed=0.0)  # standing on one spot says nothing of the floor's slope: no turn
    np.testing.assert_array_equal(
        refloor(spot, BODY, BETAS, FeetOnFloor(level=True)).rotations, spot.rotations
    )
