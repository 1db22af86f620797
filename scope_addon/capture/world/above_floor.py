# SPDX-License-Identifier: GPL-3.0-or-later
"""Raising feet out of the floor: the last step, for whatever depth errors have left under it.

The image determines a foot's depth poorly, so feet go under the floor where it is wrong by
centimetres, mostly near the camera and where a person enters or leaves the image. A foot whose skin
is at the height h < 0 goes to

    φ(h) = −τ (1 − exp(h / τ)) > −τ,

which is what it was at h = 0, with the same slope, so that a foot slows down at the floor as a real
one does, and a foot at rest a few millimetres below it hardly moves. Where h stays within
`UNDER_FLOOR_M`, nothing changes at all.

Body and legs share the lift. The root rises by what the deeper foot needs, except as far as the
other foot or a palm rests on the floor and would leave it; the legs bend by the rest. Feet that are
not in the image are a guess, and do not move the body. Where a foot rests on something clearly
below the floor, as after a leap from a wall, the floor is another one and the motion stays.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...arrays import Float64Array, FloatArray
from ...kinematics.contact_points import SOLES
from ...kinematics.foot_skin import UNDER_FLOOR_M, FootSkin, lower_floors
from ...kinematics.frame_blocks import by_blocks
from ...kinematics.leg_reach import move_feet
from ...kinematics.runs import runs
from ...kinematics.smoothing import gaussian_smooth
from .placement import PlacedTrack

SOFTNESS_M = 0.007  # τ
LIFT_CUTOFF_HZ = 6.0
ROOT_CUTOFF_HZ = 4.0
# From this contact probability on, a foot or a palm carries weight and stays where it is.
RESTING = 0.9
ROUNDS = 4  # of smoothing without going below what is needed


def raise_feet(
    placed: PlacedTrack, contact: FloatArray, T_floor_camera: Float64Array
) -> PlacedTrack:
    """Raise the feet of a motion that go under the floor; a motion that has none is returned as it
    is.

    :param contact: (T, 6) probability that each sole point and palm rests on something.
    :param T_floor_camera: (4, 4) camera to world, with this person's floor at z = 0.
    :return: the motion with new rotations and root; joints and contact points are still those of
        the given motion.
    """
    lifts = _foot_lifts(_heights(placed, T_floor_camera), contact, placed.times)
    if not lifts.any():
        return placed
    up = T_floor_camera[2, :3]
    supports = np.stack(
        [contact[:, :2].max(1), contact[:, 2:4].max(1), contact[:, len(SOLES) :].max(1)], axis=1
    )
    supports = np.minimum(supports / RESTING, 1.0)
    seen = placed.contact_points_visible[:, : len(SOLES)].reshape(-1, 2, 2).max(axis=2)
    rise = _root_rise(lifts, seen, supports, placed.times)
    # A foot in the air goes up with the body, one that rests stays where it is.
    wanted = lifts + (1 - supports[:, :2]) * np.maximum(rise[:, None] - lifts, 0.0)
    shift = wanted - rise[:, None]
    body = placed.body
    pelvis_at_rest = placed.body.rest_joints(placed.betas)[0]

    def bend(rotations: FloatArray, root: FloatArray, shift: FloatArray) -> tuple[FloatArray]:
        poses = body.forward_kinematics(rotations, root - pelvis_at_rest, placed.betas)
        return (
            move_feet(body, rotations, poses, shift[..., None] * up).astype(
                rotations.dtype, copy=False
            ),
        )

    rotations = by_blocks(bend, placed.rotations, placed.root, shift)[0]
    return replace(placed, rotations=rotations, root=placed.root + rise[:, None] * up)


def _heights(placed: PlacedTrack, T_floor_camera: Float64Array) -> Float64Array:
    """Return the (T, 4) heights of the feet's parts above the floor."""
    body = placed.body
    betas = placed.betas
    skin = FootSkin(body, betas)
    pelvis_at_rest = body.rest_joints(betas)[0]

    def heights(rotations: FloatArray, root: FloatArray) -> tuple[Float64Array]:
        poses = body.forward_kinematics(rotations, root - pelvis_at_rest, betas)
        return (skin.heights(*poses, T_floor_camera[2, :3]),)

    above: Float64Array = (
        by_blocks(heights, placed.rotations, placed.root)[0] + T_floor_camera[2, 3]
    )
    return above


def _foot_lifts(heights: Float64Array, contact: FloatArray, times: Float64Array) -> Float64Array:
    """Return by how much the left and the right foot have to rise, (T, 2), smooth in time and
    nowhere too little.
    """
    lowest = np.minimum(heights[:, [0, 2]], heights[:, [1, 3]])
    for first, end in lower_floors(heights, contact[:, : len(SOLES)], times):
        lowest[first:end] = 0.0
    lifts = np.zeros(lowest.shape)
    for foot in range(2):
        depth = np.zeros(len(times))
        for first, end in runs(lowest[:, foot] < 0):
            if lowest[first:end, foot].min() < -UNDER_FLOOR_M:
                depth[first:end] = -lowest[first:end, foot]
        soft = depth - SOFTNESS_M * (1 - np.exp(-depth / SOFTNESS_M))
        least = np.maximum(depth - 0.95 * UNDER_FLOOR_M, 0.0)
        lift = soft
        for _ in range(ROUNDS if depth.any() else 0):
            lift = gaussian_smooth(np.maximum(lift, least), times, LIFT_CUTOFF_HZ)
        lifts[:, foot] = np.maximum(lift, least)
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
