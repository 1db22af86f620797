# SPDX-License-Identifier: GPL-3.0-or-later
"""One person's motion as keys, its interpolation between keys, and its root motion: the trajectory
of the root on the floor and its heading, separated from the rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ...solver.rotations import exp
from ..arrays import BoolArray, Float64Array, FloatArray, IndexArray
from ..errors import UsageError
from ..kinematics.axes import R_WORLD_MODEL, rotated, transposed
from ..kinematics.contact_points import SOLES, contact_point_positions, with_contact_points
from ..kinematics.smoothing import (
    gaussian_smooth,
    interpolate_rotations,
    interpolated_places,
    smooth_rotations,
)
from ..motion import Motion
from ..scene_gaps import usual_step_s

_HEADING_CUTOFF_HZ = 1.0  # Low enough to remove the rotation of the hips with each step.


@dataclass
class Clip:
    """T keys of a body with K+1 parts, in the world frame (z up, metres)."""

    times: Float64Array  # (T,) seconds, increasing
    rotations: Float64Array  # (T, K+1, 3, 3): R_world_root, then the joint states Omega_i
    root: Float64Array  # (T, 3) position of the pelvis, metres

    def __len__(self) -> int:
        return len(self.times)

    def copy(self) -> Clip:
        """Return a clip whose rotations and root can be changed without changing this one's."""
        return Clip(self.times, self.rotations.copy(), self.root.copy())

    def rows(self, which: NDArray[Any] | slice) -> Clip:
        """Return some of the keys, by their indices, a mask (T,) or a slice."""
        return Clip(self.times[which], self.rotations[which], self.root[which])

    def parts(self, body: Body, betas: FloatArray) -> tuple[Float64Array, Float64Array]:
        """Return the orientations (T, K+1, 3, 3) and origins (T, K+1, 3) of the body's parts,
        metres, world frame; a part's origin is its joint.

        :param betas: (P,) shape coefficients.
        """
        pelvis_at_rest = body.rest_joints(betas)[0]
        return body.forward_kinematics(self.rotations, self.root - pelvis_at_rest, betas)

    def joints(self, body: Body, betas: FloatArray) -> Float64Array:
        """Return the joints (T, K+1, 3), as of `parts`."""
        return self.parts(body, betas)[1]

    def soles(self, body: Body, betas: FloatArray) -> Float64Array:
        """Return the contact points of the feet.

        :param betas: (P,) shape coefficients.
        :return: (T, 4, 3) left heel, left toe, right heel, right toe on the sole, metres, world
            frame.
        """
        points = contact_point_positions(with_contact_points(body, betas), *self.parts(body, betas))
        return points[:, : len(SOLES)]


def clip_from_motion(body: Body, motion: Motion, raw: bool) -> Clip:
    """Convert a motion to keys: the finished one, or the one before smoothing (``raw``)."""
    poses, trans = (motion.poses_raw, motion.trans_raw) if raw else (motion.poses, motion.trans)
    rotations = exp(poses.reshape(len(motion), -1, 3).astype(float))
    return Clip(motion.timestamps, rotations, body.rest_joints(motion.betas)[0] + trans)


def differ(a: Clip, b: Clip) -> BoolArray:
    """Return at which keys (T,) two clips differ."""
    turned = (a.rotations != b.rotations).any((1, 2, 3))
    return turned | (a.root != b.root).any(1)


def keys_within(clip: Clip, start: float, end: float) -> IndexArray:
    """Return the indices of the keys from ``start`` to ``end`` seconds, both inclusive.

    :raises UsageError: when there is none.
    """
    found = np.flatnonzero((clip.times >= start - 1e-6) & (clip.times <= end + 1e-6))
    if not len(found):
        raise UsageError(
            "there are no keys in the chosen frames; choose frames within the captured motion"
        )
    return found


def sample(clip: Clip, times: Float64Array) -> Clip:
    """Interpolate the motion at other times: rotations along the shorter arc, positions linearly.

    :param times: (T',) seconds; clamped to the first and the last key.
    :return: a clip of T' keys.
    """
    times = np.clip(times, clip.times[0], clip.times[-1])
    found = np.searchsorted(clip.times, times, side="right")
    before = np.clip(found - 1, 0, max(len(clip) - 2, 0))
    after = np.minimum(before + 1, len(clip) - 1)
    length = clip.times[after] - clip.times[before]  # 0 for a single key
    share = (times - clip.times[before]) / np.maximum(length, 1e-12)
    rotations = interpolate_rotations(clip.rotations[before], clip.rotations[after], share[:, None])
    root = interpolated_places(clip.root, clip.times, times)
    return Clip(times.astype(float), rotations, root)


def resample(clip: Clip, rate: float) -> Clip:
    """Resample to a constant rate, from the first key on, with a low-pass filter against aliasing.

    :param rate: keys per second.
    :raises UsageError: when the rate is not positive.
    """
    if not np.isfinite(rate) or rate <= 0:
        raise UsageError(
            f"a motion cannot be baked to {rate} frames per second; choose a rate above zero"
        )
    count = int(np.floor((clip.times[-1] - clip.times[0]) * rate + 1e-6)) + 1
    times = clip.times[0] + np.arange(count) / rate
    return sample(band_limited(clip, rate), times)


def band_limited(clip: Clip, rate: float) -> Clip:
    """Low-pass filter the rotations for sampling at ``rate`` keys per second, where the clip has
    many more keys.

    Without the filter, oscillations faster than the new rate would alias into slow motion.
    """
    step = usual_step_s(clip.times, alone=1.0 / rate)
    if 1.0 / rate <= 1.5 * step:
        return clip
    return Clip(clip.times, smooth_rotations(clip.rotations, clip.times, 0.45 * rate), clip.root)


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
