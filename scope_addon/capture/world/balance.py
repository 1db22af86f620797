# SPDX-License-Identifier: GPL-3.0-or-later
"""Weight presses on what stands: how far a body must be turned for that, along the line of sight.

How a body leans towards the camera or away is hardly seen in the picture. With c the centre of mass, h its height above
the soles and palms p_i that stand, g gravity and s the level part of the line of sight, weight and inertia press on the
floor at

    x = s·(c − c̈ h / g),   min_i s·p_i ≤ x ≤ max_i s·p_i.

What sticks out is taken back by turning the whole body about the middle of these. The faster somebody moves, the less
is believed of this: there, c̈ is not known well enough. Nor is it of those who may sit or kneel, see `carrying`.

Sources: Vukobratović and Borovac 2004 (zero moment point); masses of body parts and their centres by Winter 2009.
"""

from __future__ import annotations

import numpy as np

from ....solver.body import Body
from ....solver.rotations import exp
from ...kinematics.contact_points import SOLES
from ...kinematics.smoothing import gaussian_smooth
from .placement import PlacedTrack

STANDING_M_S = 0.5  # speed of the centre of mass at which little is believed of this
CUTOFF_HZ = 1.0
# How far a sole extends behind its heel point and beyond its toe point, in units of the distance between the two.
BEHIND, BEYOND = 1.2, 0.4
DOUBT = 0.2  # share of standing frames nearby that halves what is believed, roughly
GRAVITY_M_S2 = 9.81
LARGEST_TURN = np.radians(10.0)
# Part of the mass, from joint, to joint, share of the way at which its centre lies.
_LIMBS = (
    (0.028, "shoulder", "elbow", 0.436),
    (0.022, "elbow", "wrist", 0.68),  # with the hand
    (0.100, "hip", "knee", 0.433),
    (0.0465, "knee", "ankle", 0.433),
    (0.0145, "ankle", "foot", 0.5),
)
_HEAD, _TRUNK = 0.081, 0.497
RESTING_KNEE_COS, CARRYING_KNEE_COS = np.cos(np.radians([75.0, 60.0]))  # bent more, less than that


def center_of_mass(body: Body, joints: np.ndarray) -> np.ndarray:
    """(T, 3) of a body whose joints are at (T, K+1, 3)."""
    at = {name: i for i, name in enumerate(body.joint_names)}
    trunk = [at[f"{side}_{name}"] for side in ("left", "right") for name in ("hip", "shoulder")]
    total = _HEAD * joints[:, at["head"]] + _TRUNK * joints[:, trunk].mean(axis=1)
    for mass, start, end, share in _LIMBS:
        for side in ("left", "right"):
            a, b = joints[:, at[f"{side}_{start}"]], joints[:, at[f"{side}_{end}"]]
            total = total + mass * ((1 - share) * a + share * b)
    return total / (_HEAD + _TRUNK + 2 * sum(mass for mass, *_ in _LIMBS))


def carrying(body: Body, joints: np.ndarray) -> np.ndarray:
    """(T,) how far a leg is straight enough to bear the weight, which may rest on a chair or the shins otherwise."""
    straight = np.max([(shank * thigh).sum(1) for shank, thigh in legs(body, joints)], axis=0)
    return np.clip((straight - RESTING_KNEE_COS) / (CARRYING_KNEE_COS - RESTING_KNEE_COS), 0.0, 1.0)


def legs(body: Body, joints: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Of the left leg and the right one, shank and thigh, (T, 3) unit vectors upwards."""
    return [
        (along(body, joints, f"{side}_ankle", f"{side}_knee"), along(body, joints, f"{side}_knee", f"{side}_hip"))
        for side in ("left", "right")
    ]


def along(body: Body, joints: np.ndarray, a: str, b: str) -> np.ndarray:
    """(T, 3) unit vectors from joint a to joint b."""
    d = joints[:, body.joint_names.index(b)] - joints[:, body.joint_names.index(a)]
    return d / np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-9)


def balancing_rotations(placed: PlacedTrack, contact: np.ndarray, up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """By which rotations (T, 3, 3), about which points (T, 3), the weight comes over the feet; the camera's axes.

    :param contact: (T, 6) probability that each sole and palm rests on the floor;  up: (3,) unit.
    """
    times = placed.times
    mass = gaussian_smooth(center_of_mass(placed.body, placed.joints), times, CUTOFF_HZ)
    pivot = placed.contact_center(contact)
    sight = mass - placed.center
    sight = sight - (sight @ up)[:, None] * up
    sight /= np.maximum(np.linalg.norm(sight, axis=1, keepdims=True), 1e-9)
    height = np.maximum((mass - pivot) @ up, 0.3)
    stands = contact > 0.5
    believed = stands.any(axis=1) * carrying(placed.body, placed.joints)
    pressing = mass
    if len(times) > 2:
        velocity = np.gradient(mass, times, axis=0)
        believed *= np.exp(-np.square(np.linalg.norm(velocity, axis=1) / STANDING_M_S))
        pressing = mass - np.gradient(velocity, times, axis=0) * (height / GRAVITY_M_S2)[:, None]
    at, reach = (pressing * sight).sum(axis=1), (_reaches(placed.contact_points) * sight[:, None]).sum(axis=-1)
    somewhere = stands.any(axis=1)
    low = np.where(somewhere, np.where(stands, reach, np.inf).min(axis=1), -np.inf)
    high = np.where(somewhere, np.where(stands, reach, -np.inf).max(axis=1), np.inf)
    out = np.maximum(at - high, 0) - np.maximum(low - at, 0)
    angle = gaussian_smooth(-believed * np.arctan2(out, height), times, CUTOFF_HZ)
    angle /= gaussian_smooth(believed, times, CUTOFF_HZ) + DOUBT
    angle = np.clip(angle, -LARGEST_TURN, LARGEST_TURN)
    return exp(angle[:, None] * np.cross(up, sight)), pivot


def _reaches(contact_points: np.ndarray) -> np.ndarray:
    """(T, 6, 3) the ends of the soles, whose heel and toe points come first, in the same order, and the palms."""
    soles, palms = np.split(contact_points, [len(SOLES)], axis=1)
    heel, toe = soles[:, 0::2], soles[:, 1::2]
    ends = np.stack([heel - BEHIND * (toe - heel), toe + BEYOND * (toe - heel)], axis=2).reshape(soles.shape)
    return np.concatenate([ends, palms], axis=1)
