# SPDX-License-Identifier: GPL-3.0-or-later
"""Changing the amount of smoothing, always from the raw motion, so that repeated changes do not accumulate."""

from __future__ import annotations

import numpy as np

from ...solver.body import Body
from ..errors import UsageError
from ..kinematics.smoothing import ROTATION_CUTOFF_HZ, smooth_root, smooth_rotations
from ..motion import Motion
from .clip import Clip, clip_from_motion, interpolate_rotations
from .pins.corrected_motion import before_smoothing, corrected


def smoothed(body: Body, motion: Motion, strength: float) -> Clip:
    """Smooth the raw motion without phase shift, and correct it where the user did.

    Strength 0 is the raw motion, of which every frame is fitted alone, 1 the finished one, of all frames together, and
    3 very smooth. Anything else is the raw motion through a filter whose cut-off frequency is 4.5 Hz / strength. What
    the finished motion has besides, above all feet that stay in place, is its difference from the filtered one at
    strength 1; it is added to the result, and fades out below strength 1. The distance from the camera,
    which a single camera measures inaccurately, is smoothed more than the position in the image.

    :raises UsageError: when the strength is negative or not a number.
    """
    if not np.isfinite(strength) or strength < 0:
        raise UsageError(f"the smoothing strength must be 0 or more, not {strength}")
    raw = clip_from_motion(body, motion, raw=True)
    if strength == 0 or len(raw) < 3:
        return raw
    finished = clip_from_motion(body, motion, raw=False)
    if strength == 1:
        return finished
    if not motion.corrections:
        return _smoothed(motion, raw, finished, strength)
    captured = before_smoothing(motion, body)
    clips = clip_from_motion(body, captured, raw=True), clip_from_motion(body, captured, raw=False)
    return corrected(_smoothed(captured, *clips, strength), motion, body)


def _smoothed(motion: Motion, raw: Clip, finished: Clip, strength: float) -> Clip:
    """Smooth a motion without corrections; see `smoothed`."""
    plain, wanted = _plain(raw, motion, 1.0), _plain(raw, motion, strength)
    share = min(strength, 1.0)
    correction = np.swapaxes(plain.rotations, -1, -2) @ finished.rotations
    if share < 1.0:
        none = np.broadcast_to(np.eye(3), correction.shape)
        correction = interpolate_rotations(none, correction, np.full(correction.shape[:2], share))
    return Clip(raw.times, wanted.rotations @ correction, wanted.root + share * (finished.root - plain.root))


def _plain(raw: Clip, motion: Motion, strength: float) -> Clip:
    """Smooth without corrections; the position is taken relative to the camera, which may rotate but not travel."""
    rotations = smooth_rotations(raw.rotations, raw.times, ROTATION_CUTOFF_HZ / strength)
    center = motion.world_from_camera[:, :3, 3]
    return Clip(raw.times, rotations, center + smooth_root(raw.root - center, raw.times, strength))
