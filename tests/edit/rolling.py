# SPDX-License-Identifier: GPL-3.0-or-later
"""A synthetic walk whose feet roll from heel to ball; each is at rest on the floor while it is in
contact.
"""

from functools import cache

import numpy as np
from scope.scope_addon.edit.clip import Clip
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL
from scope.solver.rotations import exp, shortest_turn

from .walking import BODY, NAMES, RATE

ZERO = np.zeros(BODY.P)
J = BODY.rest_joints(ZERO) @ R_WORLD_MODEL.T
V = BODY.rest_vertices(ZERO) @ R_WORLD_MODEL.T
FLOOR = V[:, 2].min()
PERIOD = 1.2
STANCE = 0.62
STRIDE = 1.0
# shares of the stance at which the sole is flat, and at which the heel lifts
FLAT = 0.2
RISE = 0.55


def joint(part):
    return J[NAMES.index(part)]


@cache
def heel_of(side):
    """Return the heel on the floor, a centimetre in front of the rear end of the sole."""
    ankle = joint(f"{side}_ankle")
    own = V[(np.sign(V[:, 0]) == np.sign(ankle[0])) & (V[:, 2] < FLOOR + 0.01)]
    return np.array([ankle[0], own[:, 1].max() - 0.01, FLOOR])


def pitch(degrees):
    """Return the rotation that pitches the toes of a person facing −y down by ``degrees``."""
    return exp(np.array([np.radians(degrees), 0, 0]))


def foot(side, step):
    """Return ankle, rotations of foot and toes, contact of heel and of ball, at a time in steps of
    this foot.
    """
    number = np.floor(step)
    phase = step % 1 / STANCE
    place = joint(f"{side}_ankle") + [0, -STRIDE * number, -FLOOR]
    heel = heel_of(side) - joint(f"{side}_ankle")
    ball = joint(f"{side}_foot") - joint(f"{side}_ankle")
    if phase < FLAT:
        turn = pitch(-22 * (1 - phase / FLAT) ** 2)
        return place + heel - turn @ heel, turn, turn, True, False
    if phase < RISE:
        return place, np.eye(3), np.eye(3), True, True
    if phase < 1:
        turn = pitch(45 * ((phase - RISE) / (1 - RISE)) ** 2)
        return place + ball - turn @ ball, turn, np.eye(3), False, True
    share = (step % 1 - STANCE) / (1 - STANCE)
    ease = share * share * (3 - 2 * share)
    off = pitch(45)
    on = pitch(-22)
    first = place + ball - off @ ball
    last = place + [0, -STRIDE, 0] + heel - on @ heel
    ankle = first + ease * (last - first) + [0, 0, 0.09 * np.sin(np.pi * share)]
    turn = pitch(45 - 67 * ease)
    return ankle, turn, pitch(-22 * ease), False, False


def rolling_walk(seconds=2.6, stiff_toes=False):
    """Return the clip, and per side the contact of heel and ball: (T, 2) bool.

    :param stiff_toes: keep the toes from bending, as in a capture without toe keypoints.
    """
    times = np.arange(int(seconds * RATE) + 1) / RATE
    rotations = np.tile(np.eye(3), (len(times), len(NAMES), 1, 1))
    root = np.empty((len(times), 3))
    stands = {"left": np.zeros((len(times), 2), bool), "right": np.zeros((len(times), 2), bool)}
    for t, time in enumerate(times):
        D = {name: np.eye(3) for name in NAMES}
        D["left_shoulder"], D["right_shoulder"] = (
            exp(np.array([0, sign * 1.2, 0])) for sign in (1, -1)
        )
        for side in ("left", "right"):
            for part in ("elbow", "wrist", "hand"):
                D[f"{side}_{part}"] = D[f"{side}_shoulder"]
        height = -FLOOR - 0.07 + 0.015 * np.cos(4 * np.pi * time / PERIOD)
        root[t] = J[0] + [0, -STRIDE * (time / PERIOD - 0.5 * STANCE + 0.04), height]
        for side, begin in (("left", 0.0), ("right", 0.5)):
            ankle, D[f"{side}_ankle"], D[f"{side}_foot"], *stands[side][t] = foot(
                side, time / PERIOD + begin
            )
            if stiff_toes:
                D[f"{side}_foot"] = D[f"{side}_ankle"]
            ankle = ankle + [0, STRIDE * begin, 0]
            hip = root[t] + joint(f"{side}_hip") - J[0]
            upper = joint(f"{side}_knee") - joint(f"{side}_hip")
            lower = joint(f"{side}_ankle") - joint(f"{side}_knee")
            a = np.linalg.norm(upper)
            b = np.linalg.norm(lower)
            leg = ankle - hip
            c = np.linalg.norm(leg)
            assert c < a + b, "the walk's legs are too short"
            along = (a * a - b * b + c * c) / (2 * c)
            front = np.cross(np.cross(leg, [0, -1, 0]), leg)
            knee = leg / c * along + front / np.linalg.norm(front) * np.sqrt(a * a - along * along)
            thigh = shortest_turn(upper, knee)
            D[f"{side}_hip"] = thigh
            D[f"{side}_knee"] = shortest_turn(thigh @ lower, leg - knee) @ thigh
        for i, name in enumerate(NAMES):
            parent = BODY.parents[i]
            R = D[name] if parent < 0 else D[NAMES[parent]].T @ D[name]
            rotations[t, i] = (
                R @ R_WORLD_MODEL if parent < 0 else R_WORLD_MODEL.T @ R @ R_WORLD_MODEL
            )
    return Clip(times, rotations, root), stands
