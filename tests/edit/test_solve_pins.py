# SPDX-License-Identifier: GPL-3.0-or-later
"""Solving a motion again around corrected frames, against a truth that was corrupted."""

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.edit.clip import Clip
from scope.scope_addon.edit.corrections import Contact, Pin
from scope.scope_addon.edit.solve_pins import Shot, keys_of_span, lowest_skin, missed, resolve
from scope.scope_addon.errors import UsageError
from scope.solver.rotations import exp

from ..made_motion import level_camera
from .walking import BETAS, BODY, NAMES, RATE, walk

TRUTH = walk(3.0)
T = len(TRUTH)
SHOT = Shot(
    np.arange(T),
    TRUTH.times,
    level_camera(T),
    np.tile([[900.0, 0, 320], [0, 900.0, 240], [0, 0, 1]], (T, 1, 1)),
    np.ones(T, bool),
    np.zeros(0),
)
JOINTS = TRUTH.joints(BODY, BETAS)
# the corrupted span
FIRST = 30
LAST = 60
ARM = [NAMES.index(f"left_{name}") for name in ("elbow", "wrist")]
OTHERS = [
    k
    for k, name in enumerate(NAMES)
    if not name.startswith("left_") or "hip" in name or "knee" in name
]


def corrupted(joints=("left_shoulder", "left_elbow")):
    """The walk with an arm that turns away by 40 degrees and comes back."""
    share = np.clip(
        1.6 * np.sin(np.pi * np.clip((np.arange(T) - FIRST) / (LAST - FIRST), 0, 1)), 0, 1
    )
    rotations = TRUTH.rotations.copy()
    for name, axis in zip(joints, ([0.4, 0.3, 0.5], [0.2, -0.5, 0.4]), strict=False):
        rotations[:, NAMES.index(name)] = rotations[:, NAMES.index(name)] @ exp(
            share[:, None] * np.array(axis)
        )
    return Clip(TRUTH.times, rotations, TRUTH.root.copy())


def pins(frames, names=("left_wrist",), image=True):
    found = []
    for frame in frames:
        for name in names:
            where = JOINTS[frame, NAMES.index(name)]
            pixel = tuple(SHOT.project(frame, where)) if image else None
            found.append(Pin(frame, name, pixel, None if image else tuple(where)))
    return found


def error(clip, joints=ARM):
    """Mean distance from the truth over the corrupted span, metres."""
    off = np.linalg.norm(clip.joints(BODY, BETAS) - JOINTS, axis=-1)
    return off[FIRST : LAST + 1][:, joints].mean()


def pixels(clip, joint):
    """Mean distance from the truth in the image over the corrupted span, pixels."""
    at = clip.joints(BODY, BETAS)[:, joint]
    return np.mean(
        [
            np.linalg.norm(SHOT.project(f, at[f]) - SHOT.project(f, JOINTS[f, joint]))
            for f in range(FIRST, LAST + 1)
        ]
    )


@pytest.mark.parametrize(
    ("frames", "left", "image"), [((45,), 0.6, True), ((37, 45, 53), 0.25, False)]
)
def test_pins_at_the_truth_correct_the_span_around_them(frames, left, image):
    bad = corrupted()
    wanted = pins(frames, ("left_elbow", "left_wrist"), image)
    good = resolve(bad, BODY, BETAS, wanted, SHOT)
    assert max(missed(good, BODY, BETAS, pin, SHOT) for pin in wanted) < (0.5 if image else 0.002)
    if image:
        assert pixels(good, ARM[1]) < left * pixels(bad, ARM[1])
    else:
        assert error(good) < left * error(bad)


def test_other_limbs_and_frames_stay_and_the_correction_begins_and_ends_without_a_jump():
    bad = corrupted()
    pin = pins((45,))[0]
    good = resolve(bad, BODY, BETAS, [pin], SHOT)
    changed = np.flatnonzero(
        (good.rotations != bad.rotations).any((1, 2, 3)) | (good.root != bad.root).any(1)
    )
    near = np.flatnonzero(np.abs(TRUTH.times - TRUTH.times[45]) < pin.reach)
    assert set(changed) <= set(near)
    assert len(changed) > 0.5 * len(near)
    change = good.joints(BODY, BETAS) - bad.joints(BODY, BETAS)
    moved = np.linalg.norm(change, axis=-1)
    assert moved[:, ARM[1]].max() > 0.1
    assert moved[:, OTHERS].max() < 0.005
    speed = np.linalg.norm(np.diff(change[:, ARM[1]], axis=0), axis=1) * RATE
    moving = np.flatnonzero(speed > 0)
    assert max(speed[moving[0]], speed[moving[-1]]) < 0.25 * speed.max()
    # nor one in between
    assert np.linalg.norm(np.diff(change[:, ARM[1]], 2, axis=0), axis=1).max() * RATE < speed.max()


def test_frames_between_two_pins_far_apart_keep_their_keys():
    # An elbow bent backwards, which a fit would turn even if nothing is pinned.
    bad = Clip(TRUTH.times, TRUTH.rotations.copy(), TRUTH.root.copy())
    bad.rotations[30:60, ARM[0]] = exp(np.array([0.0, 0.35, 0.0]))
    at = bad.joints(BODY, BETAS)[:, ARM[1]]
    wanted = [
        Pin(frame, "left_wrist", position=tuple(at[frame] + [0.05, 0.0, 0.05]))
        for frame in (10, 80)
    ]
    good = resolve(bad, BODY, BETAS, wanted, SHOT)
    assert max(missed(good, BODY, BETAS, pin, SHOT) for pin in wanted) < 0.005
    between = slice(10 + 13, 80 - 12)
    np.testing.assert_array_equal(good.rotations[between], bad.rotations[between])
    near = resolve(bad, BODY, BETAS, [replace(pin, reach=0.7) for pin in wanted], SHOT)
    assert (near.rotations[between] != bad.rotations[between]).any((1, 2, 3)).all()


def standing():
    """Somebody who stands with bent knees."""
    still = Clip(
        TRUTH.times, np.repeat(TRUTH.rotations[:1], T, axis=0), np.repeat(TRUTH.root[:1], T, axis=0)
    )
    knees = [NAMES.index(name) for name in ("left_knee", "right_knee", "left_hip", "right_hip")]
    for joint, angle in zip(knees, (0.8, 0.8, -0.4, -0.4), strict=True):
        still.rotations[:, joint] = exp(np.array([angle, 0, 0]))
    lowest = still.soles(BODY, BETAS)[..., 2].min()
    return Clip(still.times, still.rotations, still.root - [0.0, 0.0, lowest])


@pytest.mark.parametrize(
    ("joint", "down", "height"), [("pelvis", 0.2, 2.5), ("left_hip", 0.05, 0.3)]
)
def test_a_body_that_is_pulled_down_in_the_image_bends_its_knees_in_place(joint, down, height):
    still = standing()
    number = NAMES.index(joint)
    at = still.joints(BODY, BETAS)
    soles = still.soles(BODY, BETAS)
    camera = level_camera(T)
    camera[:, 2, 3] = height
    shot = replace(SHOT, world_from_camera=camera)
    pin = Pin(45, joint, tuple(shot.project(45, at[45, number] - [0.0, 0.0, down])))
    moved = resolve(still, BODY, BETAS, [pin], shot)
    assert missed(moved, BODY, BETAS, pin, shot) < 0.5
    change = moved.joints(BODY, BETAS) - at
    assert np.abs(change[:, number, 1]).max() < 0.02  # the camera looks along y
    assert abs(change[45, number, 2] + down) < 0.01
    assert np.linalg.norm(moved.soles(BODY, BETAS) - soles, axis=-1).max() < 0.01


@pytest.mark.parametrize("pitch", [20.0, 70.0])
def test_a_pelvis_in_the_image_stays_at_its_depth_whatever_the_camera_looks_at(pitch):
    at = JOINTS[45, 0]
    camera = np.tile(np.eye(4), (T, 1, 1))
    c = np.cos(np.radians(pitch))
    s = np.sin(np.radians(pitch))
    camera[:, :3, :3] = np.stack([[1.0, 0, 0], [0, -s, -c], [0, c, -s]], axis=1)
    camera[:, :3, 3] = at - 3.0 * camera[0, :3, 2]
    shot = replace(SHOT, world_from_camera=camera)
    u, v = shot.project(45, at)
    pin = Pin(45, "pelvis", (u + 15.0, v + 15.0))
    moved = resolve(TRUTH, BODY, BETAS, [pin], shot)
    assert missed(moved, BODY, BETAS, pin, shot) < 0.5
    along = [0.0, 1.0, 0.0] if pitch < 45 else camera[0, :3, 2]
    assert abs((moved.joints(BODY, BETAS)[45, 0] - at) @ along) < 0.01


def test_a_foot_that_stands_stays_on_the_floor():
    # 3 cm above the floor
    height = np.median(TRUTH.soles(BODY, BETAS)[50:63, :2, 2], axis=0).min() - 0.03
    clip = Clip(TRUTH.times, TRUTH.rotations.copy(), TRUTH.root - [0.0, 0.0, height])
    fixed = resolve(clip, BODY, BETAS, [Contact(50, 62, "left")], SHOT)
    soles = fixed.soles(BODY, BETAS)[50:63, :2]
    assert np.linalg.norm(soles - soles[0], axis=-1).max() < 0.003
    assert abs(soles[..., 2].min()) < 0.003
    changed = np.flatnonzero((fixed.rotations != clip.rotations).any((1, 2, 3)))
    assert changed[0] > 50 - 0.25 * RATE
    assert changed[-1] < 62 + 0.25 * RATE


def test_a_pinned_knee_leaves_a_foot_where_it_stands():
    clip = Clip(TRUTH.times, TRUTH.rotations, TRUTH.root - [0.0, 0.0, 0.075])
    contact = Contact(40, 48, "left")
    stands = resolve(clip, BODY, BETAS, [contact], SHOT)
    knee = stands.joints(BODY, BETAS)[44, NAMES.index("left_knee")]
    pin = Pin(44, "left_knee", position=tuple(knee + [0.05, 0.0, 0.0]))
    both = resolve(clip, BODY, BETAS, [contact, pin], SHOT)
    assert missed(both, BODY, BETAS, pin, SHOT) < 0.6 * missed(stands, BODY, BETAS, pin, SHOT)
    moved = both.soles(BODY, BETAS)[40:49, :2] - stands.soles(BODY, BETAS)[40:49, :2]
    assert np.linalg.norm(moved, axis=-1).max() < 0.005
    alone = resolve(clip, BODY, BETAS, [pin], SHOT).soles(BODY, BETAS)[44, :2]
    assert np.linalg.norm(alone - stands.soles(BODY, BETAS)[44, :2], axis=-1).max() > 0.05
    ankle = stands.joints(BODY, BETAS)[44, NAMES.index("left_ankle")]
    moves = Pin(44, "left_ankle", position=tuple(ankle + [0.0, 0.0, 0.05]))
    pinned = resolve(clip, BODY, BETAS, [contact, moves], SHOT)
    assert missed(pinned, BODY, BETAS, moves, SHOT) < 0.002


def test_both_feet_on_a_step_stay_when_the_pelvis_is_pinned():
    clip = standing()
    for name, angle in {"hip": -1.0, "knee": 1.2, "ankle": -0.2}.items():
        clip.rotations[:, NAMES.index(f"left_{name}")] = exp(np.array([angle, 0.0, 0.0]))
    soles = clip.soles(BODY, BETAS)
    assert np.ptp(soles[0, [0, 2], 2]) > 0.1
    place = clip.joints(BODY, BETAS)[45, 0] - [0.0, 0.0, 0.06]
    pin = Pin(45, "pelvis", position=tuple(place))
    moved = resolve(clip, BODY, BETAS, [pin], SHOT, floor=-np.inf)
    assert missed(moved, BODY, BETAS, pin, SHOT) < 0.005
    assert np.linalg.norm(moved.soles(BODY, BETAS) - soles, axis=-1).max() < 0.015


# Poses, by the rotation vectors of joints and of the whole body, the height of their lowest vertex,
# metres, and the parts whose skin rests.
RESTS = {
    "left_hand": (
        {
            "spine1": (0.9, 0.0, 0.0),
            "spine2": (0.6, 0.0, 0.0),
            **{f"{side}_hip": (-1.7, 0.0, 0.0) for side in ("left", "right")},
            **{f"{side}_knee": (2.2, 0.0, 0.0) for side in ("left", "right")},
            "left_shoulder": (0.0, -0.5, -1.2),
        },
        (0.0, 0.0, 0.0),
        0.0,
        ("left_wrist", "left_hand"),
    ),
    "back": ({}, (-1.5, 0.0, 0.0), 0.12, ("pelvis", "left_hip", "right_hip", "spine3")),
}


@pytest.mark.parametrize("part", RESTS)
def test_what_rests_stays_in_one_place_on_the_floor(part):
    turns, turn, height, parts = RESTS[part]
    rotations = np.tile(np.eye(3), (T, len(NAMES), 1, 1))
    rotations[:, 0] = TRUTH.rotations[0, 0] @ exp(np.array(turn))
    sway = 1.0 + 0.03 * np.sin(np.linspace(0.0, 12.0, T))
    for name, vector in turns.items():
        rotations[:, NAMES.index(name)] = exp(sway[:, None] * np.array(vector))
    clip = Clip(TRUTH.times, rotations, np.zeros((T, 3)))
    clip.root[:, 2] += depth(clip) + height
    rests = resolve(clip, BODY, BETAS, [Contact(40, 42, part)], SHOT)
    own = np.isin(BODY.strongest_joints, [NAMES.index(name) for name in parts])
    R, t = BODY.forward_kinematics(rests.rotations, rests.root - BODY.rest_joints(BETAS)[0], BETAS)
    lowest = [BODY.skin(R[k], t[k], BETAS)[own, 2].min() for k in range(40, 43)]
    assert np.abs(lowest).max() < 0.004
    joint = NAMES.index(parts[0])
    assert np.ptp(t[40:43, joint, :2], axis=0).max() < 0.002
    changed = np.flatnonzero((rests.root != clip.root).any(1))
    assert changed[0] > 40 - 0.25 * RATE
    assert changed[-1] < 42 + 0.25 * RATE


@pytest.mark.parametrize("part", ["back", "seat"])
def test_nothing_gets_under_the_floor_where_the_body_rests(part):
    """Of a man who squats with his arms beside him, and is laid down."""
    rotations = np.tile(np.eye(3), (T, len(NAMES), 1, 1))
    rotations[:, 0] = TRUTH.rotations[0, 0]
    squat = {"hip": (-1.7, 0.0, 0.0), "knee": (2.2, 0.0, 0.0), "ankle": (-0.5, 0.0, 0.0)}
    for side, way in (("left", -1.0), ("right", 1.0)):
        for name, vector in (squat | {"shoulder": (0.0, 0.0, 1.3 * way)}).items():
            rotations[:, NAMES.index(f"{side}_{name}")] = exp(np.array(vector))
    clip = Clip(TRUTH.times, rotations, np.zeros((T, 3)))
    clip.root[:, 2] += depth(clip)
    rests = resolve(clip, BODY, BETAS, [Contact(40, 42, part)], SHOT)
    assert np.abs(rests.root - clip.root)[40:43, 2].min() > 0.1
    assert depth(rests) < 0.012
    np.testing.assert_allclose(lowest_skin(rests, BODY, BETAS, "pelvis")[40:43], 0.0, atol=0.004)


@pytest.mark.parametrize(("way", "image"), [((1.0, 0.0, 0.0), True), ((-0.96, -0.28, 0.0), False)])
def test_a_pin_out_of_reach_stretches_the_arm_and_leaves_the_body(way, image):
    shoulder, elbow, wrist = (
        JOINTS[45, NAMES.index(f"left_{name}")] for name in ("shoulder", "elbow", "wrist")
    )
    length = np.linalg.norm(elbow - shoulder) + np.linalg.norm(wrist - elbow)
    place = shoulder + (length + 0.6) * np.array(way)  # 60 cm beyond reach
    pin = Pin(
        45,
        "left_wrist",
        tuple(SHOT.project(45, place)) if image else None,
        None if image else tuple(place),
    )
    moved = resolve(TRUTH, BODY, BETAS, [pin], SHOT).joints(BODY, BETAS)
    off = np.linalg.norm(moved - JOINTS, axis=-1)
    assert off[:, OTHERS].max() < 0.035
    arm = moved[45, NAMES.index("left_wrist")] - moved[45, NAMES.index("left_shoulder")]
    assert np.linalg.norm(arm) > 0.95 * length
    towards = (place - shoulder) / np.linalg.norm(place - shoulder)
    assert image or arm @ towards > 0.95 * length


def test_a_pinned_elbow_out_of_reach_and_a_wrist_beyond_it_leave_the_body():
    elbow = JOINTS[45, NAMES.index("left_elbow")]
    wanted = [Pin(45, "left_elbow", position=tuple(elbow + [0.5, 0, 0]))]
    wanted.append(Pin(45, "left_wrist", position=tuple(elbow + [1.2, 0, 0])))
    moved = resolve(TRUTH, BODY, BETAS, wanted, SHOT).joints(BODY, BETAS)
    assert np.linalg.norm(moved[:, 0] - JOINTS[:, 0], axis=-1).max() < 0.05


def test_corrections_at_frames_without_keys_are_left_out():
    half = Clip(TRUTH.times[:40], TRUTH.rotations[:40], TRUTH.root[:40])
    same = resolve(half, BODY, BETAS, [*pins((80,)), Contact(80, 85, "right")], SHOT)
    np.testing.assert_array_equal(same.rotations, half.rotations)


def test_a_span_has_no_key_of_a_frame_beside_it_whatever_the_rate():
    times = np.cumsum([0.0, *[0.033] * 10, 0.012, *[0.033] * 10])
    n = len(times)
    shot = replace(SHOT, frames=np.arange(n), times=times)
    clip = Clip(times, np.zeros((n, 1, 3, 3)), np.zeros((n, 3)))
    np.testing.assert_array_equal(keys_of_span(clip, 11, 14, shot), np.arange(11, 15))
    np.testing.assert_array_equal(keys_of_span(clip, 8, 10, shot), np.arange(8, 11))
    np.testing.assert_array_equal(keys_of_span(clip, 0, n - 1, shot), np.arange(n))
    np.testing.assert_array_equal(keys_of_span(clip, 3, 3, shot), [3])


def test_an_unknown_joint_is_an_error_that_lists_the_joints():
    with pytest.raises(UsageError, match=r"no joint 'left_paw'.*left_wrist"):
        resolve(TRUTH, BODY, BETAS, [Pin(40, "left_paw", (1.0, 2.0))], SHOT)


def depth(clip):
    """How far the lowest vertex of the whole body's skin is under the floor, metres."""
    R, t = BODY.forward_kinematics(clip.rotations, clip.root - BODY.rest_joints(BETAS)[0], BETAS)
    return -min(BODY.skin(R[k], t[k], BETAS)[:, 2].min() for k in range(FIRST, LAST + 1))
