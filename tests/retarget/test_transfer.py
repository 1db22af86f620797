# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion on another skeleton: the body's own as a rig, in other proportions, headings and rest
poses.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.edit.clip import Clip
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL
from scope.scope_addon.kinematics.sequences import runs
from scope.scope_addon.retarget.foot_placement import frames_on_one_floor
from scope.scope_addon.retarget.rest_pose import Skeleton
from scope.scope_addon.retarget.transfer import Transfer
from scope.solver.rotations import exp

from ..edit.rolling import rolling_walk
from ..edit.walking import BETAS, BODY, NAMES, walk
from .made_skeletons import MAPPED, VERTICAL, body_rig, direction, same_names, turn_between

LIMBS = [
    (f"{s}_{a}", f"{s}_{b}")
    for s in ("left", "right")
    for a, b in (("hip", "knee"), ("knee", "ankle"), ("shoulder", "elbow"), ("elbow", "wrist"))
]
CLIP = walk(2.0, bent=0.1)  # where legs are straight, a rig's bend by a few degrees
JOINTS = CLIP.joints(BODY, BETAS)[:, [NAMES.index(name) for name in MAPPED]]


@pytest.mark.parametrize(("feet", "seed"), [(False, 0), (True, 1)])
def test_the_bodys_own_skeleton_moves_as_the_body_whatever_the_axes_of_its_bones(
    feet: bool, seed: int
) -> None:
    pose = Transfer(BODY, BETAS, body_rig(seed=seed), same_names(), feet=feet).pose(CLIP)
    np.testing.assert_allclose(pose.heads, JOINTS, atol=2e-3)
    assert pose.facing == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(("overstretched", "seed"), [(0.0, 0), (0.1, 1)])
def test_a_straight_or_overstretched_knee_bends_forward_whatever_the_axes_of_its_bones(
    overstretched: float, seed: int
) -> None:
    """A longer step than the body's lowers the hips, so that the leg that stands has to bend."""
    turns = np.zeros((len(NAMES), 3))
    turns[NAMES.index("right_hip"), 0] = -0.5
    for side in ("left", "right"):
        turns[NAMES.index(f"{side}_knee"), 0] = -overstretched
    rotations = exp(turns)
    rotations[0] = R_WORLD_MODEL
    clip = Clip(np.zeros(1), rotations[None], np.array([[0.0, 0.0, 0.9]]))
    pose = Transfer(BODY, BETAS, body_rig(seed=seed), same_names(), travel=1.3).pose(clip)
    joints = [MAPPED.index(f"left_{part}") for part in ("hip", "knee", "ankle")]
    hip, knee, ankle = pose.heads[0, joints]
    along = (ankle - hip) / np.linalg.norm(ankle - hip)
    across = (knee - hip) - along * ((knee - hip) @ along)
    assert across[1] < -0.1  # the rig faces -y
    assert abs(across[0]) < 0.03


def test_a_rig_of_another_size_takes_steps_of_its_own_size() -> None:
    pose = Transfer(BODY, BETAS, body_rig(scale=1.7), same_names(), feet=False).pose(CLIP)
    np.testing.assert_allclose(pose.heads, 1.7 * JOINTS, atol=1e-9)


@pytest.mark.parametrize("feet", [False, True])
def test_travel_scales_positions_on_the_floor_and_legs_scale_heights(feet: bool) -> None:
    rig = body_rig(scale=1.2)
    pose = Transfer(BODY, BETAS, rig, same_names(), feet=feet, travel=1.1).pose(CLIP)
    hips = [MAPPED.index(f"{side}_hip") for side in ("left", "right")]
    ours = pose.heads[:, hips].mean(axis=1)
    theirs = JOINTS[:, hips].mean(axis=1)
    np.testing.assert_allclose(ours, theirs * [1.1, 1.1, 1.2], atol=5e-3)
    if feet:  # they stand still where the body's do
        ankles = [MAPPED.index(f"{side}_ankle") for side in ("left", "right")]
        np.testing.assert_allclose(
            pose.heads[:, ankles, :2], 1.1 * JOINTS[:, ankles, :2], atol=0.02
        )


def test_feet_go_below_the_floor_on_uneven_ground() -> None:
    """A walk one metre down: hips and ankles of the rig are lower by its own metre."""
    lower = Clip(CLIP.times, CLIP.rotations, CLIP.root - VERTICAL)
    rig = body_rig(scale=1.7)
    above = Transfer(BODY, BETAS, rig, same_names()).pose(CLIP).heads
    below = Transfer(BODY, BETAS, rig, same_names()).pose(lower, one_floor=False).heads
    np.testing.assert_allclose(below, above - 1.7 * VERTICAL, atol=0.05)


def test_feet_are_kept_above_the_floor_before_they_go_down_to_a_lower_one() -> None:
    """Somebody walks 20 cm too low, and one metre lower for half a second."""
    rig = body_rig()
    ankles = [MAPPED.index(f"{side}_ankle") for side in ("left", "right")]
    is_lower = CLIP.times < 0.5
    root = CLIP.root - np.where(is_lower, 1.0, 0.2)[:, None] * VERTICAL
    clip = Clip(CLIP.times, CLIP.rotations, root)
    one_floor = frames_on_one_floor(clip, BODY, BETAS)
    pose = Transfer(BODY, BETAS, rig, same_names()).pose(clip, one_floor)
    lowest = pose.heads[:, ankles, 2].min(axis=1)
    assert lowest[is_lower].max() < -0.5
    assert lowest[CLIP.times > 0.8].min() > 0.0


@pytest.mark.parametrize("feet", [False, True])
def test_limbs_of_a_rig_in_an_a_pose_point_where_the_bodys_do(feet: bool) -> None:
    pose = Transfer(
        BODY, BETAS, body_rig(scale=0.6, heading=1.0, arms_down=0.8), same_names(), feet=feet
    ).pose(CLIP)
    for first, second in LIMBS:
        off = turn_between(
            direction(pose.heads, first, second, MAPPED), direction(JOINTS, first, second, MAPPED)
        )
        assert off.max() < np.radians(
            0.01 if not feet or "shoulder" in first or "elbow" in first else 3.0
        )


@pytest.mark.parametrize(("bend", "feet"), [(0.2, True), (0.9, True), (0.9, False)])
def test_legs_that_are_bent_at_rest_straighten_as_the_bodys_do(bend: float, feet: bool) -> None:
    """A rig that was built with bent knees stands as the same rig with straight ones does."""
    straight = body_rig(scale=1.3)
    heads = straight.heads.copy()
    for side in ("left", "right"):
        rows = [MAPPED.index(f"{side}_{part}") for part in ("hip", "knee", "ankle", "foot")]
        hip, knee, ankle, ball = straight.heads[rows]
        forward = exp(np.array([-bend, 0.0, 0.0]))
        heads[rows[1]] = hip + forward @ (knee - hip)
        heads[rows[2]] = heads[rows[1]] + forward.T @ (ankle - knee)
        heads[rows[3]] = heads[rows[2]] + ball - ankle
    moved = heads - straight.heads
    floor = straight.floor + moved[MAPPED.index("left_ankle"), 2]
    bent = replace(straight, heads=heads, ends=straight.ends + moved, floor=floor)
    poses = [
        Transfer(BODY, BETAS, rig, same_names(), feet=feet).pose(CLIP) for rig in (straight, bent)
    ]
    np.testing.assert_allclose(poses[1].heads, poses[0].heads, atol=1e-3)


def proportioned(hips: float, legs: float, feet: float) -> Skeleton:
    """Return the body's own skeleton with multiples of the distance of its hips, of the length of
    its legs and of that of its feet.
    """
    rig = body_rig()
    heads = rig.heads.copy()
    for side in ("left", "right"):
        rows = [MAPPED.index(f"{side}_{part}") for part in ("hip", "knee", "ankle", "foot")]
        steps = np.diff(rig.heads[rows], axis=0) * np.array([[legs], [legs], [1.0]])
        steps[2, :2] *= feet
        steps = np.concatenate([rig.heads[rows[:1]] * [hips, 1.0, 1.0], steps])
        heads[rows] = np.cumsum(steps, axis=0)
    moved = heads - rig.heads
    floor = rig.floor + moved[MAPPED.index("left_ankle"), 2]
    return replace(rig, heads=heads, ends=rig.ends + moved, floor=floor)


@pytest.mark.parametrize(
    ("hips", "legs", "feet"),
    [(2.2, 1.0, 1.0), (1.0, 0.45, 1.0), (1.8, 0.5, 1.2), (1.5, 0.6, 0.6), (0.3, 1.3, 1.0)],
)
@pytest.mark.parametrize("is_live", [False, True])
def test_legs_of_other_proportions_point_where_the_bodys_do_and_their_feet_stay_in_place(
    hips: float, legs: float, feet: float, is_live: bool
) -> None:
    """Though the pelvis, and the hips with it, turns with every step; of a whole clip, or frame by
    frame.
    """
    clip, stands = rolling_walk(pelvis_turn=8.0)
    rig = proportioned(hips, legs, feet)
    transfer = Transfer(BODY, BETAS, rig, same_names())
    frames = zip(clip.times, clip.rotations, clip.root, strict=True)
    clips = [Clip(*(part[None] for part in frame)) for frame in frames] if is_live else [clip]
    heads = np.concatenate([transfer.pose(each).heads for each in clips])
    joints = clip.joints(BODY, BETAS)[:, [NAMES.index(name) for name in MAPPED]]
    for side, contact in stands.items():
        for first, second in ((f"{side}_hip", f"{side}_knee"), (f"{side}_knee", f"{side}_ankle")):
            ours = direction(heads, first, second, MAPPED)
            off = turn_between(ours, direction(joints, first, second, MAPPED))
            assert off.max() < np.radians(6.0), first
        row = MAPPED.index(f"{side}_foot")
        for begin, end in runs(contact[:, 1]):
            ball = heads[begin:end, row]
            assert np.ptp(ball[:, :2], axis=0).max() < 0.01
            np.testing.assert_allclose(ball[:, 2], rig.heads[row, 2] - rig.floor, atol=0.01)


def test_toes_of_long_feet_bend_no_further_than_the_bodys() -> None:
    """Long feet are pitched less than the body's. Stiff toes stay straight in the swing, pitched
    down as well as up; bendable ones stay flat while the heel rises over them.
    """
    rig = proportioned(1.0, 1.0, 1.6)
    transfer = Transfer(BODY, BETAS, rig, same_names())
    rows = [MAPPED.index("left_ankle"), MAPPED.index("left_foot")]

    def pitches(*, stiff_toes: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the contact of the left heel and ball, and how far foot and toes point down."""
        clip, stands = rolling_walk(stiff_toes=stiff_toes)
        turns = transfer.pose(clip).rotations[:, rows] @ np.swapaxes(rig.rotations[rows], 1, 2)
        foot, toes = np.degrees(np.arcsin(turns[:, :, 2, 1])).T
        return stands["left"], foot, toes

    contact, foot, toes = pitches(stiff_toes=True)
    on_floor = contact.any(axis=1)
    swings = ~on_floor
    swings[1:] &= ~on_floor[:-1]  # Until then, the floor bends the toes.
    assert foot[swings].max() > 20.0
    assert foot[swings].min() < -10.0
    np.testing.assert_allclose(toes[swings], foot[swings], atol=1.0)
    contact, foot, toes = pitches(stiff_toes=False)
    assert foot[contact[:, 1]].max() > 20.0
    np.testing.assert_allclose(toes[contact[:, 1]], 0.0, atol=1.0)
