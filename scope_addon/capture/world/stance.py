# SPDX-License-Identifier: GPL-3.0-or-later
"""The distance and the lean of a body, corrected by the floor, the feet and balance."""

from __future__ import annotations

import numpy as np

from ...kinematics.smoothing import gaussian_smooth
from ...kinematics.standing import line_of_sight
from ..fitting.prepared_track import Stance
from .balance import balancing_rotations
from .ground_plane import correct_depth, on_floor
from .placement import PlacedTrack

STANDING_CUTOFF_HZ = 1.0  # a leg must not jerk when the floor begins or ceases to bend it


def stance_on_floor(placed: PlacedTrack, T_floor_camera: np.ndarray, balanced: bool) -> Stance:
    """Estimate how far away and how upright a body is, in the first frame's camera axes.

    :param T_floor_camera: (4, 4) camera to world, the floor that this person stands on at z = 0.
    :param balanced: whether the centre of mass has to be over the standing feet.
    """
    root, up = placed.root, T_floor_camera[2, :3]
    contact = placed.contact(up)
    away = correct_depth(root - placed.center, placed.contact_points, contact, T_floor_camera, placed.times)
    shift = away[:, None] * line_of_sight(root - placed.center)
    turn = np.broadcast_to(np.eye(3), (len(root), 3, 3))
    if balanced:
        turn, pivot = balancing_rotations(placed, contact, up)
        root = pivot + np.einsum("tij,tj->ti", turn, root - pivot)
    height = (placed.contact_points + shift[:, None]) @ up + T_floor_camera[2, 3]
    standing = gaussian_smooth(contact * on_floor(height), placed.times, STANDING_CUTOFF_HZ)
    T_frames = np.broadcast_to(T_floor_camera, (len(root), 4, 4))
    return Stance(root + shift, turn, T_frames[:, 2, :3], -T_frames[:, 2, 3], standing)
