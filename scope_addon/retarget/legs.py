# SPDX-License-Identifier: GPL-3.0-or-later
"""Legs that put the ankle where it belongs: the two-bone problem in closed form, all frames at once."""

from __future__ import annotations

import numpy as np

from ...solver.rotations import exp, shortest_turn

_STRAIGHT = 0.9999  # share of the leg's length that it may be stretched to: beyond it the knee would snap


def reach(world: np.ndarray, heads: np.ndarray, leg: tuple[int, int, int], goal: np.ndarray) -> None:
    """Turn thigh and shin so that the ankle comes to ``goal`` (T, 3), in place; the knee stays in its plane.

    The law of cosines gives the knee; the leg is then swung so that the ankle's direction is the goal's. Out of reach
    the leg points to the goal, stretched.

    :param world: (T, B, 3, 3) bones to world; heads: (T, B, 3); leg: rows of thigh, shin and foot.
    """
    thigh, shin, foot = leg
    hip, knee, ankle = heads[:, thigh], heads[:, shin], heads[:, foot]
    upper, lower = knee - hip, ankle - knee
    a, b = np.linalg.norm(upper, axis=1), np.linalg.norm(lower, axis=1)
    distance = np.clip(np.linalg.norm(goal - hip, axis=1), np.abs(a - b) + 1e-6, _STRAIGHT * (a + b))
    normal = np.cross(upper, lower)
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    # A straight leg has no plane: it bends about its own sideways axis, the knee going forward.
    front = np.cross(world[:, thigh, :, 0], upper)
    side = np.cross(upper, front)
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
    normal = np.where(size > 1e-4 * (a * b)[:, None], normal / np.maximum(size, 1e-12), side)
    bend = np.arccos(np.clip((np.sum(upper * lower, axis=1)) / (a * b), -1, 1))
    wanted = np.arccos(np.clip((distance**2 - a**2 - b**2) / (2 * a * b), -1, 1))
    at_knee = exp(normal * (wanted - bend)[:, None])
    reached = upper + np.einsum("tij,tj->ti", at_knee, lower)
    swing = shortest_turn(reached, goal - hip)
    world[:, thigh] = swing @ world[:, thigh]
    world[:, shin] = swing @ at_knee @ world[:, shin]
