# SPDX-License-Identifier: GPL-3.0-or-later
"""Smoothing more or less, always from the motion as it was solved, so that trying costs nothing."""

from __future__ import annotations

import numpy as np

from ...solver.body import Body
from ...solver.rotations import exp
from ..errors import UsageError
from ..kinematics.smoothing import ROTATION_CUTOFF_HZ, smooth_root, smooth_rotations
from ..motion import Motion
from .clip import Clip, between


def clip_from_motion(body: Body, motion: Motion, raw: bool) -> Clip:
    """The motion as keys: as it was finished, or as it was solved (``raw``)."""
    poses, trans = (motion.poses_raw, motion.trans_raw) if raw else (motion.poses, motion.trans)
    rotations = exp(poses.reshape(len(motion), -1, 3).astype(float))
    return Clip(motion.timestamps, rotations, body.rest_joints(motion.betas)[0] + trans)


def smoothed(body: Body, motion: Motion, strength: float) -> Clip:
    """Zero-phase smoothing from the raw motion.

    The cut-off frequency is 4.5 Hz / strength: 0 leaves the raw motion, 1 is what a capture does, 3 is calm. What the
    capture did besides, holding the feet that stand, is kept as its difference from the plain smoothing at strength 1,
    and fades out below it. The distance from the camera, which one camera measures badly, is smoothed more than the
    position in the picture.

    :raises UsageError: the strength is negative or not a number.
    """
    if not np.isfinite(strength) or strength < 0:
        raise UsageError(f"smoothing takes a strength from 0 on, not {strength}")
    raw = clip_from_motion(body, motion, raw=True)
    if strength == 0 or len(raw) < 3:
        return raw
    finished = clip_from_motion(body, motion, raw=False)
    if strength == 1:
        return finished
    plain, wanted = _plain(raw, motion, 1.0), _plain(raw, motion, strength)
    share = min(strength, 1.0)
    correction = np.swapaxes(plain.rotations, -1, -2) @ finished.rotations
    if share < 1.0:
        none = np.broadcast_to(np.eye(3), correction.shape)
        correction = between(none, correction, np.full(correction.shape[:2], share))
    return Clip(raw.times, wanted.rotations @ correction, wanted.root + share * (finished.root - plain.root))


def _plain(raw: Clip, motion: Motion, strength: float) -> Clip:
    """Smoothing alone; the position about the camera, which may turn but not travel."""
    rotations = smooth_rotations(raw.rotations, raw.times, ROTATION_CUTOFF_HZ / strength)
    center = motion.world_from_camera[:, :3, 3]
    return Clip(raw.times, rotations, center + smooth_root(raw.root - center, raw.times, strength))
