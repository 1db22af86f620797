# SPDX-License-Identifier: GPL-3.0-or-later
"""A foot that rests on the floor says how high the floor is."""

import numpy as np
import pytest
from scope.scope_addon.edit.clip import clip_from_motion
from scope.scope_addon.edit.corrected_motion import (
    corrections_of,
    distance_from_pin,
    with_corrections,
)
from scope.scope_addon.edit.corrections import Contact, Floor, Pin, Upright, added, world_of
from scope.scope_addon.edit.edits import LOWER, foot_height, moved_clip, moved_motion
from scope.scope_addon.edit.smooth import smoothed
from scope.scope_addon.errors import UsageError
from scope.scope_addon.kinematics.foot_skin import foot_heights
from scope.scope_addon.motion import Motion
from scope.solver.rotations import exp

from .walking import BODY, NAMES, angle, motion_of, walk

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


@pytest.mark.parametrize(
    ("foot", "parts"), [("lower", slice(0, 4)), ("left", slice(0, 2)), ("right", slice(2, 4))]
)
def test_the_height_is_that_of_the_lowest_vertex_of_the_foot(foot, parts):
    clip = clip_from_motion(BODY, MOTION, raw=False)
    heights = foot_heights(MOTION, BODY)[20, parts]
    assert foot_height(clip, BODY, MOTION.betas, clip.times[20], foot) == pytest.approx(
        heights.min(), abs=1e-6
    )
    trans = clip.root[[20]] - BODY.rest_joints(MOTION.betas)[0]
    R, t = BODY.forward_kinematics(clip.rotations[[20]], trans, MOTION.betas)
    lowest = []
    for part in (
        NAMES.index(n)
        for n in NAMES
        if n.endswith(("ankle", "foot")) and (foot == LOWER or foot in n)
    ):
        own = (
            BODY.rest_vertices(MOTION.betas)[BODY.strongest_joints == part]
            - BODY.rest_joints(MOTION.betas)[part]
        )
        lowest.append((own @ R[0, part].T + t[0, part])[:, 2].min())
    assert heights.min() == pytest.approx(min(lowest), abs=1e-3)


def test_the_foot_rests_on_the_floor_and_the_body_stays_in_the_image():
    floor = measured(MOTION)
    fixed = with_corrections(MOTION, BODY, (floor,))
    assert foot_heights(fixed, BODY)[20].min() == pytest.approx(0.0, abs=1e-6)
    np.testing.assert_array_equal(fixed.joints_cam, MOTION.joints_cam)
    np.testing.assert_allclose(
        fixed.world_from_camera, raised(-floor.height) @ MOTION.world_from_camera, atol=1e-12
    )
    np.testing.assert_allclose(
        fixed.trans - MOTION.trans, np.tile([0, 0, -floor.height], (len(MOTION), 1)), atol=1e-6
    )


def test_the_file_keeps_the_floor_and_removing_it_restores_the_motion(tmp_path):
    floor = measured(MOTION, foot="right")
    with_corrections(MOTION, BODY, (floor,)).save(tmp_path / "a.npz")
    back = Motion.load(tmp_path / "a.npz")
    assert corrections_of(back) == (floor,)
    restored = with_corrections(back, BODY, ())
    for name, value in vars(MOTION).items():
        np.testing.assert_array_equal(getattr(restored, name), value, err_msg=name)


@pytest.mark.parametrize("strength", [0.0, 1.0, 2.5])
def test_the_floor_moves_every_smoothing_alike(strength):
    floor = measured(MOTION)
    plain, moved = (
        smoothed(BODY, with_corrections(MOTION, BODY, c), strength) for c in ((), (floor,))
    )
    np.testing.assert_allclose(moved.root, moved_clip(plain, floor.transform).root, atol=1e-6)
    assert angle(moved.rotations, plain.rotations).max() < 1e-5


def test_a_second_floor_adds_to_the_first():
    first = measured(MOTION)
    once = with_corrections(MOTION, BODY, (first,))
    twice = added(corrections_of(once), measured(once, 35, "left"))
    assert len(twice) == 1
    fixed = with_corrections(once, BODY, twice)
    assert foot_heights(fixed, BODY)[35, :2].min() == pytest.approx(0.0, abs=1e-6)


def test_a_pin_in_space_moves_along():
    joints = clip_from_motion(BODY, MOTION, raw=False).joints(BODY, MOTION.betas)
    pin = Pin(
        30, "left_wrist", position=tuple(joints[30, NAMES.index("left_wrist")] + [0.1, 0.0, 0.05])
    )
    fixed = with_corrections(MOTION, BODY, (pin, measured(MOTION)))
    assert distance_from_pin(fixed, pin) < 0.002


def test_a_foot_that_stands_is_put_on_the_corrected_floor():
    stands = Contact(18, 24, "left")
    floor = measured(MOTION, 21, "left")
    fixed = with_corrections(MOTION, BODY, (stands, floor))
    soles = clip_from_motion(BODY, fixed, raw=False).soles(BODY, MOTION.betas)
    assert np.abs(soles[18:25, :2, 2].min(axis=1)).max() < 0.005
    alone = clip_from_motion(BODY, with_corrections(MOTION, BODY, (stands,)), raw=False).soles(
        BODY, MOTION.betas
    )
    assert alone[18:25, :2, 2].min(axis=1).max() < -0.2


def test_a_floor_and_an_upright_line_keep_each_other_in_either_order():
    turn = np.eye(4)
    turn[:3, :3] = exp(np.array([0.1, 0.05, 0.0]))
    turn[:3, 3] = [0.3, 0.0, 0.1]
    upright = Upright.of(turn)
    floor = Floor(20, -0.25)
    for first, second in ((upright, floor), (floor, upright)):
        both = added(added((), first), second)
        assert [type(c) for c in both] == [Upright, Floor]
        assert both[1] == floor
        np.testing.assert_allclose(world_of(both), second.transform @ first.transform, atol=1e-12)


@pytest.mark.parametrize("height", [np.nan, np.inf, 1e4])
def test_an_impossible_height_is_refused(height):
    with pytest.raises(UsageError, match="frame 3"):
        Floor(3, height)


def test_an_unknown_foot_is_refused():
    clip = clip_from_motion(BODY, MOTION, raw=False)
    with pytest.raises(UsageError, match="left, right or lower"):
        foot_height(clip, BODY, MOTION.betas, 0.5, "both")
