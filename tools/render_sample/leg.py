# SPDX-License-Identifier: GPL-3.0-or-later
"""Two-bone inverse kinematics of a leg in closed form: planted feet stay where they are,
exactly.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...solver.rotations import exp

X = np.array([1.0, 0.0, 0.0])


def solve_leg(
    R_world_root: NDArray[np.float64],
    hip: NDArray[np.float64],
    ankle: NDArray[np.float64],
    thigh: NDArray[np.float64],
    shank: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the hip and knee rotations that bring the ankle to its target.

    The knee is a hinge about the model's x axis, bent by θ ≥ 0 so that |thigh + Rx(θ) shank| is the
    distance from hip to ankle. The hip then turns that vector onto the target, with the hinge as
    near to the root's x axis as possible.

    :param R_world_root: (3, 3); hip, ankle: (3,) world, metres.
    :param thigh, shank: (3,) bone vectors at rest, model frame.
    :return: Ω_hip, Ω_knee (3, 3), relative to the parent.
    :raises ValueError: when the ankle is farther away than the leg is long.
    """
    target = R_world_root.T @ (ankle - hip)
    # With y and z across the hinge: |thigh + Rx(θ) shank|² = a + b cos θ + c sin θ.
    a = thigh @ thigh + shank @ shank + 2 * thigh[0] * shank[0]
    b = 2 * (thigh[1] * shank[1] + thigh[2] * shank[2])
    c = 2 * (thigh[2] * shank[1] - thigh[1] * shank[2])
    cosine = (target @ target - a) / np.hypot(b, c)
    if abs(cosine) > 1:
        raise ValueError(
            f"the ankle is {np.linalg.norm(target):.3f} m from the hip: out of the leg's reach"
        )
    bend = np.arctan2(c, b) + np.arccos(cosine)
    R_knee = exp(bend * X)
    R_hip = _frame(target) @ _frame(thigh + R_knee @ shank).T
    return R_hip, R_knee


def _frame(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation whose first column is the direction and whose second is as near to x as
    possible.
    """
    first = direction / np.linalg.norm(direction)
    second = X - first * first[0]
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)], axis=1)
