# SPDX-License-Identifier: GPL-3.0-or-later
"""The motion of one person as its keys hold it, and how rotations are taken between two keys."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...solver.body import Body
from ...solver.rotations import exp, log
from ..errors import UsageError
from ..kinematics.contact_points import SOLES, contact_point_positions, with_contact_points
from ..kinematics.smoothing import smooth_rotations


@dataclass
class Clip:
    """T keys of a body with K+1 parts, in the world frame (z up, metres)."""

    times: np.ndarray  # (T,) seconds, increasing
    rotations: np.ndarray  # (T, K+1, 3, 3): R_world_root, then the joints' states Omega_i
    root: np.ndarray  # (T, 3) the pelvis

    def __len__(self) -> int:
        return len(self.times)

    def soles(self, body: Body, betas: np.ndarray) -> np.ndarray:
        """(T, 4, 3) left heel, left toe, right heel, right toe on the floor's side of the foot, world frame."""
        R, t = body.forward_kinematics(self.rotations, self.root - body.rest_joints(betas)[0], betas)
        return contact_point_positions(with_contact_points(body, betas), R, t)[:, : len(SOLES)]

    def joints(self, body: Body, betas: np.ndarray) -> np.ndarray:
        """(T, K+1, 3) joints, world frame."""
        return body.forward_kinematics(self.rotations, self.root - body.rest_joints(betas)[0], betas)[1]


def inside(clip: Clip, start: float, end: float) -> np.ndarray:
    """Indices of the keys from ``start`` to ``end`` seconds, both included.

    :raises UsageError: there is none.
    """
    found = np.flatnonzero((clip.times >= start - 1e-6) & (clip.times <= end + 1e-6))
    if not len(found):
        raise UsageError("there are no keys in the chosen frames; choose frames within the captured motion")
    return found


def between(a: np.ndarray, b: np.ndarray, share: np.ndarray | float) -> np.ndarray:
    """Rotations (..., 3, 3) a share of the way from a to b, along the shorter arc: a exp(share log(aᵀ b))."""
    turn = log(np.swapaxes(a, -1, -2) @ b)
    return a @ exp(np.asarray(share)[..., None] * turn)


def sample(clip: Clip, times: np.ndarray) -> Clip:
    """The motion at other times (T',), between the first and the last key; rotations along the shorter arc."""
    times = np.clip(times, clip.times[0], clip.times[-1])
    after = np.clip(np.searchsorted(clip.times, times, side="right"), 1, max(len(clip) - 1, 1))
    before = after - 1
    if len(clip) == 1:
        after = before = np.zeros(len(times), int)
    length = clip.times[after] - clip.times[before]
    share = np.where(length > 0, (times - clip.times[before]) / np.where(length > 0, length, 1.0), 0.0)
    rotations = between(clip.rotations[before], clip.rotations[after], share[:, None])
    root = clip.root[before] + share[:, None] * (clip.root[after] - clip.root[before])
    return Clip(times.astype(float), rotations, root)


def resample(clip: Clip, rate: float) -> Clip:
    """A key at every 1/rate seconds from the first key on. Detail that the new rate cannot show is smoothed away first.

    :raises UsageError: the rate is not positive.
    """
    if not np.isfinite(rate) or rate <= 0:
        raise UsageError(f"a motion cannot be baked to {rate} frames a second; choose a rate above zero")
    count = int(np.floor((clip.times[-1] - clip.times[0]) * rate + 1e-6)) + 1
    times = clip.times[0] + np.arange(count) / rate
    return sample(band_limited(clip, rate), times)


def band_limited(clip: Clip, rate: float) -> Clip:
    """The clip without rotations faster than ``rate`` keys a second can show, where it has many more keys than that.

    Else what swings between two new keys would show as slow motion.
    """
    step = np.median(np.diff(clip.times)) if len(clip) > 1 else 1.0 / rate
    if 1.0 / rate <= 1.5 * step:
        return clip
    return Clip(clip.times, smooth_rotations(clip.rotations, clip.times, 0.45 * rate), clip.root)
