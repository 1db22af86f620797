# SPDX-License-Identifier: GPL-3.0-or-later
"""Limbs and bodies mirrored in depth: what the camera sees, on which side they are, and how they
bend.
"""

import numpy as np
import pytest
from scope.scope_addon.edit.clip import Clip, clip_from_motion
from scope.scope_addon.edit.corrected_motion import corrections_of, shot_of, with_corrections
from scope.scope_addon.edit.corrections import DepthFlip, added
from scope.scope_addon.edit.depth_flips import flipped
from scope.scope_addon.edit.smooth import smoothed
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL
from scope.scope_addon.kinematics.mirrored_limbs import mirrored_limb
from scope.solver.rotations import exp, log

from .walking import ARMS_DOWN, BETAS, BODY, NAMES, RATE, angle, motion_of, walk

FIRST, LAST = 20, 40
INSIDE = slice(FIRST + 4, LAST - 3)
BLEND = 4  # frames, a little more than the blend outside of a span
CHAINS = {
    "arm": ("shoulder", "elbow", "wrist"),
    "leg": ("hip", "knee", "ankle"),
}


def posed(**rotations):
    """A person standing still in front of the camera for two seconds, with some joints turned."""
    clip = walk(2.0, speed=0.0)
    w = np.zeros((len(NAMES), 3))
    for name, value in (ARMS_DOWN | rotations).items():
        w[NAMES.index(name)] = value
    still = exp(w)
    still[0] = R_WORLD_MODEL @ exp(w[0])
    sway = exp(0.05 * np.sin(clip.times)[:, None, None] * np.ones((len(NAMES), 3)))
    return Clip(clip.times, still @ sway, clip.root)


def shot():
    return shot_of(motion_of(walk(2.0, speed=0.0)))


def flip(clip, part, first=FIRST, last=LAST):
    return flipped(clip, BODY, BETAS, [DepthFlip(first, last, part)], shot())


def seen(clip):
    """Return pixels (T, K+1, 2) and depths (T, K+1) along the rays, metres, of all joints."""
    camera = shot().world_from_camera[0]
    at = (clip.joints(BODY, BETAS) - camera[:3, 3]) @ camera[:3, :3]
    pixels = at @ shot().intrinsics[0].T
    return pixels[..., :2] / pixels[..., 2:], np.linalg.norm(at, axis=-1)


def depth_of_bone(clip, start, end):
    """Return by how much (T,) a bone points away from the camera, along the ray of its end."""
    camera = shot().world_from_camera[0, :3, 3]
    joints = clip.joints(BODY, BETAS)
    a, b = (joints[:, NAMES.index(name)] for name in (start, end))
    ray = (b - camera) / np.linalg.norm(b - camera, axis=1, keepdims=True)
    return ((b - a) * ray).sum(axis=1)


def test_a_flipped_arm_stays_in_the_image_and_has_the_other_depth():
    # Its elbow bends in the plane of the image, so that both bones can be mirrored.
    aside = log(exp(np.array([0.0, -0.7, 0.0])) @ exp(np.array([-1.3, 0.0, 0.0])))
    clip = posed(left_shoulder=aside, left_elbow=[0.0, -0.5, 0.0])
    out = flip(clip, "left_arm")
    before, after = seen(clip), seen(out)
    names = [f"left_{name}" for name in CHAINS["arm"]]
    for name in names[1:]:
        joint = NAMES.index(name)
        np.testing.assert_allclose(after[0][INSIDE, joint], before[0][INSIDE, joint], atol=0.01)
        assert np.abs(after[1] - before[1])[INSIDE, joint].min() > 0.1
    for start, end in zip(names[:-1], names[1:], strict=True):
        was, now = depth_of_bone(clip, start, end), depth_of_bone(out, start, end)
        assert (was * now)[INSIDE].max() < 0
        if start == names[0]:  # The forearm's start has moved, and the view is in perspective.
            np.testing.assert_allclose(-now[INSIDE], was[INSIDE], atol=1e-9)
    others = [k for k, name in enumerate(NAMES) if name not in ("left_shoulder", "left_elbow")]
    np.testing.assert_array_equal(out.rotations[:, others], clip.rotations[:, others])
    np.testing.assert_array_equal(out.root, clip.root)


@pytest.mark.parametrize("part", ["left_leg", "right_forearm", "body"])
def test_keys_beside_a_span_are_blended_and_others_are_the_same_to_the_bit(part):
    clip = posed(left_hip=[-0.9, 0, 0], left_knee=[0.8, 0, 0], right_elbow=[0, 0.9, 0.3])
    out = flip(clip, part)
    far = np.r_[0 : FIRST - BLEND, LAST + BLEND + 1 : len(clip)]
    np.testing.assert_array_equal(out.rotations[far], clip.rotations[far])
    steps = angle(out.rotations[:-1], out.rotations[1:]).max(axis=1)
    whole = angle(clip.rotations[30], out.rotations[30]).max()
    assert whole > 0.5
    assert steps.max() < 0.45 * whole  # rather than all of it between two frames
    np.testing.assert_allclose(np.linalg.det(out.rotations.reshape(-1, 3, 3)), 1.0, atol=1e-9)


@pytest.mark.parametrize("kind", ["arm", "leg"])
def test_elbows_and_knees_stay_hinges(kind):
    """A person standing sideways to the camera, with every limb bent in its natural direction."""
    axis = np.array([1.0, 0, 0]) if kind == "leg" else np.array([0, -1.0, 0])
    hinge = NAMES.index(f"left_{CHAINS[kind][1]}")
    turned = {f"left_{CHAINS[kind][0]}": [-0.7, 0.2, -0.4], f"left_{CHAINS[kind][1]}": 0.9 * axis}
    clip = posed(pelvis=[0, 1.0, 0], **turned)
    clip.rotations[:, hinge] = exp(0.9 * axis)
    for part in (f"left_{kind}", f"left_{'forearm' if kind == 'arm' else 'shin'}"):
        out = flip(clip, part)
        bend = log(out.rotations[INSIDE, hinge])
        assert (bend @ axis).min() > 0.3
        assert np.linalg.norm(bend - (bend @ axis)[:, None] * axis, axis=1).max() < 0.06


def test_a_raised_leg_that_was_captured_behind_comes_to_the_front():
    """The thigh was mirrored, and the shin was not: mirrored too, the knee would bend forwards."""
    truth = posed(left_hip=[-1.1, 0, 0.1], left_knee=[1.9, 0, 0])
    R, joints = BODY.forward_kinematics(
        truth.rotations, truth.root - BODY.rest_joints(BETAS)[0], BETAS
    )
    limb = tuple(NAMES.index(f"left_{name}") for name in CHAINS["leg"])
    wrong = truth.copy()
    camera = shot().world_from_camera[:, :3, 3]
    wrong.rotations[:, limb[:2]] = mirrored_limb(BODY.parents, R, joints, camera, limb, True, False)
    off = wrong.joints(BODY, BETAS) - truth.joints(BODY, BETAS)
    assert np.linalg.norm(off, axis=-1)[INSIDE].max() > 0.5
    fixed = flip(wrong, "left_leg")
    off = np.linalg.norm(fixed.joints(BODY, BETAS) - truth.joints(BODY, BETAS), axis=-1)[INSIDE]
    assert off[:, limb[1]].max() < 1e-3
    assert off[:, limb[2]].max() < 0.15  # the wrong one is elsewhere in the image
    assert log(fixed.rotations[INSIDE, limb[1]])[:, 0].min() > 1.0
    assert angle(fixed.rotations[INSIDE, limb[0]], truth.rotations[INSIDE, limb[0]]).max() < 0.5


def test_a_person_who_is_turned_around_is_the_mirror_image_with_the_other_side():
    clip = posed(
        pelvis=[0, 0.5, 0], left_hip=[-0.9, 0, 0.2], left_knee=[0.6, 0, 0], head=[0, 0.4, 0]
    )
    out = flip(clip, "body")
    camera = shot().world_from_camera[0, :3, 3]
    sight = (clip.root - camera) * [1.0, 1.0, 0.0]
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    joints = clip.joints(BODY, BETAS)
    swap = {"left": "right", "right": "left"}
    other = [
        NAMES.index("_".join([swap.get(first, first), *rest]))
        for first, *rest in (name.split("_") for name in NAMES)
    ]
    off = joints - clip.root[:, None]
    mirrored = off - 2 * (off @ sight[:, :, None]) * sight[:, None]
    # The body's own sides differ by less than this.
    got = out.joints(BODY, BETAS) - out.root[:, None]
    np.testing.assert_allclose(got[INSIDE], mirrored[INSIDE][:, other], atol=0.01)
    np.testing.assert_allclose(got[INSIDE, :, 2], off[INSIDE][:, other, 2], atol=0.01)
    np.testing.assert_array_equal(out.root, clip.root)


@pytest.mark.parametrize("part", ["left_arm", "right_shin", "body"])
def test_the_same_flip_twice_restores_the_pose(part):
    clip = posed(left_shoulder=[0.3, -0.9, -0.6], left_elbow=[0, -0.5, 0], right_knee=[0.9, 0, 0])
    again = flip(flip(clip, part), part)
    assert angle(again.rotations[INSIDE], clip.rotations[INSIDE]).max() < 1e-6
    one = DepthFlip(FIRST, LAST, part)
    assert added(added((), one), one) == ()


def test_a_single_frame_and_the_ends_of_the_clip_can_be_flipped():
    clip = posed(left_hip=[-0.9, 0, 0], left_knee=[0.8, 0, 0])
    out = flip(clip, "left_leg", 30, 30)
    knee = NAMES.index("left_knee")
    assert np.linalg.norm((out.joints(BODY, BETAS) - clip.joints(BODY, BETAS))[30, knee]) > 0.2
    whole = flip(clip, "left_leg", 0, len(clip) - 1)
    assert angle(whole.rotations, clip.rotations)[:, NAMES.index("left_hip")].min() > 0.5
    np.testing.assert_array_equal(flip(clip, "left_leg", 500, 510).rotations, clip.rotations)


def test_a_motion_keeps_its_flips_in_whatever_smoothing():
    clip = posed(left_hip=[-0.9, 0, 0.1], left_knee=[0.8, 0, 0])
    captured = motion_of(clip, noise=0.01)
    one = DepthFlip(FIRST, LAST, "left_leg")
    motion = with_corrections(captured, BODY, (one,))
    assert corrections_of(motion) == (one,)
    wanted = flip(clip, "left_leg").joints(BODY, BETAS)[INSIDE]
    for strength in (0.0, 1.0, 3.0):
        got = smoothed(BODY, motion, strength).joints(BODY, BETAS)[INSIDE]
        assert np.linalg.norm(got - wanted, axis=-1).max() < 0.12
    again = with_corrections(motion, BODY, ())
    for raw in (False, True):
        np.testing.assert_array_equal(
            clip_from_motion(BODY, again, raw).rotations,
            clip_from_motion(BODY, captured, raw).rotations,
        )
    assert len(motion) / RATE > 1.9
