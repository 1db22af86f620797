# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracks without the errors that networks are known to make for a while."""

from __future__ import annotations

from ..camera.intrinsics import Camera
from ..fitting.ablation import Parts
from ..tracking.keypoint_jumps import repair_keypoint_jumps
from ..tracking.left_right import repair_left_right
from ..tracking.limb_swap import repair_limb_swaps
from ..tracking.track import Track


def repair(track: Track, camera: Camera, parts: Parts) -> Track:
    """Swap left and right back where they were exchanged, and replace keypoints that jump away for a few frames."""
    if parts.left_right:
        track = repair_limb_swaps(repair_left_right(track, camera))
    return repair_keypoint_jumps(track) if parts.leaps else track
