# SPDX-License-Identifier: GPL-3.0-or-later
"""Repair of errors that networks typically make for a few frames."""

from __future__ import annotations

from dataclasses import replace

from ..camera.intrinsics import Camera
from ..fitting.ablation import Ablation
from ..tracking.hands.tentative_hands import confirmed
from ..tracking.hands.wrists_at_hands import wrists_at_hands
from ..tracking.keypoint_jumps import repair_keypoint_jumps
from ..tracking.left_right import repair_left_right
from ..tracking.limb_swap import repair_limb_swaps
from ..tracking.track import Track


def repair(track: Track, camera: Camera, ablation: Ablation) -> Track:
    """Undo left-right swaps and limb swaps, replace keypoint jumps, keep tentative hands that others support.

    Wrists go to hands that contradict them.
    """
    if ablation.left_right:
        track = repair_limb_swaps(repair_left_right(track, camera))
    if track.hands is not None:
        track = wrists_at_hands(replace(track, hands=confirmed(track.hands, track.times)))
    return repair_keypoint_jumps(track) if ablation.keypoint_jumps else track
