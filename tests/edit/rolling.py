# SPDX-License-Identifier: GPL-3.0-or-later
"""A synthetic walk whose feet roll from heel to ball; each is at rest on the floor while it is in
contact.
"""

from functools import cache

import numpy as np
from scope.scope_addon.edit.clip import Clip
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL
from scope.scope_addon.kinematics.leg_reach import LEGS, move_ends
from scope.solver.rotations import exp

from .walking import ARMS_DOWN, BODY, NAMES, RATE

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


def rolling_walk(seconds=2.6, stiff_toes=False, pelvis_turn=0.0):
    """Return the clip, and per side the contact of heel and ball: (T, 2) bool.

    :param stiff_toes: keep the toes from bending, as in a capture without toe keypoints.
    :param pelvis_turn: degrees by which the pelvis turns to either side with every step.
    """
    times = np.arange(int(seconds * RATE) + 1) / RATE
    height = -FLOOR - 0.07 + 0.015 * np.cos(4 * np.pi * times / PERIOD)
    ahead = -STRIDE * (times / PERIOD - 0.5 * STANCE + 0.04)
    root = J[0] + np.stack([np.zeros(len(times)), ahead, height], axis=1)
    rotations = np.tile(np.eye(3), (len(times), len(NAMES), 1, 1))
    turns = np.radians(pelvis_turn) * np.sin(2 * np.pi * times / PERIOD)
    rotations[:, 0] = exp(turns[:, None] * [0.0, 0.0, 1.0]) @ R_WORLD_MODEL
    for name, vector in ARMS_DOWN.items():
        rotations[:, NAMES.index(name)] = exp(np.array(vector))
    ankles = np.empty((len(times), 2, 3))
    feet = np.empty((len(times), 2, 3, 3))
    toes = np.empty((len(times), 2, 3, 3))
    stands = {}
    for leg, (side, begin) in enumerate((("left", 0.0), ("right", 0.5))):
        stands[side] = np.zeros((len(times), 2), bool)
        for t, time in enumerate(times):
            ankle, feet[t, leg], toes[t, leg], *stands[side][t] = foot(side, time / PERIOD + begin)
            ankles[t, leg] = ankle + [0, STRIDE * begin, 0]
    parts = [[NAMES.index(f"{side}_{part}") for side in stands] for part in ("ankle", "foot")]
    R, joints = Clip(times, rotations, root).parts(BODY, ZERO)
    rotations = move_ends(BODY, LEGS, rotations, (R, joints), ankles - joints[:, parts[0]])
    R, joints = Clip(times, rotations, root).parts(BODY, ZERO)
    np.testing.assert_allclose(joints[:, parts[0]], ankles, atol=1e-6)  # no leg is too short
    shins = R[:, [BODY.parents[ankle] for ankle in parts[0]]]
    feet = feet @ R_WORLD_MODEL
    toes = feet if stiff_toes else toes @ R_WORLD_MODEL
    rotations[:, parts[0]] = np.swapaxes(shins, -1, -2) @ feet
    rotations[:, parts[1]] = np.swapaxes(feet, -1, -2) @ toes
    return Clip(times, rotations, root), stands
