# SPDX-License-Identifier: GPL-3.0-or-later
"""A line that is upright, in the image or in a view from the side, corrects a tilted world."""

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.edit.clip import clip_from_motion
from scope.scope_addon.edit.corrected_motion import corrections_of, shot_of, with_corrections
from scope.scope_addon.edit.corrections import (
    Contact,
    DepthFlip,
    FeetOnFloor,
    Pin,
    Upright,
    added,
)
from scope.scope_addon.edit.edits import moved_motion
from scope.scope_addon.edit.upright import upright_transform, upright_transform_in_view
from scope.scope_addon.errors import UsageError
from scope.solver.rotations import exp

from ..made_motion import rows_of
from .walking import BETAS, BODY, NAMES, motion_of, walk

TRUTH = motion_of(walk(2.0), noise=0.02)
ANKLE = NAMES.index("left_ankle")
POST = np.array([[0.4, 1.0, 0.2], [0.4, 1.0, 1.9]])  # two points of an upright post


def rolled(degrees=8.0):
    """The truth in a world that is tilted about the camera's line of sight, and the post's two
    pixels.
    """
    tilt = np.eye(4)
    tilt[:3, :3] = exp(np.radians([0.0, degrees, 0.0]))
    line = tuple(tuple(shot_of(TRUTH).project(20, point)) for point in POST)
    return moved_motion(TRUTH, BODY, tilt), line


def test_an_upright_line_brings_the_true_up_back():
    motion, line = rolled()
    fixed = moved_motion(motion, BODY, upright_transform(motion, BODY, 20, line))
    up = fixed.world_from_camera[0, :3, :3] @ TRUTH.world_from_camera[0, :3, :3].T
    assert np.degrees(np.arccos(up[2, 2])) < 1  # one line leaves the tilt along it open
    wrong = motion.world_from_camera[0, :3, :3] @ TRUTH.world_from_camera[0, :3, :3].T
    assert np.degrees(np.arccos(wrong[2, 2])) > 7


def tilted_by(motion):
    """Return a motion in a world that is tilted towards the camera, and the transform of the line
    that makes it upright, about a point on the floor.
    """
    pivot = np.array([0.0, -1.2, 0.0])
    upright = np.eye(4)
    upright[:3, :3] = exp(np.radians([4.0, 0.0, 0.0]))
    upright[:3, 3] = pivot - upright[:3, :3] @ pivot
    return moved_motion(motion, BODY, np.linalg.inv(upright)), upright


def joints_of(motion):
    return clip_from_motion(BODY, motion, raw=False).joints(BODY, motion.betas)


def test_feet_and_pins_are_on_the_floor_of_the_world_that_a_line_has_turned():
    walker = walk(2.0)
    walker.root[:, 2] -= 0.075  # Feet that are down are on the floor.
    truth = motion_of(walker)
    tilted, upright = tilted_by(truth)
    ankle = joints_of(truth)[40, ANKLE]
    pinned = upright[:3, :3].T @ (ankle + [0.0, 0.0, 0.05] - upright[:3, 3])
    in_truth = Pin(40, "left_ankle", position=tuple(ankle + [0.0, 0.0, 0.05]))
    stands = Contact(10, 14, "left")
    fixed = with_corrections(
        tilted, BODY, (replace(in_truth, position=tuple(pinned)), stands, Upright.of(upright))
    )
    expected = with_corrections(truth, BODY, (in_truth, stands))
    np.testing.assert_allclose(joints_of(fixed), joints_of(expected), atol=1e-3)


@pytest.mark.parametrize("in_image", [True, False])
def test_a_line_is_added_to_the_levelling_by_the_feet(in_image):
    """A post in the image shows the tilt across the line of sight, and feet have shown the other
    one before. In a view from the side, somebody whom they have levelled is upright already.
    """
    walker = walk(6.0, speed=0.2)  # so slow that a foot which is down counts as standing
    walker.root[:, 0] = 0.4 * np.sin(0.5 * walker.times)
    walker.root[:, 2] -= walker.soles(BODY, BETAS)[..., 2].min(axis=1)
    truth = motion_of(walker)
    tilt = np.eye(4)
    tilt[:3, :3] = exp(np.array([0.1, 0.05, 0.0]))
    levelled = with_corrections(moved_motion(truth, BODY, tilt), BODY, (FeetOnFloor(level=True),))
    if in_image:
        line = tuple(tuple(shot_of(truth).project(20, point)) for point in POST)
        transform = upright_transform(levelled, BODY, 20, line)
    else:
        line = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        transform = upright_transform_in_view(levelled, BODY, line, np.array([0.0, 1.0, 0.0]))
    corrections = added(corrections_of(levelled), Upright.of(transform))
    fixed = with_corrections(levelled, BODY, corrections)
    up = fixed.world_from_camera[20, :3, :3] @ truth.world_from_camera[20, :3, :3].T
    assert np.degrees(np.arccos(tilt[2, 2])) > 6.0
    assert np.degrees(np.arccos(up[2, 2])) < 1.5
    heights = joints_of(fixed)[..., 2] - joints_of(truth)[..., 2]
    assert np.abs(heights).max() < 0.05


def test_somebody_turned_around_stands_upright_in_the_world_that_a_line_has_turned():
    tilted, upright = tilted_by(TRUTH)
    turn = DepthFlip(20, 40, "body")
    fixed = with_corrections(tilted, BODY, (turn, Upright.of(upright)))
    expected = with_corrections(TRUTH, BODY, (turn,))
    np.testing.assert_allclose(joints_of(fixed), joints_of(expected), atol=1e-3)
    np.testing.assert_array_equal(
        with_corrections(fixed, BODY, (turn,)).poses, with_corrections(tilted, BODY, (turn,)).poses
    )


def test_the_world_turns_about_where_the_person_was_seen_to_stand():
    seen = np.arange(len(TRUTH)) < 40
    poses = TRUTH.poses.copy()
    trans = TRUTH.trans.copy()
    poses[40:] = poses[40]
    trans[40:] = trans[40] + np.array([3.0, 0.0, 1.0], np.float32)
    motion = replace(TRUTH, poses=poses, trans=trans, valid=seen)
    post = POST + np.array([[0.3, 0.0, 0.0], [0.0, 0.0, 0.0]])
    line = tuple(tuple(shot_of(TRUTH).project(20, point)) for point in post)
    found = upright_transform(motion, BODY, 20, line)
    expected = upright_transform(rows_of(TRUTH, slice(0, 40)), BODY, 20, line)
    np.testing.assert_allclose(found, expected, atol=1e-3)


@pytest.mark.parametrize(
    ("line", "says"), [(((10, 10), (12, 11)), "shorter"), (((10, 10), (200, 12)), "from upright")]
)
def test_a_line_that_cannot_be_upright_is_refused(line, says):
    with pytest.raises(UsageError, match=says):
        upright_transform(TRUTH, BODY, 20, line)


@pytest.mark.parametrize(
    ("line", "direction", "says"),
    [
        (((0, 0, 0), (0.5, 0, 0.05)), (1, 0, 0), "shorter"),
        (((0, 0, 0), (0, 1, 0.5)), (1, 0, 0), "from upright"),
        (((0, 0, 0), (0, 0, 1)), (1, 0, -1), "from a side"),
    ],
)
def test_a_line_in_a_view_that_cannot_be_upright_is_refused(line, direction, says):
    with pytest.raises(UsageError, match=says):
        upright_transform_in_view(TRUTH, BODY, np.array(line, float), np.array(direction, float))
