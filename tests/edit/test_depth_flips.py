# SPDX-License-Identifier: GPL-3.0-or-later
"""Limbs and bodies mirrored in depth: what the camera sees, on which side they are, and how they
bend.
"""

import numpy as np
import pytest
from scope.scope_addon.edit.clip import Clip
from scope.scope_addon.edit.corrected_motion import shot_of
from scope.scope_addon.edit.corrections import DepthFlip
from scope.scope_addon.edit.depth_flips import flipped
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL
from scope.solver.rotations import exp, log

from .walking import ARMS_DOWN, BETAS, BODY, NAMES, angle, motion_of, walk

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


SHOT = shot_of(motion_of(walk(2.0, speed=0.0)))


def flip(clip, part, first=FIRST, last=LAST):
    return flipped(clip, BODY, BETAS, [DepthFlip(first, last, part)], SHOT)


def seen(clip):
    """Return pixels (T, K+1, 2) and depths (T, K+1) along the rays, metres, of all joints."""
    camera = SHOT.world_from_camera[0]
    at = (clip.joints(BODY, BETAS) - camera[:3, 3]) @ camera[:3, :3]
    pixels = at @ SHOT.intrinsics[0].T
    return pixels[..., :2] / pixels[..., 2:], np.linalg.norm(at, axis=-1)


def depth_of_bone(clip, start, end):
    """Return by how much (T,) a bone points away from the camera, along the ray of its end."""
    camera = SHOT.world_from_camera[0, :3, 3]
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


def test_a_person_who_is_turned_around_is_the_mirror_image_with_the_other_side():
    clip = posed(
        pelvis=[0, 0.5, 0], left_hip=[-0.9, 0, 0.2], left_knee=[0.6, 0, 0], head=[0, 0.4, 0]
    )
    out = flip(clip, "body")
    camera = SHOT.world_from_camera[0, :3, 3]
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


def test_a_single_frame_and_the_ends_of_the_clip_can_be_flipped():
    clip = posed(left_hip=[-0.9, 0, 0], left_knee=[0.8, 0, 0])
    out = flip(clip, "left_leg", 30, 30)
    knee = NAMES.index("left_knee")
    assert np.linalg.norm((out.joints(BODY, BETAS) - clip.joints(BODY, BETAS))[30, knee]) > 0.2
    whole = flip(clip, "left_leg", 0, len(clip) - 1)
    assert angle(whole.rotations, clip.rotations)[:, NAMES.index("left_hip")].min() > 0.5
    np.testing.assert_array_equal(flip(clip, "left_leg", 500, 510).rotations, clip.rotations)
