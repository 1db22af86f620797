# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits that a motion keeps: frames that are interpolated, and feet that are put on the floor.

They change what was captured, in whatever smoothing. Feet that stand and pins are measurements and
are applied to the result, so that they hold.

A correction of the world moves everything, the camera too, by a rigid transform. One of them is
the height of the floor under a foot of which the user says that it rests there.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from ...solver.body import Body
from ...solver.rotations import exp, log, shortest_turn
from ..arrays import Float64Array, FloatArray
from ..kinematics.axes import UP, rotated, transform_points
from ..kinematics.foot_skin import FootSkin
from ..kinematics.smoothing import gaussian_smooth
from ..kinematics.standing import standing_probability
from ..motion import Motion
from .clip import Clip, sample
from .corrections import (
    Correction,
    FeetOnFloor,
    Interpolation,
    feet_on_floor,
    floor_height,
    world_of,
)
from .solve_pins import Shot, keys_of_span
from .spans import interpolate

_MAX_TILT = np.radians(20.0)  # A steeper plane through the soles is not the floor.
_MIN_SPREAD_M = 0.3  # Soles closer together do not show the slope of the floor.
_LIFT_CUTOFF_HZ = 3.0
LOWER = "lower"
_PARTS = {LOWER: slice(0, 4), "left": slice(0, 2), "right": slice(2, 4)}


def edited(
    clip: Clip,
    body: Body,
    betas: FloatArray,
    corrections: Iterable[Correction],
    shot: Shot,
) -> Clip:
    """Apply the edits among the corrections, in the captured world: interpolations in their order,
    then the feet.

    :param betas: (P,) shape coefficients.
    """
    corrections = tuple(corrections)
    out = interpolated(clip, [c for c in corrections if isinstance(c, Interpolation)], shot)
    feet = feet_on_floor(corrections)
    world = world_of(corrections)
    if feet is None:
        return out
    height = floor_above(corrections, feet)
    if world is None:
        return refloor(out, body, betas, feet, height, shot)
    placed = refloor(moved_clip(out, world), body, betas, feet, height, shot)
    return moved_clip(placed, np.linalg.inv(world))


def interpolated(
    clip: Clip, spans: Iterable[Interpolation], shot: Shot, *, strict: bool = False
) -> Clip:
    """Interpolate spans of source frames, one after the other, where they have a key on both sides.

    Other spans stay as they are.

    :param shot: the footage's frames and times, on the clip's clock.
    :param strict: refuse the other spans.
    :raises UsageError: ``strict``, and a span has no key, or none on one side.
    """
    out = clip.copy()
    for each in spans:
        span = keys_of_span(clip, each.first, each.last, shot)
        if not len(span) or span[0] == 0 or span[-1] == len(clip) - 1:
            if strict:  # This raises, and says why the span cannot be interpolated.
                out = interpolate(out, shot.time(each.first), shot.time(each.last))
            continue
        # Two keys on each side give the velocities at both ends.
        around = slice(max(span[0] - 2, 0), span[-1] + 3)
        part = interpolate(out.rows(around), out.times[span[0]], out.times[span[-1]])
        out.rotations[around] = part.rotations
        out.root[around] = part.root
    return out


def floor_above(corrections: Iterable[Correction], feet: FeetOnFloor) -> float:
    """Return the z of the floor that feet are put on, metres, in the world that the corrections
    have moved.
    """
    return feet.height - floor_height(corrections)


def moved_motion(motion: Motion, body: Body, transform: Float64Array) -> Motion:
    """Move a motion and its camera in the world; what its corrections say stays as it is.

    :param transform: (4, 4) rigid.
    """
    rest = body.rest_joints(motion.betas)[0]
    changed: dict[str, Any] = {"world_from_camera": transform @ motion.world_from_camera}
    for poses, trans in (("poses", "trans"), ("poses_raw", "trans_raw")):
        turned = getattr(motion, poses).copy()
        turned[:, :3] = log(transform[:3, :3] @ exp(turned[:, :3].astype(float)))
        before = getattr(motion, trans)
        pelvis = transform_points(transform, rest + before)
        changed |= {poses: turned, trans: (pelvis - rest).astype(before.dtype)}
    return replace(motion, **changed)


def moved_clip(clip: Clip, transform: Float64Array) -> Clip:
    """Move a clip in the world; ``transform``, (4, 4) or one for each key (T, 4, 4), is rigid."""
    turn = transform[..., :3, :3]
    rotations = clip.rotations.copy()
    rotations[:, 0] = turn @ rotations[:, 0]
    return Clip(clip.times, rotations, rotated(turn, clip.root) + transform[..., :3, 3])


def refloor(
    clip: Clip,
    body: Body,
    betas: FloatArray,
    feet: FeetOnFloor,
    height: float = 0.0,
    shot: Shot | None = None,
) -> Clip:
    """Move the motion so that the feet in contact are on the floor.

    With ``feet.level``, the whole motion is rotated about the mean contact point so that the soles
    in contact lie in a horizontal plane, if they are spread widely enough to determine one. With
    ``feet.lift``, frames whose feet penetrate the floor are raised, smoothly.

    :param betas: (P,) shape coefficients.
    :param height: z of the floor in the clip's world, metres.
    :param shot: the clip's; frames in which it does not show the person say nothing of the floor.
    """
    soles = clip.soles(body, betas)
    times = clip.times if shot is None else shot.apart(clip).times
    seen = np.ones(len(clip), bool) if shot is None else shot.seen_at(clip.times)
    weight = standing_probability(soles, UP, times) * seen[:, None]
    out = clip.copy()
    if feet.level:
        turn, middle = _levelling(soles, weight)
        out.rotations[:, 0] = turn @ out.rotations[:, 0]
        out.root = (out.root - middle) @ turn.T + middle
        soles = (soles - middle) @ turn.T + middle
    standing = weight > 0.5
    heights = soles[..., 2]
    floor = (
        float(np.median(heights[standing]))
        if standing.any()
        else float(np.median(heights[seen if seen.any() else slice(None)].min(axis=1)))
    )
    out.root[:, 2] -= floor - height
    if feet.lift:
        below = np.maximum(0.0, floor - heights.min(axis=1))
        smooth = gaussian_smooth(below, times, _LIFT_CUTOFF_HZ)
        out.root[:, 2] += np.maximum(smooth, below)
    return out


def _levelling(soles: Float64Array, weight: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Fit a plane to the soles in contact and return the rotation that levels it.

    :param soles: (T, 4, 3) metres, world frame.
    :param weight: (T, 4) standing probabilities.
    :return: rotation (3, 3), and the point (3,) about which it rotates.
    """
    points = soles[weight > 0.5]
    w = weight[weight > 0.5]
    if len(points) < 3:
        return np.eye(3), np.zeros(3)
    middle = (w[:, None] * points).sum(0) / w.sum()
    values, vectors = np.linalg.eigh(
        (w[:, None] * (points - middle)).T @ (points - middle) / w.sum()
    )
    if np.sqrt(max(values[1], 0.0)) < _MIN_SPREAD_M / 2:
        return np.eye(3), middle
    normal = vectors[:, 0] * (1.0 if vectors[2, 0] > 0 else -1.0)
    if np.arccos(np.clip(normal @ UP, -1.0, 1.0)) > _MAX_TILT:
        return np.eye(3), middle
    return shortest_turn(normal, UP), middle


def foot_height(clip: Clip, body: Body, betas: FloatArray, time: float, foot: str) -> float:
    """Return the height in metres of the lowest skin of a foot at a time.

    :param betas: (P,) shape coefficients.
    :param time: seconds, on the clip's clock.
    :param foot: "left", "right" or "lower", which is the lower one of the two.
    """
    betas = np.asarray(betas, float)
    at = sample(clip, np.array([time]))
    heights = FootSkin(body, betas).heights(*at.parts(body, betas), UP)[0]
    return float(heights[_PARTS[foot]].min())
