# SPDX-License-Identifier: GPL-3.0-or-later
"""Distance and lean of a body, corrected by floor, feet and balance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...kinematics.standing import line_of_sight
from ..fitting.prepared_track import Stance
from .balance import balancing_rotations
from .ground_plane import correct_depth, floor_probability
from .placement import PlacedTrack


def stance_on_ground(placed: PlacedTrack, T_floor_camera: NDArray[np.float64], balanced: bool) -> Stance:
    """Estimate the distance and lean of a body, in the first frame's camera axes.

    On uneven ground, the distance follows from feet at rest alone, and no foot is pulled to the floor.

    :param T_floor_camera: (4, 4) camera to world, with this person's floor at z = 0.
    :param balanced: whether the zero moment point has to lie between the contact points.
    """
    root, up = placed.root, T_floor_camera[2, :3]
    contact = placed.contact(up)
    one_floor = not placed.uneven_ground
    shift_m = correct_depth(
        root - placed.center, placed.contact_points, contact, T_floor_camera, placed.times, one_floor
    )
    shift = shift_m[:, None] * line_of_sight(root - placed.center)
    turn = np.broadcast_to(np.eye(3), (len(root), 3, 3))
    if balanced:
        turn, pivot = balancing_rotations(placed, contact, up)
        root = pivot + np.einsum("tij,tj->ti", turn, root - pivot)
    height = (placed.contact_points + shift[:, None]) @ up + T_floor_camera[2, 3]
    on_floor = contact * floor_probability(height) if one_floor else np.zeros_like(contact)
    T_frames = np.broadcast_to(T_floor_camera, (len(root), 4, 4))
    return Stance(root + shift, turn, T_frames[:, 2, :3], -T_frames[:, 2, 3], on_floor, contact)
