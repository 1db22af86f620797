# SPDX-License-Identifier: GPL-3.0-or-later
"""Changing the amount of smoothing, always from the captured motions, so that repeated changes do
not accumulate.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...solver.body import Body
from ..arrays import Float64Array
from ..errors import UsageError
from ..kinematics.axes import transposed
from ..kinematics.frame_blocks import by_blocks
from ..kinematics.leg_reach import LEGS, move_ends
from ..kinematics.smoothing import (
    ROTATION_CUTOFF_HZ,
    gaussian_smooth,
    interpolate_rotations,
    smooth_root,
    smooth_rotations,
)
from ..motion import Motion
from .clip import Clip, clip_from_motion
from .corrected_motion import before_smoothing, corrected

# How far both ends are continued, per unit of strength beyond the finished motion: four standard
# deviations of the slower filter.
_REACH_S = 0.3


def smoothed(body: Body, motion: Motion, strength: float) -> Clip:
    """Smooth a motion without phase shift, and correct it where the user did.

    Strength 0 is the raw motion, of which every frame is fitted alone, 1 the finished one, of all
    frames together, and 3 very smooth. Below 1, the raw motion goes through a filter whose cut-off
    frequency is 4.5 Hz / strength, and a share of what the finished motion has besides is added.
    Beyond 1, the finished motion goes through a filter, of 4.5 Hz / √(strength² − 1), so that it
    would be one of 4.5 Hz / strength after one of 4.5 Hz; feet that rest stay where the finished
    motion has them. The distance from the camera, which a single camera measures inaccurately, is
    smoothed more than the position in the image.

    :raises UsageError: when the strength is negative or not a number.
    """
    if not np.isfinite(strength) or strength < 0:
        raise UsageError(f"the smoothing strength must be 0 or more, not {strength}")
    finished = clip_from_motion(body, motion, raw=False)
    is_unfiltered = len(finished) < 3  # too few frames for a filter
    if strength == 1 or (strength > 1 and is_unfiltered):
        return finished
    raw = clip_from_motion(body, motion, raw=True)
    if strength == 0 or is_unfiltered:
        return raw
    if not motion.corrections:
        return _smoothed(motion, body, raw, finished, strength)
    captured = before_smoothing(motion, body)
    clips = clip_from_motion(body, captured, raw=True), clip_from_motion(body, captured, raw=False)
    return corrected(_smoothed(captured, body, *clips, strength), motion, body)


def _smoothed(motion: Motion, body: Body, raw: Clip, finished: Clip, strength: float) -> Clip:
    """Smooth a motion without corrections; see `smoothed`."""
    if strength > 1.0:
        center = motion.world_from_camera[:, :3, 3]
        seen = replace(finished, root=finished.root - center)
        scenes = [_smoothed_further(seen.rows(rows), strength) for rows in motion.scenes]
        calm = Clip(
            finished.times,
            np.concatenate([scene.rotations for scene in scenes]),
            np.concatenate([scene.root for scene in scenes]) + center,
        )
        return _with_resting_feet(calm, finished, motion, body)
    plain = _filtered(raw, motion, 1.0)
    wanted = _filtered(raw, motion, strength)
    correction = transposed(plain.rotations) @ finished.rotations
    none = np.broadcast_to(np.eye(3), correction.shape)
    correction = interpolate_rotations(none, correction, np.full(correction.shape[:2], strength))
    return Clip(
        raw.times,
        wanted.rotations @ correction,
        wanted.root + strength * (finished.root - plain.root),
    )


def _filtered(clip: Clip, motion: Motion, strength: float) -> Clip:
    """Smooth without corrections; the position is taken relative to the camera, which may rotate
    but not travel.
    """
    times = motion.times_with_gaps
    rotations = smooth_rotations(clip.rotations, times, ROTATION_CUTOFF_HZ / strength)
    center = motion.world_from_camera[:, :3, 3]
    return Clip(clip.times, rotations, center + smooth_root(clip.root - center, times, strength))


def _smoothed_further(clip: Clip, strength: float) -> Clip:
    """Return one scene of a clip, whose root is relative to the camera, through a filter that keeps
    its first and its last frame.

    The filter would move both ends of a path inwards, a walker by 12 cm, so the scene goes on at
    each of them as its reflection in that frame's pose, direction, and logarithm of the distance.
    """
    beyond = float(np.sqrt(strength * strength - 1.0))
    times = clip.times
    R = clip.rotations
    T = len(clip)
    first, last = (int(np.sum(abs(times - end) <= _REACH_S * beyond)) - 1 for end in times[[0, -1]])
    before = slice(first, 0, -1)
    after = np.arange(T - 2, T - 2 - last, -1)
    times = np.concatenate([2 * times[0] - times[before], times, 2 * times[-1] - times[after]])
    root = np.concatenate(
        [
            _reflected(clip.root[before], clip.root[0]),
            clip.root,
            _reflected(clip.root[after], clip.root[-1]),
        ]
    )
    R = np.concatenate(
        [
            R[0] @ transposed(R[before]) @ R[0],
            R,
            R[-1] @ transposed(R[after]) @ R[-1],
        ]
    )
    smooth_rotations(R, times, ROTATION_CUTOFF_HZ / beyond, out=R)
    inner = slice(first, first + T)
    return Clip(clip.times, R[inner], smooth_root(root, times, beyond)[inner])


def _reflected(root: Float64Array, end: Float64Array) -> Float64Array:
    """Return positions (n, 3) with directions turned by 180° about that of ``end``, and distances d
    as end² / d.
    """
    squared = np.maximum(np.sum(root * root, axis=1, keepdims=True), 1e-12)
    return (2 * (root @ end)[:, None] * end - float(end @ end) * root) / squared


def _with_resting_feet(calm: Clip, finished: Clip, motion: Motion, body: Body) -> Clip:
    """Bend the legs so that the ankles of feet that rest are where the finished motion has them."""
    ankles = [body.joint_names.index(f"{side}_ankle") for side in ("left", "right")]
    pelvis_at_rest = body.rest_joints(motion.betas)[0]
    rests = motion.foot_contact.reshape(len(finished), 2, 2).max(axis=2).astype(float)
    share = gaussian_smooth(rests, motion.times_with_gaps, ROTATION_CUTOFF_HZ)

    def bend(
        R: Float64Array, root: Float64Array, R_held: Float64Array,
        root_held: Float64Array, share: Float64Array,
    ) -> tuple[Float64Array]:  # fmt: skip
        poses = body.forward_kinematics(R, root - pelvis_at_rest, motion.betas)
        held = body.forward_kinematics(R_held, root_held - pelvis_at_rest, motion.betas)[1]
        return (move_ends(body, LEGS, R, poses, share[..., None] * (held - poses[1])[:, ankles]),)

    rotations = by_blocks(
        bend, calm.rotations, calm.root, finished.rotations, finished.root, share
    )[0]
    return Clip(calm.times, rotations, calm.root)
