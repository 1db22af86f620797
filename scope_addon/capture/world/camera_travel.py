# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera travel, estimated from the feet of a person whom the camera follows.

The background determines how the camera rotates (`camera_rotation`), but its travel only up to scale. A foot that
carries the body does not move on the floor, so if the feet that carry it seem to slide alike, the camera moves. Its
velocity u(t) over the floor is the smooth one that most soles k agree with, where v_k is a sole's horizontal velocity
relative to the camera and p_k tells whether it is low and neither rises nor falls:

    minimize  Σ_t Σ_k p_k ρ(|v_k + u|²),   |d|² = (d · side)²/σ_side² + (d · sight)²/σ_sight²,   ρ(x) = x / (1 + x)

by iteratively reweighted means over a Gaussian window, whose robust scale narrows. Swinging feet, and jumps of the
distance, are outliers. Distances also change smoothly where they are wrong, along the line of sight, so the camera
counts as travelling only if clearly more soles agree with it than with a camera at rest; fewer are enough if the
background's near corners pass by.

This is used only for a camera that rotates: on a treadmill, feet slide in front of a static camera.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...kinematics.smoothing import gaussian_smooth
from ...kinematics.standing import horizontal_line_of_sight, logistic
from ..tracking.scene_cuts import SCENE_GAP_S

MIN_SAMPLES = 12
FOOT_CUTOFF_HZ = 6.0
MAX_VERTICAL_M_S = 0.5  # of a sole that carries the body
MAX_HEIGHT_M = 0.04  # of such a sole above the lowest of its frame
MAX_RISE_M = 0.1  # of the lowest one above the median of all frames: in a jump, it is lower than the other but not down
SIDE_M_S, SIGHT_M_S = 0.25, 0.5  # σ, speeds at which soles at rest seem to move
TRAVEL_SIGHT_M_S = 1.0  # σ_sight where a travelling camera is compared with one at rest
MIN_GAIN = 0.3  # of the soles that carry the body: by how much more of them agree with a travelling camera
# The same where near corners of the background pass by, so that few agree with a rotation alone: 0.29 to 0.44 in
# most scenes with a travelling camera, 0.46 to 0.57 in those with one that pans.
MIN_GAIN_OF_PASSING, PASSING_SHARE = 0.1, 0.45
SMOOTH_HZ = 0.7  # a camera that is carried or driven changes its speed slowly
ROBUST_SCALES = (*np.geomspace(4.0, 1.0, 10), 1.0, 1.0, 1.0)  # in units of σ
MEAN_WEIGHT = 0.002  # of the mean velocity, relative to a sole's; it counts far from any sole that carries the body


def camera_travel(
    soles: NDArray[np.floating[Any]],
    valid: NDArray[np.bool_],
    up: NDArray[np.floating[Any]],
    times: NDArray[np.float64],
    inlier_share: float,
) -> NDArray[np.float64]:
    """Return the (T, 3) displacement of the camera's centre since the first frame, metres; zeros if it is unknown.

    :param soles: (T, F, 3) metres, relative to the camera's centre, in axes that do not rotate.
    :param valid: (T,) frames in which the person was seen.
    :param up: (3,) unit vector.
    :param times: (T,) seconds.
    :param inlier_share: of the background's corners that agree with a rotation of the camera alone.
    """
    unknown = np.zeros((len(times), 3))
    if valid.sum() < MIN_SAMPLES:
        return unknown
    durations, middles = np.diff(times), 0.5 * (times[1:] + times[:-1])
    velocity = np.diff(gaussian_smooth(soles, times, FOOT_CUTOFF_HZ), axis=0) / durations[:, None, None]
    carries = _carrying_probability(soles, velocity, up) * (valid[1:] & valid[:-1])[:, None]
    velocity = velocity - (velocity @ up)[..., None] * up
    sight = horizontal_line_of_sight(soles[1:].mean(axis=1), up)
    information = _information(sight, SIGHT_M_S)
    camera = _smooth_velocity(carries, velocity, information, middles)
    for scale in ROBUST_SCALES:
        weight = carries / (1.0 + _squares(velocity + camera[:, None], information) / scale**2) ** 2
        camera = _smooth_velocity(weight, velocity, information, middles)
    information = _information(sight, TRAVEL_SIGHT_M_S)
    travels, rests = (
        (carries / (1.0 + _squares(velocity + each[:, None], information))).sum() for each in (camera, 0.0 * camera)
    )
    least = MIN_GAIN_OF_PASSING if inlier_share < PASSING_SHARE else MIN_GAIN
    if travels - rests < least * carries.sum():
        return unknown
    durations[durations > SCENE_GAP_S] = 0.0  # after a cut, the camera counts as not having moved
    return np.concatenate([unknown[:1], np.cumsum(camera * durations[:, None], axis=0)])


def _carrying_probability(
    soles: NDArray[np.floating[Any]], velocity: NDArray[np.floating[Any]], up: NDArray[np.floating[Any]]
) -> NDArray[np.floating[Any]]:
    """Return the (T-1, F) probability that each sole is low, between two frames, and neither rises nor falls."""
    height = soles @ up
    lowest = height.min(axis=1)
    above, rise = height - lowest[:, None], lowest - np.median(lowest)
    above, rise = (np.maximum(each[1:], each[:-1]) for each in (above, rise))
    low = logistic(4 * (1 - above / MAX_HEIGHT_M)) * logistic(4 * (1 - rise / MAX_RISE_M))[:, None]
    carries: NDArray[np.floating[Any]] = low * logistic(4 * (1 - np.abs(velocity @ up) / MAX_VERTICAL_M_S))
    return carries


def _information(sight: NDArray[np.floating[Any]], sight_m_s: float) -> NDArray[np.float64]:
    """Return the (n, 3, 3) information of velocities with deviations `SIDE_M_S` across and ``sight_m_s`` along it."""
    along = sight[:, :, None] * sight[:, None, :]
    information: NDArray[np.float64] = (np.eye(3) - along) / SIDE_M_S**2 + along / sight_m_s**2
    return information


def _squares(difference: NDArray[np.floating[Any]], information: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return |d|² (n, F) of differences d (n, F, 3)."""
    squares: NDArray[np.float64] = np.einsum("nfi,nij,nfj->nf", difference, information, difference)
    return squares


def _smooth_velocity(
    weight: NDArray[np.floating[Any]],
    velocity: NDArray[np.floating[Any]],
    information: NDArray[np.float64],
    times: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the camera's velocity (n, 3) that agrees with soles of some weight (n, F) around each time."""
    weight = weight / np.maximum(weight.sum(axis=1, keepdims=True), 1.0)  # both feet say no more than one
    total = np.einsum("n,nij->nij", weight.sum(axis=1), information)
    right = -np.einsum("nij,nfj,nf->ni", information, velocity, weight)
    least = MEAN_WEIGHT * np.eye(3) / SIDE_M_S**2
    mean = np.linalg.solve(total.mean(axis=0) + 1e-3 * least, right.mean(axis=0))
    total = gaussian_smooth(total, times, SMOOTH_HZ) + least
    right = gaussian_smooth(right, times, SMOOTH_HZ) + least @ mean
    camera: NDArray[np.float64] = np.linalg.solve(total, right[..., None])[..., 0]
    return camera
