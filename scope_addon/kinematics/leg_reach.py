# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving the feet of a body by bending or stretching its legs, while the rest of it and the feet's
rotations stay; and its hands by its arms in the same way.

The knee turns by θ about n, then the whole leg turns so that the ankle lies in the direction of its
goal. With thigh u, shin s and the wanted distance d from hip to ankle, θ follows from

    2 u·exp(nθ)s = d² − u² − s²,
    u·exp(nθ)s = (u·n)(s·n) + cos θ (u·s − (u·n)(s·n)) + sin θ u·(n×s).

A nearly straight knee hardly determines its plane, so n is the sum of the knee's present axis
u×s/(|u||s|) and of the thigh's sideways axis times `HINGE`: straight knees bend forwards, bent ones
in their plane. Of an arm, the axis about which the elbow of a hanging arm brings the hand forwards
takes its place.
"""

from __future__ import annotations

import numpy as np

from ...solver.body import Body
from ...solver.rotations import exp, shortest_turn
from ..arrays import Float64Array, FloatArray, unit_vectors

HINGE = 0.3  # Sine of the least angle at which a knee bends mainly in its own plane.
# Share of the stretched leg's length. Beyond it a knee snaps, unless the leg is longer already.
LONGEST = 0.995
SHORTEST = 0.35  # Share of the stretched leg's length: a knee bent by 140 degrees.


# Of a limb's two bones and its end: the joints, and the axis of the upper bone's part about which
# the limb bends, on the left and on the right.
Limbs = tuple[tuple[str, str, str], tuple[Float64Array, Float64Array]]
LEGS: Limbs = ("hip", "knee", "ankle"), (np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]))
ARMS: Limbs = (
    ("shoulder", "elbow", "wrist"),
    (np.array([0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0])),
)


def move_ends(
    body: Body,
    limbs: Limbs,
    rotations: FloatArray,
    poses: tuple[FloatArray, FloatArray],
    shift: FloatArray,
) -> Float64Array:
    """Return the rotations (T, K+1, 3, 3) that move both ankles or wrists as far as legs or arms
    reach.

    :param limbs: `LEGS` or `ARMS`.
    :param rotations: (T, K+1, 3, 3) the root's, and the others relative to their parents.
    :param poses: (T, K+1, 3, 3) and (T, K+1, 3) part poses of this motion, in any frame.
    :param shift: (T, 2, 3) of the left and the right ankle or wrist, in that frame, metres.
    """
    joints, hinges = limbs
    R, t = poses
    out = np.array(rotations, float)
    for side, name in enumerate(("left", "right")):
        hip, knee, ankle = (body.joint_names.index(f"{name}_{part}") for part in joints)
        moved = np.flatnonzero(np.linalg.norm(shift[:, side], axis=1) > 1e-6)
        if not len(moved):
            continue
        upper = t[moved, knee] - t[moved, hip]
        lower = t[moved, ankle] - t[moved, knee]
        goal = upper + lower + shift[moved, side]
        length = np.linalg.norm(upper, axis=1) + np.linalg.norm(lower, axis=1)
        now = np.linalg.norm(upper + lower, axis=1)
        wanted = np.linalg.norm(goal, axis=1)
        shortest = np.minimum(now, SHORTEST * length)
        longest = np.maximum(now, LONGEST * length)
        sideways = R[moved, hip] @ hinges[side]
        bend = knee_turn(upper, lower, sideways, np.clip(wanted, shortest, longest))
        reached = upper + np.einsum("tij,tj->ti", bend, lower)
        swing = shortest_turn(reached, goal)
        thigh = swing @ R[moved, hip]
        shin = swing @ bend @ R[moved, knee]
        parent = R[moved, body.parents[hip]]
        out[moved, hip] = np.swapaxes(parent, 1, 2) @ thigh
        out[moved, knee] = np.swapaxes(thigh, 1, 2) @ shin
        out[moved, ankle] = np.swapaxes(shin, 1, 2) @ R[moved, ankle]
    return out


def knee_turn(
    upper: FloatArray,
    lower: FloatArray,
    sideways: FloatArray,
    wanted: FloatArray,
) -> Float64Array:
    """Return the turns (n, 3, 3) of the shin about the knee that bring the ankle to a distance.

    A knee that is bent against ``sideways`` comes to the other side. What lies beyond the turn's
    reach is approached as far as possible.

    :param upper, lower: (n, 3) from hip to knee, and from knee to ankle, metres.
    :param sideways: (n, 3) the thigh's unit axis about which a knee bends.
    :param wanted: (n,) distance between hip and ankle, metres.
    """
    a = np.linalg.norm(upper, axis=1)
    b = np.linalg.norm(lower, axis=1)
    axis = unit_vectors(cross(upper, lower) / (a * b)[:, None] + HINGE * sideways)
    along_u = (upper * axis).sum(1)
    along_l = (lower * axis).sum(1)
    fixed = along_u * along_l
    cosine = (upper * lower).sum(1) - fixed
    sine = (upper * cross(axis, lower)).sum(1)
    size = np.maximum(np.hypot(cosine, sine), 1e-12)
    target = np.clip((0.5 * (wanted**2 - a**2 - b**2) - fixed) / size, -1.0, 1.0)
    angle = np.arctan2(sine, cosine) + np.arccos(target)
    return exp(axis * angle[:, None])


def cross(a: FloatArray, b: FloatArray) -> Float64Array:
    """Return a × b (n, 3), for a single frame in a third of the time that numpy takes.

    :param a, b: (n, 3).
    """
    (ax, ay, az) = a.T
    (bx, by, bz) = b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)
