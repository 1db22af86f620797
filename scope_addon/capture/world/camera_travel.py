# SPDX-License-Identifier: GPL-3.0-or-later
"""How a camera travels that goes along with a person: by the feet that stand.

The background tells how a camera turns (`camera_motion`), but not in metres how it travels. A foot that carries the
body does not move over the floor, so where all standing feet seem to slide alike, it is the camera that moves:

    v_camera(t) = −v_foot(t),   horizontal, where a sole is the lowest of its frame and neither rises nor falls.

Only for a camera that is known to turn: on a treadmill feet slide before a camera that stands still.
"""

from __future__ import annotations

import numpy as np

from ...kinematics.smoothing import gaussian_smooth
from ..tracking.scene_cuts import SCENE_GAP_S

LEAST_M_S = 0.25  # slower sliding is the error of one camera's depth
STEADY = 0.8  # of its median, that half of the standing feet's velocities may be off it by
FEWEST_SAMPLES = 12
VERTICAL_M_S = 0.6  # of a sole that carries the body
SMOOTH_HZ = 0.5  # a camera that is carried or driven changes its speed slowly
FOOT_CUTOFF_HZ = 6.0


def camera_travel(soles: np.ndarray, valid: np.ndarray, up: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(T, 3) metres that the camera's centre has gone since the first frame; zeros where feet do not tell.

    :param soles: (T, F, 3) about the camera's centre, in axes that do not turn;  valid: (T,);  up: (3,) unit;
        times: (T,) seconds.
    """
    T = len(times)
    still = np.zeros((T, 3))
    if T < FEWEST_SAMPLES:
        return still
    velocity = np.gradient(gaussian_smooth(soles, times, FOOT_CUTOFF_HZ), times, axis=0)
    height = soles @ up
    lowest = height.argmin(axis=1)
    row = np.arange(T)
    v, h = velocity[row, lowest], height[row, lowest]
    carries = valid & (np.abs(v @ up) < VERTICAL_M_S) & (h < np.median(h[valid]) + 0.03)
    v = v - (v @ up)[:, None] * up
    if carries.sum() < FEWEST_SAMPLES:
        return still
    middle = np.median(v[carries], axis=0)
    off = np.linalg.norm(v - middle, axis=1)
    if np.linalg.norm(middle) < LEAST_M_S or np.median(off[carries]) > STEADY * np.linalg.norm(middle):
        return still
    carries &= off < 3.0 * np.median(off[carries])
    # A slowly changing speed through the samples, the median where there are none nearby.
    weight = carries.astype(float)
    total = gaussian_smooth(weight[:, None] * v + 0.02 * middle, times, SMOOTH_HZ)
    speed = total / (gaussian_smooth(weight[:, None], times, SMOOTH_HZ) + 0.02)
    lasts = np.diff(times)
    lasts[lasts > SCENE_GAP_S] = 0.0  # a cut: the camera counts as where it was last
    steps = 0.5 * (speed[1:] + speed[:-1]) * lasts[:, None]
    return np.concatenate([np.zeros((1, 3)), -np.cumsum(steps, axis=0)])
