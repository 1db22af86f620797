# SPDX-License-Identifier: GPL-3.0-or-later
"""Repair of errors that networks typically make for a few frames."""

from __future__ import annotations

from ..camera.intrinsics import Camera
from ..fitting.ablation import Ablation
from ..tracking.keypoint_jumps import repair_keypoint_jumps
from ..tracking.left_right import repair_left_right
from ..tracking.limb_swap import repair_limb_swaps
from ..tracking.track import Track


def repair(track: Track, camera: Camera, ablation: Ablation) -> Track:
    """Undo left-right swaps and limb swaps, and replace keypoint jumps."""
    if ablation.left_right:
        track = repair_limb_swaps(repair_left_right(track, camera))
    return repair_keypoint_jumps(track) if ablation.keypoint_jumps else track
