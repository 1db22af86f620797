# SPDX-License-Identifier: GPL-3.0-or-later
"""The probability that a sole or palm rests on something: slow, and low within its frame."""

from __future__ import annotations

import numpy as np

from .contact_points import SOLES
from .smoothing import gaussian_smooth

CONTACT_SPEED_M_S = 0.35  # across the line of sight; a swinging foot moves at 1 m/s and more
CONTACT_HEIGHT_M = 0.05  # above the frame's lowest sole point
PALM_HEIGHT_M = 0.12  # of a palm above the lowest sole: the trunk between them is put to a wrong depth as well
CONTACT_CUTOFF_HZ = 4.0  # low-pass of a sole's position before its speed is taken: noise is not motion
# A foot in the air does not keep still: one that does for a second or so may be higher than the lowest because it was
# put to a wrong distance, up or down its line of sight.
STILL_M_S, STILL_CUTOFF_HZ = 0.12, 0.6
WRONG_DEPTH_M = 0.4
LEVEL_M = 0.25  # h_l: feet that stand farther above or below stand on something else


def line_of_sight(position: np.ndarray) -> np.ndarray:
    """(..., 3) unit vectors from the camera's centre to positions (..., 3) about it."""
    return position / np.maximum(np.linalg.norm(position, axis=-1, keepdims=True), 1e-9)


def standing_probability(
    soles: np.ndarray, up: np.ndarray, times: np.ndarray, center: np.ndarray | None = None
) -> np.ndarray:
    """(T, F) probability that each sole point stands: slow and lowest of its frame.

    p = s(4(1 − v/v₀)) s(4(1 − h/(h₀ + |g| d s(4(1 − v̄/v₁))))) with the logistic s. The height h is measured from the
    frame's lowest sole point, not from a floor that is not known yet. Where a camera saw the points, depth, the noisy
    direction, takes no part in the speed v; and as far as a point keeps still, it may be higher than the lowest by what
    a wrong depth d explains, g the upward part of its line of sight: v̄ is the root mean square of v over a second.

    :param soles: (T, F, 3) metres;  up: (3,) unit;  times: (T,) seconds.
    :param center: (T, 3) or (3,) the camera's, in the same axes; None: no camera is known.
    """
    height = soles @ up
    height = height - height.min(axis=1, keepdims=True)
    speed, allowed = _speed(soles, times, center), np.full(height.shape, CONTACT_HEIGHT_M)
    if len(times) > 2 and center is not None:
        upwards = np.abs(line_of_sight(soles - np.expand_dims(center, -2)) @ up)
        mean_speed = np.sqrt(gaussian_smooth(np.square(speed), times, STILL_CUTOFF_HZ))
        allowed += WRONG_DEPTH_M * upwards * logistic(4 * (1 - mean_speed / STILL_M_S))
    return logistic(4 * (1 - speed / CONTACT_SPEED_M_S)) * logistic(4 * (1 - height / allowed))


def resting_probability(
    contact_points: np.ndarray, up: np.ndarray, times: np.ndarray, center: np.ndarray
) -> np.ndarray:
    """(T, 6) probability that each sole and palm rests on something: soles as `standing_probability` has them.

    A palm rests where it is slow and not higher than the lowest sole: p = s(4(1 − v/v₀)) s(4(1 − h/h_p)), h the height
    above that. Soles that are far above a palm, of one who stands on the hands, do not stand: their p is multiplied by
    s(8(1 − d/2h_l)) / s(8), d ≥ 0 the height of the lowest sole over the lowest palm.

    :param contact_points: (T, 6, 3) metres, seen from ``center`` (T, 3) or (3,);  up: (3,) unit;  times: (T,) seconds.
    """
    soles, palms = np.split(contact_points, [len(SOLES)], axis=1)
    height = palms @ up - (soles @ up).min(axis=1, keepdims=True)
    stands = standing_probability(soles, up, times, center)
    slow = logistic(4 * (1 - _speed(palms, times, center) / CONTACT_SPEED_M_S))
    over_hands = np.maximum(-height.min(axis=1, keepdims=True), 0.0)
    stands *= logistic(8 * (1 - over_hands / (2 * LEVEL_M))) / logistic(8)
    return np.concatenate([stands, slow * logistic(4 * (1 - height / PALM_HEIGHT_M))], axis=1)


def _speed(points: np.ndarray, times: np.ndarray, center: np.ndarray | None) -> np.ndarray:
    """(T, F) m/s, across the line of sight where there is a camera; 0 in clips of one or two frames."""
    if len(times) <= 2:
        return np.zeros(points.shape[:2])
    velocity = np.gradient(gaussian_smooth(points, times, CONTACT_CUTOFF_HZ), times, axis=0)
    if center is None:
        return np.linalg.norm(velocity, axis=-1)
    sight = line_of_sight(points - np.expand_dims(center, -2))
    return np.linalg.norm(velocity - sight * (velocity * sight).sum(-1, keepdims=True), axis=-1)


def logistic(x: np.ndarray | float) -> np.ndarray:
    """Logistic function 1 / (1 + exp(−x)) of an array of any shape, saturating beyond |x| = 30."""
    return np.asarray(1 / (1 + np.exp(-np.clip(x, -30, 30))))
