# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether the footage seems to be turned: somebody lies, or stands on the head, all the time."""

from __future__ import annotations

import numpy as np

from .track import Track

_SHOULDERS = [11, 12]
_HIPS = [23, 24]
MIN_CONFIDENCE = 0.5  # of shoulders and hips that count
MAX_DEVIATION_DEG = 35.0  # of the trunk from a quarter turn
MIN_SHARE = 0.9  # of the frames in which the trunk has this direction
MIN_FRAMES = 10  # in which it was seen; in fewer, somebody may just lie


def needed_turn(track: Track) -> int:
    """Return by how many degrees clockwise a picture has to be turned for the person's trunk to be
    upright: a multiple of 90; 0 also where the trunk's direction changes.
    """
    confidence = track.confidence[:, _SHOULDERS + _HIPS].min(axis=1)
    shoulders = track.keypoints_px[:, _SHOULDERS].mean(axis=1)
    hips = track.keypoints_px[:, _HIPS].mean(axis=1)
    trunk = (shoulders - hips)[track.seen & (confidence > MIN_CONFIDENCE)].astype(float)
    if len(trunk) < MIN_FRAMES:
        return 0
    clockwise_deg = np.degrees(np.arctan2(trunk[:, 0], -trunk[:, 1]))
    for turn_deg in (90, 180, 270):
        deviation = (clockwise_deg + turn_deg + 180.0) % 360.0 - 180.0
        if (np.abs(deviation) < MAX_DEVIATION_DEG).mean() >= MIN_SHARE:
            return turn_deg
    return 0
