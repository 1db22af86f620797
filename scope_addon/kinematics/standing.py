# SPDX-License-Identifier: GPL-3.0-or-later
"""The probability that a contact point rests on the floor: it is slow, low within its frame, and
does not fall.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Float64Array, FloatArray, unit_vectors
from .contact_points import SOLES
from .smoothing import gaussian_smooth

# v₀, across the line of sight. A swinging foot moves at 1 m/s and more.
CONTACT_SPEED_M_S = 0.35
CONTACT_HEIGHT_M = 0.05  # h₀, above the frame's lowest sole point
# h_p, above the lowest sole point. It is larger than h₀ because of the trunk's depth error.
PALM_HEIGHT_M = 0.12
# Positions are low-passed before their speed is computed, because noise is not motion.
CONTACT_CUTOFF_HZ = 4.0
# This is a₀. At the top of a jump, feet are as slow as on the floor, but they fall at 9.8 m/s².
# Feet on the floor are accelerated upwards, by landing and taking off, but not downwards.
FALL_M_S2 = 6.0
# A foot in the air does not stay still. If one does for about a second, it may be higher than the
# lowest point because its depth is wrong: it is then displaced up or down along its line of sight.
# These are v₁, and the cutoff frequency of the mean speed.
STILL_M_S = 0.12
STILL_CUTOFF_HZ = 0.6
WRONG_DEPTH_M = 0.4  # d
UNEVEN_M = 0.6  # h_u: one foot may rest this much higher than the other on stairs or boxes.
LEVEL_M = 0.25  # h_l: feet that stand farther above or below stand on something else.


def standing_probability(
    soles: FloatArray,
    up: FloatArray,
    times: Float64Array,
    center: FloatArray | None = None,
    uneven_ground: bool = False,
) -> FloatArray:
    """Return the (T, F) probability that each sole point rests on the floor: it is slow, low, and
    does not fall.

    p = s(4(1 − v/v₀)) s(4(1 − h/(h₀ + |g| d s(4(1 − v̄/v₁))))) s(8(1 − a/a₀)) / s(8) with the
    logistic function s. The height h is relative to the frame's lowest sole point, because the
    floor is not known yet. If the points were seen by a camera, the speed v and the downward
    acceleration a ≥ 0 exclude motion in depth, the noisy direction. The more a point stays still,
    the more it may be higher than the lowest one by what a depth error d explains, with g the
    upward component of its line of sight and v̄ the root mean square of v over a second.

    :param soles: (T, F, 3) metres.
    :param up: (3,) unit vector.
    :param times: (T,) seconds.
    :param center: (T, 3) or (3,) the camera's centre, in the same axes; None: no camera is known.
    :param uneven_ground: h₀ is the height of a step, h_u: on stairs, both feet rest.
    """
    height = soles @ up
    height = height - height.min(axis=1, keepdims=True)
    velocity = velocity_across(soles, times, center)
    speed = np.linalg.norm(velocity, axis=-1)
    allowed = np.full(height.shape, UNEVEN_M if uneven_ground else CONTACT_HEIGHT_M)
    if len(times) > 2 and center is not None:
        upwards = np.abs(unit_vectors(soles - np.expand_dims(center, -2)) @ up)
        mean_speed = np.sqrt(gaussian_smooth(np.square(speed), times, STILL_CUTOFF_HZ))
        allowed += WRONG_DEPTH_M * upwards * logistic(4 * (1 - mean_speed / STILL_M_S))
    p: FloatArray = logistic(4 * (1 - speed / CONTACT_SPEED_M_S)) * logistic(
        4 * (1 - height / allowed)
    )
    p *= logistic(8 * (1 - _downward_acceleration(velocity, up, times) / FALL_M_S2)) / logistic(8)
    return p


def resting_probability(
    contact_points: FloatArray,
    up: FloatArray,
    times: Float64Array,
    center: FloatArray,
    uneven_ground: bool = False,
) -> FloatArray:
    """Return the (T, 6) probability that each sole point and palm rests on something.

    For soles, see `standing_probability`. A palm rests if it is slow and not higher than the lowest
    sole point: p = s(4(1 − v/v₀)) s(4(1 − h/h_p)), with h the height above that point. Soles far
    above a palm, as in a handstand, do not rest: their p is multiplied by s(8(1 − d/2h_l)) / s(8),
    with d ≥ 0 the height of the lowest sole point above the lowest palm.

    :param contact_points: (T, 6, 3) metres.
    :param up: (3,) unit vector.
    :param times: (T,) seconds.
    :param center: (T, 3) or (3,) the camera's centre, in the same axes.
    :param uneven_ground: as in `standing_probability`.
    """
    soles, palms = np.split(contact_points, [len(SOLES)], axis=1)
    height = palms @ up - (soles @ up).min(axis=1, keepdims=True)
    stands = standing_probability(soles, up, times, center, uneven_ground)
    slow = logistic(4 * (1 - speed_across(palms, times, center) / CONTACT_SPEED_M_S))
    above_hands = np.maximum(-height.min(axis=1, keepdims=True), 0.0)
    stands *= logistic(8 * (1 - above_hands / (2 * LEVEL_M))) / logistic(8)
    return np.concatenate([stands, slow * logistic(4 * (1 - height / PALM_HEIGHT_M))], axis=1)


def speed_across(
    points: FloatArray,
    times: Float64Array,
    center: FloatArray | None,
) -> FloatArray:
    """Return the (T, F) speed in m/s; see `velocity_across`.

    :param points: (T, F, 3) metres.
    :param times: (T,) seconds.
    :param center: (T, 3) or (3,) the camera's centre; None: the whole speed.
    """
    return np.linalg.norm(velocity_across(points, times, center), axis=-1)


def velocity_across(
    points: FloatArray,
    times: Float64Array,
    center: FloatArray | None,
) -> FloatArray:
    """Return the (T, F, 3) velocity in m/s, across the line of sight of a camera; 0 in clips of one
    or two frames.

    :param points: (T, F, 3) metres.
    :param times: (T,) seconds.
    :param center: (T, 3) or (3,) the camera's centre, in the same axes; None: the whole velocity.
    """
    if len(times) <= 2:
        return np.zeros(points.shape)
    velocity: FloatArray = np.gradient(
        gaussian_smooth(points, times, CONTACT_CUTOFF_HZ), times, axis=0
    )
    if center is not None:
        sight = unit_vectors(points - np.expand_dims(center, -2))
        velocity = velocity - sight * (velocity * sight).sum(-1, keepdims=True)
    return velocity


def _downward_acceleration(velocity: FloatArray, up: FloatArray, times: Float64Array) -> FloatArray:
    """Return the (T, F) downward acceleration, m/s², from velocities (T, F, 3); 0 where it is
    upward.
    """
    if len(times) <= 2:
        return np.zeros(velocity.shape[:2])
    down = -np.gradient(velocity @ up, times, axis=0)
    # Differences of the two outermost frames alone are mostly noise.
    down[0], down[-1] = down[1], down[-2]
    return np.maximum(down, 0.0)


def logistic(x: FloatArray | float) -> FloatArray:
    """Return the logistic function 1 / (1 + exp(−x)) of an array (...), clipped at |x| = 30."""
    return np.asarray(1 / (1 + np.exp(-np.clip(x, -30, 30))))
