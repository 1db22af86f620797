# SPDX-License-Identifier: GPL-3.0-or-later
"""The distance and the lean of a body, corrected by the floor, the feet and balance."""

from __future__ import annotations

import numpy as np

from ...kinematics.smoothing import gaussian_smooth
from ...kinematics.standing import along_sight
from ..fitting.track_fit import Stance
from .balance import turn_over_feet
from .ground_plane import correct_depth, on_floor
from .placement import PlacedTrack

STANDING_CUTOFF_HZ = 1.0  # a leg must not jerk when the floor begins or ceases to bend it


def corrected_stance(placed: PlacedTrack, T_floor_camera: np.ndarray, balanced: bool) -> Stance:
    """Estimate how far away and how upright a body is, in the first frame's camera axes.

    :param T_floor_camera: (4, 4) camera to world, the floor that this person stands on at z = 0.
    :param balanced: whether the centre of mass has to be over the standing feet.
    """
    root, up = placed.root, T_floor_camera[2, :3]
    contact = placed.contact(up)
    away = correct_depth(root - placed.center, placed.supports, contact, T_floor_camera, placed.times)
    shift = away[:, None] * along_sight(root - placed.center)
    turn = np.broadcast_to(np.eye(3), (len(root), 3, 3))
    if balanced:
        turn, pivot = turn_over_feet(placed, contact, up)
        root = pivot + np.einsum("tij,tj->ti", turn, root - pivot)
    height = (placed.supports + shift[:, None]) @ up + T_floor_camera[2, 3]
    standing = gaussian_smooth(contact * on_floor(height), placed.times, STANDING_CUTOFF_HZ)
    T_frames = np.broadcast_to(T_floor_camera, (len(root), 4, 4))
    return Stance(root + shift, turn, T_frames[:, 2, :3], -T_frames[:, 2, 3], standing)
