# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a person goes, apart from how they move: the root's path on the floor with its heading."""

from __future__ import annotations

import numpy as np

from ..kinematics.axes import R_WORLD_MODEL
from ..kinematics.smoothing import gaussian_smooth
from .clip import Clip

_HEADING_CUTOFF_HZ = 1.0  # hips turn with every step; where a person goes does not


def floor_trajectory(clip: Clip, *, heading: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """The pelvis's shadow on the floor.

    :param heading: also how far the person has turned about the upright axis, smoothed; zeros otherwise.
    :return: positions (T, 3) with z = 0, angles (T,) in radians, without jumps of a whole turn, zero at the rest pose's
        facing.
    """
    positions = clip.root * [1.0, 1.0, 0.0]
    if not heading:
        return positions, np.zeros(len(clip))
    # The model faces +z, so R_world_root takes z to where the person faces; at rest that is R_WORLD_MODEL's.
    facing, rest = clip.rotations[:, 0] @ [0.0, 0.0, 1.0], R_WORLD_MODEL @ [0.0, 0.0, 1.0]
    angle = np.unwrap(np.arctan2(facing[:, 1], facing[:, 0]) - np.arctan2(rest[1], rest[0]))
    return positions, gaussian_smooth(angle, clip.times, _HEADING_CUTOFF_HZ)


def relative_to_trajectory(clip: Clip, positions: np.ndarray, angles: np.ndarray) -> Clip:
    """The motion as seen from something that stands at ``positions`` and has turned by ``angles``."""
    turn = about_z(angles)
    rotations = clip.rotations.copy()
    rotations[:, 0] = np.swapaxes(turn, 1, 2) @ rotations[:, 0]
    return Clip(clip.times, rotations, np.einsum("tji,tj->ti", turn, clip.root - positions))


def with_trajectory(clip: Clip, positions: np.ndarray, angles: np.ndarray) -> Clip:
    """The inverse of ``relative_to_trajectory``."""
    turn = about_z(angles)
    rotations = clip.rotations.copy()
    rotations[:, 0] = turn @ rotations[:, 0]
    return Clip(clip.times, rotations, np.einsum("tij,tj->ti", turn, clip.root) + positions)


def about_z(angles: np.ndarray) -> np.ndarray:
    """(T, 3, 3) turns about the upright axis by angles (T,)."""
    c, s = np.cos(angles), np.sin(angles)
    zero, one = np.zeros_like(c), np.ones_like(c)
    return np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1).reshape(-1, 3, 3)
