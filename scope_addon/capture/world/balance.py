# SPDX-License-Identifier: GPL-3.0-or-later
"""Balance: rotations of the whole body that bring its zero moment point above its feet.

How far a body leans towards the camera or away from it can hardly be seen in the image. With the
centre of mass c, its height h above the contact points, gravity g and the horizontal direction s of
the line of sight, the zero moment point, in which weight and inertial forces act on the floor, is

    x = s·(c − c̈ h / g).

A standing person keeps it near the middle of a foot, or between the two: x − m is normally
distributed with the deviation σ_m, where m is the value nearest to x in the range of s·p_i over the
middles p_i of the soles in contact, and palms. The lean found in the image is uncertain by σ_l, so
the most probable displacement is

    −(x − m) (σ_l h)² / ((σ_l h)² + σ_m²),

and the whole body is rotated by it about the centre of the contact points. The correction gets
weaker the faster a person moves, since c̈ is then not known well enough. It is not applied to
people who may sit or kneel, see `leg_support`.

Sources: Vukobratović and Borovac 2004 (zero moment point); Winter 2009 (masses of body parts and
their centres; quiet standing: the zero moment point is 4 to 6 cm ahead of the ankles).
"""

from __future__ import annotations

import numpy as np

from ....solver.body import Body
from ....solver.rotations import exp
from ...arrays import BoolArray, FloatArray, unit_vectors
from ...kinematics.contact_points import SOLES
from ...kinematics.smoothing import gaussian_smooth
from .placement import PlacedTrack

# The speed of the centre of mass at which the weight of the correction has fallen to 1/e.
STANDING_M_S = 0.5
CUTOFF_HZ = 1.0
# From a sole's heel point, in units of the distance to its toe point. It is 5 cm ahead of ankles,
# since the heel point, the middle of the lowest part of heel and arch, lies 7 cm ahead of it.
MIDDLE = -0.2
# σ_m: people sway by 1 to 2 cm, and the body's masses and feet are off by as much.
STANCE_SIGMA_M = 0.03
LEAN_SIGMA = np.radians(5.0)  # σ_l, of leans found in people whose true lean is known
DOUBT = 0.2  # share of nearby frames in contact at which the correction is halved, roughly
GRAVITY_M_S2 = 9.81
LARGEST_TURN = np.radians(10.0)
MIN_HEIGHT_M = 0.3  # h
# Share of the body's mass, first joint, second joint, position of the centre of mass between them.
_LIMBS = (
    (0.028, "shoulder", "elbow", 0.436),
    (0.022, "elbow", "wrist", 0.68),  # with the hand
    (0.100, "hip", "knee", 0.433),
    (0.0465, "knee", "ankle", 0.433),
    (0.0145, "ankle", "foot", 0.5),
)
_HEAD = 0.081
_TRUNK = 0.497
# Knees bent by more than the first angle do not support the body; knees bent by less than the
# second one do.
RESTING_KNEE_COS, CARRYING_KNEE_COS = np.cos(np.radians([75.0, 60.0]))


def center_of_mass(body: Body, joints: FloatArray) -> FloatArray:
    """Return the (T, 3) centre of mass of a body with joints (T, K+1, 3), metres."""
    at = {name: i for i, name in enumerate(body.joint_names)}
    trunk = [at[f"{side}_{name}"] for side in ("left", "right") for name in ("hip", "shoulder")]
    total: FloatArray = _HEAD * joints[:, at["head"]] + _TRUNK * joints[:, trunk].mean(axis=1)
    for mass, start, end, share in _LIMBS:
        for side in ("left", "right"):
            a = joints[:, at[f"{side}_{start}"]]
            b = joints[:, at[f"{side}_{end}"]]
            total = total + mass * ((1 - share) * a + share * b)
    return total / (_HEAD + _TRUNK + 2 * sum(mass for mass, *_ in _LIMBS))


def leg_support(body: Body, joints: FloatArray) -> FloatArray:
    """Return how far the legs may carry the body's weight: 1 if one is straight enough, 0 if both
    are bent.

    With bent knees, the weight may rest on a chair or on the shins.

    :param joints: (T, K+1, 3) metres.
    :return: (T,) 0..1.
    """
    straight = np.max(
        [(shank * thigh).sum(1) for shank, thigh in leg_directions(body, joints)], axis=0
    )
    return np.clip((straight - RESTING_KNEE_COS) / (CARRYING_KNEE_COS - RESTING_KNEE_COS), 0.0, 1.0)


def leg_directions(body: Body, joints: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Return, for the left and the right leg, the (T, 3) unit vectors along shank and thigh, from
    below upwards.
    """
    return [
        (
            direction(body, joints, f"{side}_ankle", f"{side}_knee"),
            direction(body, joints, f"{side}_knee", f"{side}_hip"),
        )
        for side in ("left", "right")
    ]


def direction(body: Body, joints: FloatArray, a: str, b: str) -> FloatArray:
    """Return the (T, 3) unit vectors from joint a to joint b, given the joints (T, K+1, 3)."""
    at = body.joint_names.index
    return unit_vectors(joints[:, at(b)] - joints[:, at(a)])


def balancing_rotations(
    placed: PlacedTrack, contact: FloatArray, up: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Estimate the rotations that balance the body over its contact points.

    :param contact: (T, 6) probability that each sole point and palm rests on the floor.
    :param up: (3,) unit vector, in the first frame's camera axes.
    :return: rotations (T, 3, 3) and the points (T, 3) about which they turn, in the first frame's
        camera axes.
    """
    times = placed.times
    mass = gaussian_smooth(center_of_mass(placed.body, placed.joints), times, CUTOFF_HZ)
    pivot = placed.contact_center(contact)
    from_camera = mass - placed.center
    sight = unit_vectors(from_camera - (from_camera @ up)[:, None] * up)  # along the floor
    height = np.maximum((mass - pivot) @ up, MIN_HEIGHT_M)
    in_contact = contact > 0.5
    certainty = in_contact.any(axis=1) * leg_support(placed.body, placed.joints)
    zero_moment_point = mass
    if len(times) > 2:
        velocity = np.gradient(mass, times, axis=0)
        certainty *= np.exp(-np.square(np.linalg.norm(velocity, axis=1) / STANDING_M_S))
        zero_moment_point = (
            mass - np.gradient(velocity, times, axis=0) * (height / GRAVITY_M_S2)[:, None]
        )
    off = _distance_from_middle(placed.contact_points, in_contact, zero_moment_point, sight)
    lean_variance = np.square(LEAN_SIGMA * height)
    displacement = -off * lean_variance / (lean_variance + STANCE_SIGMA_M**2)
    angle = gaussian_smooth(certainty * np.arctan2(displacement, height), times, CUTOFF_HZ)
    angle /= gaussian_smooth(certainty, times, CUTOFF_HZ) + DOUBT
    angle = np.clip(angle, -LARGEST_TURN, LARGEST_TURN)
    return exp(angle[:, None] * np.cross(up, sight)), pivot


def _distance_from_middle(
    contact_points: FloatArray,
    in_contact: BoolArray,
    zero_moment_point: FloatArray,
    sight: FloatArray,
) -> FloatArray:
    """Return x − m of the module's equation: how far the zero moment point lies along the line of
    sight from the middle of the feet, or from the nearest point between the middles of several.

    :param contact_points: (T, 6, 3) metres, camera frame.
    :param in_contact: (T, 6).
    :param zero_moment_point: (T, 3) metres, camera frame.
    :param sight: (T, 3) horizontal unit vectors.
    :return: (T,) metres; negative towards the camera, 0 if nothing is in contact.
    """
    soles, palms = np.split(contact_points, [len(SOLES)], axis=1)
    heels = soles[:, 0::2]
    toes = soles[:, 1::2]
    supports = np.concatenate([heels + MIDDLE * (toes - heels), palms], axis=1)
    foot_in_contact = in_contact[:, 0 : len(SOLES) : 2] | in_contact[:, 1 : len(SOLES) : 2]
    is_support = np.concatenate([foot_in_contact, in_contact[:, len(SOLES) :]], axis=1)
    place = (supports * sight[:, None]).sum(axis=-1)
    nearest = np.where(is_support, place, np.inf).min(axis=1)
    farthest = np.where(is_support, place, -np.inf).max(axis=1)
    x = (zero_moment_point * sight).sum(axis=1)
    m = np.where(is_support.any(axis=1), np.clip(x, nearest, farthest), x)
    return x - m
