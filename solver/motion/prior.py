# SPDX-License-Identifier: Apache-2.0
"""What is expected of any motion: little acceleration, and points that stand still while they
stand.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import as_array, has_axis
from ..part import Array
from ..validation import (
    as_finite,
    as_indices,
    as_number,
    check_finite,
    check_not_negative,
    check_robust,
    check_weight,
)


@dataclass(frozen=True)
class MotionPrior:
    """Weights of acceleration and of a standing point's velocity, per second of the clip.

    The cost is 1/2 integral of w rho(|a|^2) dt, and for standing points of w p |v|^2 dt with p
    their probability, so that a weight means the same at any frame rate.

    joints: weight of each joint's angular acceleration relative to its parent, (K,) or one for all,
    s^3/rad^2; root_rotation: of the root's in the world, s^3/rad^2; root_position: of its origin,
    s^3/m^2. robust_joints, robust_root_rotation: Geman-McClure sigma of squared accelerations,
    (rad/s^2)^2, of joints (K,) or one for all; robust_root_position: (m/s^2)^2. Infinity turns the
    kernel off. contact: weight of standing points, s/m^2.

    The defaults are how recorded people accelerate, and suit errors that are independent from frame
    to frame. A network's are not: more frames say less than their number, and weights of 1, 1 and
    30 times (rate / 60 Hz)^2 were found better for its keypoints.

    pose_memory: tau, seconds in which poses become unlike. The density of joints in `Priors` is
    that of one pose, and neighbouring frames show nearly the same one. A stationary process of
    correlation exp(-h / tau) after h seconds tells of its mean what
        1 + sum over intervals of tanh(h / (2 tau))
    independent samples do; so often do the priors of the joints count in a clip, whatever its frame
    rate. 0: once a frame.
    """

    joints: ArrayLike = 0.03
    root_rotation: float = 0.1
    root_position: float = 1.0
    robust_joints: ArrayLike = 4e4
    robust_root_rotation: float = 4e4
    robust_root_position: float = 1600.0
    contact: float = 3e3
    pose_memory: float = 0.2

    def __post_init__(self) -> None:
        """Check the values.

        :raises InvalidValueError: a weight or the memory is negative or infinite, or a sigma is not
            positive.
        """
        for name in ("root_rotation", "root_position", "contact", "pose_memory"):
            check_weight(getattr(self, name), f"MotionPrior.{name}")
        for name in ("robust_root_rotation", "robust_root_position"):
            check_robust(getattr(self, name), f"MotionPrior.{name}")

    def pose_share(self, times: Array) -> float:
        """Return how much the priors of the joints count in each frame of a clip, 1 for one frame.

        :param times: (T,) seconds, increasing.
        """
        if self.pose_memory == 0.0:
            return 1.0
        new = np.tanh(np.diff(times) / (2.0 * self.pose_memory))
        return float((1.0 + new.sum()) / len(times))

    def packed(self, K: int) -> Array:
        """Return (K+2, 2) weights and 1/sigma: the root's rotation, joints 1..K, the root's
        position.

        :raises ShapeError: `joints` or `robust_joints` is neither one number nor (K,).
        :raises InvalidValueError: a weight of `joints` is negative or not finite, or a sigma is not
            positive.
        """
        joints = _each(self.joints, K, "MotionPrior.joints")
        check_finite(joints, "MotionPrior.joints")
        check_not_negative(joints, "MotionPrior.joints")
        table = np.empty((K + 2, 2))
        table[0] = self.root_rotation, 1.0 / float(self.robust_root_rotation)
        sigmas = _each(self.robust_joints, K, "MotionPrior.robust_joints")
        for sigma in sigmas:
            check_robust(sigma, "MotionPrior.robust_joints")
        table[1:-1, 0] = joints
        table[1:-1, 1] = 1.0 / sigmas
        table[-1] = self.root_position, 1.0 / float(self.robust_root_position)
        return table


def _each(values: ArrayLike, K: int, name: str) -> Array:
    """Return one number for each joint (K,)."""
    if has_axis(values):
        return as_array(values, (K,), name)
    return np.full(K, as_number(values, name))


@dataclass
class StandingPoints:
    """Points that may stand still: indices (C,), numbered as in the measurements, and the
    probability (T, C) that each does in each frame. Between two frames a point stands with the
    smaller of their probabilities.
    """

    indices: ArrayLike = field(default_factory=lambda: np.zeros(0, np.int64))
    probability: ArrayLike = field(default_factory=lambda: np.zeros((0, 0)))

    def packed(self, points: int, frames: int) -> tuple[Array, Array]:
        """Return indices (C,) and (T, C) probability of standing since the frame before, 0 for the
        first.

        :raises ShapeError: an array has another shape, or an index lies outside.
        :raises InvalidValueError: a probability is negative or not finite.
        """
        indices = as_indices(self.indices, points, "Indices of standing points")
        if len(indices) == 0:
            return indices, np.zeros((frames, 0))
        p = as_finite(self.probability, (frames, len(indices)), "Probability of standing points")
        check_not_negative(p.ravel(), "Probability of standing points")
        both = np.zeros((frames, len(indices)))
        both[1:] = np.minimum(p[1:], p[:-1])
        return indices, both
