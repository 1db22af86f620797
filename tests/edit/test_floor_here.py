# SPDX-License-Identifier: GPL-3.0-or-later
"""A foot that rests on the floor says how high the floor is."""

import numpy as np
import pytest
from scope.scope_addon.edit.clip import clip_from_motion
from scope.scope_addon.edit.corrected_motion import (
    corrections_of,
    with_corrections,
)
from scope.scope_addon.edit.corrections import Floor, added
from scope.scope_addon.edit.edits import LOWER, foot_height, moved_clip, moved_motion
from scope.scope_addon.edit.smooth import smoothed
from scope.scope_addon.kinematics.foot_skin import foot_heights

from .walking import BODY, angle, motion_of, walk

SUNK = 0.3  # of the captured world: farther than a standing foot is drawn to the floor
TRUTH = motion_of(walk(2.0), noise=0.02)


def raised(height):
    T = np.eye(4)
    T[2, 3] = height
    return T


MOTION = moved_motion(TRUTH, BODY, raised(-SUNK))


def measured(motion, frame=20, foot=LOWER):
    """The correction that says that a foot rests on the floor."""
    clip = clip_from_motion(BODY, motion, raw=False)
    return Floor(frame, foot_height(clip, BODY, motion.betas, clip.times[frame], foot))


@pytest.mark.parametrize(("foot", "parts"), [("lower", slice(0, 4)), ("right", slice(2, 4))])
def test_the_height_is_that_of_the_lowest_skin_of_the_foot(foot, parts):
    clip = clip_from_motion(BODY, MOTION, raw=False)
    lowest = foot_heights(MOTION, BODY)[20, parts].min()
    height = foot_height(clip, BODY, MOTION.betas, clip.times[20], foot)
    assert height == pytest.approx(lowest, abs=1e-6)


def test_the_floor_moves_every_smoothing_alike():
    floor = measured(MOTION)
    plain, moved = (smoothed(BODY, with_corrections(MOTION, BODY, c), 2.5) for c in ((), (floor,)))
    np.testing.assert_allclose(moved.root, moved_clip(plain, floor.transform).root, atol=1e-6)
    assert angle(moved.rotations, plain.rotations).max() < 1e-5


def test_a_second_floor_adds_to_the_first():
    first = measured(MOTION)
    once = with_corrections(MOTION, BODY, (first,))
    twice = added(corrections_of(once), measured(once, 35, "left"))
    assert len(twice) == 1
    fixed = with_corrections(once, BODY, twice)
    assert foot_heights(fixed, BODY)[35, :2].min() == pytest.approx(0.0, abs=1e-6)
