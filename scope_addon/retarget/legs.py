# SPDX-License-Identifier: GPL-3.0-or-later
"""Two-bone inverse kinematics of a leg in closed form, for all frames at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...solver.rotations import exp, shortest_turn
from ..kinematics.leg_reach import cross, knee_turn

_MAX_STRETCH = 0.9999  # Share of the leg's length beyond which the knee would snap.


def solve_leg(
    thigh: NDArray[np.float64],
    shin: NDArray[np.float64],
    joints: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    goal: NDArray[np.float64],
    sideways: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotate thigh and shin so that the ankle reaches the goal; a bent knee stays in its plane.

    The knee first turns about the axis of `leg_reach`, which leads a nearly straight or
    overstretched one forwards. If that axis is not perpendicular to the leg, a part of the distance
    may remain; the law of cosines corrects it. Then the leg is rotated so that the ankle is in the
    direction of the goal. If the goal is out of reach, the leg points to it, stretched.

    :param thigh: (T, 3, 3) bone to world.
    :param shin: (T, 3, 3) bone to world.
    :param joints: hip, knee and ankle, each (T, 3), metres, world frame.
    :param goal: (T, 3) target of the ankle, metres, world frame.
    :param sideways: (T, 3) the unit axis about which the shin bends backwards, world frame.
    :return: the new rotations of thigh and shin.
    """
    hip, knee, ankle = joints
    upper = knee - hip
    lower = ankle - knee
    a = np.linalg.norm(upper, axis=1)
    b = np.linalg.norm(lower, axis=1)
    distance = np.clip(
        np.linalg.norm(goal - hip, axis=1), np.abs(a - b) + 1e-6, _MAX_STRETCH * (a + b)
    )
    at_knee = knee_turn(upper, lower, sideways, distance)
    lower = np.einsum("tij,tj->ti", at_knee, lower)
    normal = cross(upper, lower)
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.where(size > 1e-4 * (a * b)[:, None], normal / np.maximum(size, 1e-12), sideways)
    bend = np.arccos(np.clip((np.sum(upper * lower, axis=1)) / (a * b), -1, 1))
    wanted = np.arccos(np.clip((distance**2 - a**2 - b**2) / (2 * a * b), -1, 1))
    rest = exp(normal * (wanted - bend)[:, None])
    swing = shortest_turn(upper + np.einsum("tij,tj->ti", rest, lower), goal - hip)
    return swing @ thigh, swing @ rest @ at_knee @ shin
