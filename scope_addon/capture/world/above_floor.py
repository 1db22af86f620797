# SPDX-License-Identifier: GPL-3.0-or-later
"""Raising a body out of the floor: the last step, for whatever depth errors have left under it.

The image determines a foot's depth poorly, so feet go under the floor where it is wrong by
centimetres, mostly near the camera and where a person enters or leaves the image. A foot whose skin
is at the height h < 0 goes to

    φ(h) = −τ (1 − exp(h / τ)) > −τ,

which is what it was at h = 0, with the same slope, so that a foot slows down at the floor as a real
one does, and a foot at rest a few millimetres below it hardly moves. Where h stays within
`UNDER_FLOOR_M`, nothing changes at all.

Body and legs share the lift. The root rises by what the deeper foot needs, except as far as the
other foot or a palm rests on the floor and would leave it; the legs bend by the rest. Trunk, head,
thighs and upper arms, on which somebody sits, kneels, lies or leans, go up with the root alone, and
hands by their arms. Feet that are not in the image are a guess, and so is the floor then: they do
not move the body, and nothing else is raised. Where a foot rests on something clearly below the
floor, as after a leap from a wall, the floor is another one and the motion stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ....solver.body import Body
from ...arrays import BoolArray, Float64Array, FloatArray
from ...kinematics.contact_points import FOOT_PARTS, SOLES
from ...kinematics.foot_skin import UNDER_FLOOR_M, FootSkin, lower_floors
from ...kinematics.frame_blocks import by_blocks
from ...kinematics.leg_reach import ARMS, LEGS, move_ends
from ...kinematics.sequences import runs
from ...kinematics.smoothing import gaussian_smooth
from .placement import PlacedTrack

SOFTNESS_M = 0.007  # τ
LIFT_CUTOFF_HZ = 6.0
ROOT_CUTOFF_HZ = 4.0
# From this contact probability on, a foot or a palm carries weight and stays where it is.
RESTING = 0.9
ROUNDS = 4  # of smoothing without going below what is needed


_HAND_WORDS = ("wrist", "hand", "thumb", "index", "middle", "ring", "pinky")
# Thighs and upper arms, whose skin reaches to knees and elbows, go up with the trunk.
_TRUNK = (
    *("pelvis", "spine1", "spine2", "spine3", "neck", "head"),
    *("left_hip", "right_hip", "left_shoulder", "right_shoulder"),
)


def raise_body(
    placed: PlacedTrack, contact: FloatArray, T_floor_camera: Float64Array
) -> PlacedTrack:
    """Raise what goes under the floor; a motion in which nothing does is returned as it is.

    :param contact: (T, 6) probability that each sole point and palm rests on something.
    :param T_floor_camera: (4, 4) camera to world, with this person's floor at z = 0.
    :return: the motion with new rotations and root; joints and contact points are still those of
        the given motion.
    """
    up = T_floor_camera[2, :3]
    hand_parts = _hand_parts(placed.body)
    heights = _heights(placed, T_floor_camera, (*FOOT_PARTS, *_TRUNK, *hand_parts))
    feet, trunk, hands = np.split(heights, [len(FOOT_PARTS), len(FOOT_PARTS) + len(_TRUNK)], axis=1)
    elsewhere = np.zeros(len(heights), np.bool_)
    for first, end in lower_floors(feet, contact[:, : len(SOLES)], placed.times):
        elsewhere[first:end] = True
    lifts = _lifts(np.minimum(feet[:, [0, 2]], feet[:, [1, 3]]), elsewhere, placed.times)
    seen = placed.contact_points_visible[:, : len(SOLES)].reshape(-1, 2, 2).max(axis=2)
    # Without feet in the image, the floor is a guess.
    floor_seen = seen.max(axis=1, keepdims=True)
    trunk_lift = floor_seen * _lifts(trunk.min(axis=1, keepdims=True), elsewhere, placed.times)
    sides = hands.reshape(len(hands), 2, -1).min(axis=2)
    hand_lifts = floor_seen * _lifts(sides, elsewhere, placed.times)
    if not (lifts.any() or trunk_lift.any() or hand_lifts.any()):
        return placed
    supports = np.stack(
        [contact[:, :2].max(1), contact[:, 2:4].max(1), contact[:, len(SOLES) :].max(1)], axis=1
    )
    supports = np.minimum(supports / RESTING, 1.0)
    rise = np.maximum(_root_rise(lifts, seen, supports, placed.times), trunk_lift[:, 0])
    # A foot in the air goes up with the body, one that rests stays where it is.
    wanted = lifts + (1 - supports[:, :2]) * np.maximum(rise[:, None] - lifts, 0.0)
    foot_shift = wanted - rise[:, None]
    # A hand goes up with the body, too, and by its arm if that is not enough.
    hand_shift = np.maximum(hand_lifts - rise[:, None], 0.0)
    body = placed.body
    pelvis_at_rest = placed.body.rest_joints(placed.betas)[0]

    def bend(
        rotations: FloatArray, root: FloatArray, foot_shift: FloatArray, hand_shift: FloatArray
    ) -> tuple[FloatArray]:
        poses = body.forward_kinematics(rotations, root - pelvis_at_rest, placed.betas)
        moved = move_ends(body, LEGS, rotations, poses, foot_shift[..., None] * up)
        if hand_shift.any():
            moved = move_ends(body, ARMS, moved, poses, hand_shift[..., None] * up)
        return (moved.astype(rotations.dtype, copy=False),)

    rotations = by_blocks(bend, placed.rotations, placed.root, foot_shift, hand_shift)[0]
    return replace(placed, rotations=rotations, root=placed.root + rise[:, None] * up)


def _hand_parts(body: Body) -> list[str]:
    """Return the parts of both hands, the left ones first and as many as on the right."""
    return [
        name
        for side in ("left", "right")
        for name in body.joint_names
        if name.startswith(side) and any(word in name for word in _HAND_WORDS)
    ]


def _heights(
    placed: PlacedTrack, T_floor_camera: Float64Array, parts: Sequence[str]
) -> Float64Array:
    """Return the (T, N) heights of the lowest skin of N parts above the floor."""
    body = placed.body
    betas = placed.betas
    skin = FootSkin(body, betas, parts)
    pelvis_at_rest = body.rest_joints(betas)[0]

    def heights(rotations: FloatArray, root: FloatArray) -> tuple[Float64Array]:
        poses = body.forward_kinematics(rotations, root - pelvis_at_rest, betas)
        return (skin.heights(*poses, T_floor_camera[2, :3]),)

    return by_blocks(heights, placed.rotations, placed.root)[0] + T_floor_camera[2, 3]


def _lifts(lowest: Float64Array, elsewhere: BoolArray, times: Float64Array) -> Float64Array:
    """Return by how much parts have to rise, (T, N), smooth in time and nowhere too little.

    :param lowest: (T, N) heights of their lowest skin.
    :param elsewhere: (T,) frames in which the floor is another one.
    """
    lowest = np.where(elsewhere[:, None], 0.0, lowest)
    lifts = np.zeros(lowest.shape)
    for part in range(lowest.shape[1]):
        depth = np.zeros(len(times))
        for first, end in runs(lowest[:, part] < 0):
            if lowest[first:end, part].min() < -UNDER_FLOOR_M:
                depth[first:end] = -lowest[first:end, part]
        soft = depth - SOFTNESS_M * (1 - np.exp(-depth / SOFTNESS_M))
        least = np.maximum(depth - 0.95 * UNDER_FLOOR_M, 0.0)
        lift = soft
        for _ in range(ROUNDS if depth.any() else 0):
            lift = gaussian_smooth(np.maximum(lift, least), times, LIFT_CUTOFF_HZ)
        lifts[:, part] = np.maximum(lift, least)
    return lifts


def _root_rise(
    lifts: Float64Array, seen: FloatArray, supports: FloatArray, times: Float64Array
) -> Float64Array:
    """Return by how much the whole body rises, (T,): what the deeper foot needs, unless something
    else rests.

    :param lifts: (T, 2) of the feet.
    :param seen: (T, 2) 0..1, whether each foot was seen.
    :param supports: (T, 3) probability that left foot, right foot and palms rest on something.
    """
    needs = np.concatenate([lifts, np.zeros((len(lifts), 1))], axis=1)
    deepest = (lifts * seen).max(axis=1, keepdims=True)
    allowed = needs + np.maximum(deepest - needs, 0.0) * (1 - supports)
    return gaussian_smooth(np.minimum(allowed, deepest).min(axis=1), times, ROOT_CUTOFF_HZ)
