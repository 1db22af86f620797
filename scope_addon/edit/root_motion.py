# SPDX-License-Identifier: GPL-3.0-or-later
"""Root motion: the trajectory of the root on the floor and its heading, separated from the rest of
the motion.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Float64Array
from ..kinematics.axes import R_WORLD_MODEL, rotated, transposed
from ..kinematics.smoothing import gaussian_smooth
from .clip import Clip

_HEADING_CUTOFF_HZ = 1.0  # Low enough to remove the rotation of the hips with each step.


def floor_trajectory(clip: Clip, *, heading: bool = True) -> tuple[Float64Array, Float64Array]:
    """Project the pelvis on the floor.

    :param heading: also return the heading, smoothed; zeros otherwise.
    :return: positions (T, 3), metres, with z = 0; angles (T,) about the vertical, radians,
        unwrapped, zero for the heading of the rest pose.
    """
    positions = clip.root * [1.0, 1.0, 0.0]
    if not heading:
        return positions, np.zeros(len(clip))
    # The model faces +z, so R_world_root maps z to the heading, and R_WORLD_MODEL maps it to that
    # of the rest pose.
    facing = clip.rotations[:, 0] @ [0.0, 0.0, 1.0]
    rest = R_WORLD_MODEL @ [0.0, 0.0, 1.0]
    angle = np.unwrap(np.arctan2(facing[:, 1], facing[:, 0]) - np.arctan2(rest[1], rest[0]))
    return positions, gaussian_smooth(angle, clip.times, _HEADING_CUTOFF_HZ)


def relative_to_trajectory(clip: Clip, positions: Float64Array, angles: Float64Array) -> Clip:
    """Express the motion in the moving frame of a trajectory.

    :param positions: (T, 3) origins of the frame, metres.
    :param angles: (T,) rotations of the frame about the vertical, radians.
    """
    turn = about_z(angles)
    rotations = clip.rotations.copy()
    rotations[:, 0] = transposed(turn) @ rotations[:, 0]
    return Clip(clip.times, rotations, rotated(transposed(turn), clip.root - positions))


def with_trajectory(clip: Clip, positions: Float64Array, angles: Float64Array) -> Clip:
    """Add a trajectory to the motion: the inverse of ``relative_to_trajectory``.

    :param positions: (T, 3) origins of the moving frame, metres.
    :param angles: (T,) rotations of the frame about the vertical, radians.
    """
    turn = about_z(angles)
    rotations = clip.rotations.copy()
    rotations[:, 0] = turn @ rotations[:, 0]
    return Clip(clip.times, rotations, rotated(turn, clip.root) + positions)


def about_z(angles: Float64Array) -> Float64Array:
    """Return rotations (T, 3, 3) about the vertical.

    :param angles: T angles in any shape, radians.
    """
    c = np.cos(angles)
    s = np.sin(angles)
    zero = np.zeros_like(c)
    one = np.ones_like(c)
    rows: Float64Array = np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1)
    return rows.reshape(-1, 3, 3)
