# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera travel, estimated from the feet of a person whom the camera follows.

The background determines how the camera rotates (`camera_rotation`), but its travel only up to scale. A foot that
carries the body does not move on the floor, so if all feet in contact seem to slide alike, the camera moves:

    v_camera(t) = −v_foot(t),   horizontal, where a sole is the lowest of its frame and neither rises nor falls.

This is used only for a camera that rotates: on a treadmill, feet slide in front of a static camera.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...kinematics.smoothing import gaussian_smooth
from ..tracking.scene_cuts import SCENE_GAP_S

MIN_SPEED_M_S = 0.25  # slower sliding is explained by depth errors
MAX_SPREAD = 0.8  # median deviation of the feet's velocities from their median, relative to the median
MIN_SAMPLES = 12
MAX_VERTICAL_M_S = 0.6  # vertical speed of a sole that carries the body
MAX_HEIGHT_M = 0.03  # of such a sole above the median of the lowest soles
SMOOTH_HZ = 0.5  # a camera that is carried or driven changes its speed slowly
MEDIAN_WEIGHT = 0.02  # of the median velocity, relative to a frame's sample
FOOT_CUTOFF_HZ = 6.0


def camera_travel(
    soles: NDArray[np.floating[Any]],
    valid: NDArray[np.bool_],
    up: NDArray[np.floating[Any]],
    times: NDArray[np.float64],
    uneven_ground: bool = False,
) -> NDArray[np.float64]:
    """Return the (T, 3) displacement of the camera's centre since the first frame, metres; zeros if it is unknown.

    :param soles: (T, F, 3) metres, relative to the camera's centre, in axes that do not rotate.
    :param valid: (T,) frames in which the person was seen.
    :param up: (3,) unit vector.
    :param times: (T,) seconds.
    :param uneven_ground: soles may carry at any height.
    """
    T = len(times)
    unknown = np.zeros((T, 3))
    if T < MIN_SAMPLES:
        return unknown
    velocity = np.gradient(gaussian_smooth(soles, times, FOOT_CUTOFF_HZ), times, axis=0)
    height = soles @ up
    lowest = height.argmin(axis=1)
    row = np.arange(T)
    v, h = velocity[row, lowest], height[row, lowest]
    carries: NDArray[np.bool_] = valid & (np.abs(v @ up) < MAX_VERTICAL_M_S)
    if not uneven_ground:
        carries &= h < np.median(h[valid]) + MAX_HEIGHT_M
    v = v - (v @ up)[:, None] * up
    if carries.sum() < MIN_SAMPLES:
        return unknown
    median = np.median(v[carries], axis=0)
    deviation = np.linalg.norm(v - median, axis=1)
    if np.linalg.norm(median) < MIN_SPEED_M_S or np.median(deviation[carries]) > MAX_SPREAD * np.linalg.norm(median):
        return unknown
    carries &= deviation < 3.0 * np.median(deviation[carries])
    # A slowly changing velocity through the samples; the median far from any sample.
    weight = carries.astype(float)
    total = gaussian_smooth(weight[:, None] * v + MEDIAN_WEIGHT * median, times, SMOOTH_HZ)
    camera_velocity = total / (gaussian_smooth(weight[:, None], times, SMOOTH_HZ) + MEDIAN_WEIGHT)
    durations = np.diff(times)
    durations[durations > SCENE_GAP_S] = 0.0  # after a cut, the camera counts as not having moved
    steps = 0.5 * (camera_velocity[1:] + camera_velocity[:-1]) * durations[:, None]
    return np.concatenate([np.zeros((1, 3)), -np.cumsum(steps, axis=0)])
