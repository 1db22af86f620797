# SPDX-License-Identifier: GPL-3.0-or-later
"""Where strides contradict the path: legs that walk while the body stays.

With a(t) from the right foot to the left one, along the direction in which the pelvis faces, a
walker travels at

    v = ½ mean |da/dt|      over a stride:

each foot stands while the other overtakes it, so a changes by twice a step for every step. Somebody
who does that and does not travel is on a treadmill, or the camera moves and the background does not
show it, which look the same. Feet that were locked there would stretch or stop the strides, so
nothing is held in place, and the capture says so, unless the user has said that it is a treadmill.
On the belt itself, people travel at its speed, and feet rest as on a floor.
"""

from __future__ import annotations

import numpy as np

from ...arrays import BoolArray, Float64Array, FloatArray
from ...kinematics.sequences import runs
from ...kinematics.smoothing import gaussian_smooth
from .placement import PlacedTrack

# By which the strides' speed exceeds the body's.
EXCESS_M_S = 0.4
EXCESS = 2.0  # the same as a factor: strides along the line of sight are seen by a third too short
CUTOFF_HZ = 4.0
MEAN_HZ = 0.5  # speeds are averaged over a stride
# Each foot must overtake the other one by that within `ALTERNATION_S`: kicks and steps of one leg
# are no walk.
MIN_STEP_M = 0.12
ALTERNATION_S = 0.8  # to either side
SHORTEST_S = 1.5
MARGIN_S = 0.3  # by which such times are prolonged at both ends


def belt_travel(placed: PlacedTrack, up: FloatArray, belt_m_s: float) -> Float64Array:
    """Return the (T, 3) displacement since the first frame of a camera that stands beside a
    treadmill, in the axes in which the belt is at rest: the camera then goes where a person faces.

    :param up: (3,) unit vector.
    """
    ahead = _facing(placed, up)[placed.valid].mean(axis=0)
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-6)
    travel: Float64Array = belt_m_s * (placed.times - placed.times[0])[:, None] * ahead
    return travel


def contradicting_strides(placed: PlacedTrack, up: FloatArray) -> BoolArray:
    """Return (T,) whether the strides of a motion contradict its path in each frame.

    :param up: (3,) unit vector.
    """
    times = placed.times
    contradicts = np.zeros(len(times), bool)
    if len(times) < 3 or np.ptp(times) < SHORTEST_S:
        return contradicts
    apart = placed.soles[:, :2].mean(axis=1) - placed.soles[:, 2:].mean(axis=1)
    along = (apart * _facing(placed, up)).sum(axis=1)
    by_legs = gaussian_smooth(0.5 * np.abs(_velocity(along, times)), times, MEAN_HZ)
    v_pelvis = gaussian_smooth(_velocity(placed.root, times), times, MEAN_HZ)
    by_path = np.linalg.norm(v_pelvis - (v_pelvis @ up)[:, None] * up, axis=1)
    walks = _reached(along, times) & _reached(-along, times)
    exceeds = (by_legs > by_path + EXCESS_M_S) & (by_legs > EXCESS * by_path)
    for first, end in runs(placed.valid & walks & exceeds):
        if times[end - 1] - times[first] >= SHORTEST_S:
            contradicts |= (times >= times[first] - MARGIN_S) & (times <= times[end - 1] + MARGIN_S)
    return contradicts


def _facing(placed: PlacedTrack, up: FloatArray) -> FloatArray:
    """Return the (T, 3) horizontal unit vectors in which the pelvis faces."""
    ahead = placed.rotations[:, 0, :, 2]
    level = ahead - (ahead @ up)[:, None] * up
    facing: FloatArray = level / np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-6)
    return facing


def _reached(along: FloatArray, times: Float64Array) -> BoolArray:
    """Return (T,) whether a distance reaches `MIN_STEP_M` near each time."""
    reaching = times[along > MIN_STEP_M]
    after = np.searchsorted(reaching, times - ALTERNATION_S)
    before = np.searchsorted(reaching, times + ALTERNATION_S, side="right")
    reached: BoolArray = before > after
    return reached


def _velocity(values: FloatArray, times: Float64Array) -> Float64Array:
    velocity: Float64Array = np.gradient(gaussian_smooth(values, times, CUTOFF_HZ), times, axis=0)
    return velocity
