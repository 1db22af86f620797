# SPDX-License-Identifier: GPL-3.0-or-later
"""The scale of a camera's path, which the background shows up to scale: from people on the floor;
and where their strides contradict it.

Where the map of the background has a floor, its distance below the camera is known twice: in units
of the path, and in metres from the feet of a person of known size on it. The ratio of the two
does not depend on how long strides are, which are seen too short where people walk along the line
of sight. Without a floor, the scale is that with which one foot is at rest most of the time, and
with which people walk about as fast as their cadence tells.

Strides contradict a path where legs walk while the body stays. With a(t) from the right foot to the
left one, along the direction in which the pelvis faces, a walker travels at

    v = ½ mean |da/dt|      over a stride:

each foot stands while the other overtakes it, so a changes by twice a step for every step. Somebody
who does that and does not travel is on a treadmill, or the camera moves and the background does not
show it, which look the same. Feet that were locked there would stretch or stop the strides, so
nothing is held in place, and the capture says so, unless the user has said that it is a treadmill.
On the belt itself, people travel at its speed, and feet rest as on a floor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...arrays import BoolArray, Float64Array, FloatArray, unit_vectors
from ...kinematics.sequences import runs
from ...kinematics.smoothing import gaussian_smooth
from ...scene_gaps import steps_in_scenes
from ..camera.odometry import Odometry
from .placement import PlacedTrack

# What the scale of a path follows from, the most certain one first.
FLOOR = "floor"
FEET = "feet"
NOTHING = "nothing"
SOURCES = (FLOOR, FEET, NOTHING)
MIN_FRAMES = 12  # in which the person was seen
# The floor, see `find_floor`.
PLANES = 600  # that are tried, of three corners each
MAX_TILT_COS = np.cos(np.radians(15.0))  # between floor and up direction
FLAT = 0.02  # distance of a corner from the floor, in units of the camera's height above it
NEAR = 8.0  # of corners that tell the floor, likewise
MIN_FLOOR = 12  # corners on it
MAX_UNDER = 0.08  # share of the near corners that may be under it
MAX_RATIO = 3.0  # between the scales from the floor and from the feet
# The feet, see `scale_by_feet`.
CARRYING_M_S = 0.35  # σ: speed below which a foot may carry
CARRYING_HEIGHT_M = 0.1  # of such a foot above the lowest sole of its frame
CUTOFF_HZ = 4.0
CAMERA_SPEEDS_M_S = (0.03, 30.0)  # root mean squares of the camera's speed that are tried
SPEEDS = 240
LIKELY_SPEED_M_S = 1.4
# Weight of the squared logarithm of the speed relative to that: decides where feet do not tell.
SPEED_WEIGHT = 0.004
MIN_CARRIED = 0.3  # share of the frames in which a foot must carry
CADENCE_WEIGHT = 0.3
SHORTENED = np.array([1.0, 0.85, 0.7, 0.6, 0.5, 0.42, 0.35, 0.3])  # g that are tried
SHORTENED_WEIGHT = 0.02
SLOWEST_M_S = 0.02  # that is told from rest
# The walk, see `walking_speed`.
WALK_RATIO = 0.385  # metre seconds for each step squared
FASTEST_STEP_S = 0.25
SLOWEST_STEP_S = 0.9
MIN_STEPS = 3
MIN_REGULAR = 0.7  # share of the steps whose times are those of a walk


class Plane(NamedTuple):
    """Points p with normal · p = offset."""

    normal: Float64Array  # (3,) unit
    offset: float


@dataclass(frozen=True)
class ScaledTravel:
    """The displacement (T, 3) of the camera's centre since the first frame, metres, and the (3,) up
    direction of the floor that it passes, None without one; both in the first frame's axes.
    """

    center: Float64Array
    floor_up: Float64Array | None
    # What the scale follows from: `FLOOR`, `FEET`, or `NOTHING`, with which the camera stays in
    # place. Of a path of several parts, the one that tells least.
    source: str


def scaled_travel(
    placed: PlacedTrack, up: FloatArray, travel: Odometry, treadmill: bool
) -> ScaledTravel:
    """Return the camera's travel in metres. Where ``travel`` shows none, the camera stays where it
    is.

    :param placed: the person, relative to the camera's centre, in the first frame's axes.
    :param up: (3,) unit vector, as far as it is known.
    :param travel: of the camera, up to scale.
    :param treadmill: whether feet move with a belt, so that the floor alone tells the scale.
    """
    soles = placed.soles
    valid = placed.valid
    times = placed.times
    center = np.zeros((len(times), 3))
    floor_up = None
    most_frames = 0
    sources = set()
    for number, places in enumerate(travel.maps):
        rows = np.flatnonzero(travel.part == number)
        part = slice(int(rows[0]), int(rows[-1]) + 1)
        path = travel.center[part]
        seen = valid[part]
        scale = 0.0 if treadmill else scale_by_feet(placed, part, up, path)
        source = FEET if scale > 0.0 else NOTHING
        floor = find_floor(places, path, up)
        if floor is not None and seen.any():
            floor = with_feet(floor, places, soles[part][seen], path[seen])
            by_floor = scale_by_floor(soles[part][seen], path[seen], floor)
            if scale == 0.0 or abs(np.log(by_floor / scale)) < np.log(MAX_RATIO):
                scale = by_floor
                source = FLOOR
                if len(rows) > most_frames:
                    floor_up, most_frames = floor.normal, len(rows)
        sources.add(source)
        center[part] = center[part.start] + scale * (path - path[0])
        center[part.stop :] = center[part.stop - 1]
    return ScaledTravel(center, floor_up, max(sources, key=SOURCES.index, default=FLOOR))


def find_floor(places: Float64Array, path: Float64Array, up: FloatArray) -> Plane | None:
    """Return the floor below a camera's path: the plane with most corners near it, and next to none
    under it; None if there is none.

    :param places: (C, 3) of corners.
    :param path: (T, 3) of the camera, in the same axes and units.
    :param up: (3,) unit vector, which may be off by some degrees.
    """
    eye = path.mean(axis=0)
    below = places[(places - eye) @ up < 0]
    if len(below) < MIN_FLOOR:
        return None
    random = np.random.default_rng(0)
    corners = below[random.integers(0, len(below), (PLANES, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals / np.maximum(lengths, 1e-12)[:, None]
    normals *= np.sign(normals @ up)[:, None]
    heights = ((eye - corners[:, 0]) * normals).sum(axis=1)
    level = (normals @ up > MAX_TILT_COS) & (heights > 0) & (lengths > 1e-9)
    best: Plane | None = None
    most = MIN_FLOOR - 1
    for normal, height in zip(normals[level], heights[level], strict=True):
        floor = Plane(normal, float(normal @ eye) - float(height))
        on_it, under = _on_floor(places, path, floor)
        count = int(on_it.sum())
        if count > most and under.sum() < MAX_UNDER * (count + under.sum()):
            best, most = floor, count
    if best is None:
        return None
    for _ in range(3):
        on_it, _ = _on_floor(places, path, best)
        # Corners along a line, as of a caption, lie in planes of any tilt.
        if on_it.sum() < MIN_FLOOR or best.normal @ up <= MAX_TILT_COS:
            return None
        best = _fitted_plane(places[on_it], up)
    return best


def _on_floor(
    places: Float64Array, path: Float64Array, floor: Plane
) -> tuple[BoolArray, BoolArray]:
    """Return (C,) whether each corner is on a floor, and whether it is near the camera and under
    it.
    """
    eye = path.mean(axis=0)
    height = float(floor.normal @ eye) - floor.offset
    above = places @ floor.normal - floor.offset
    distance = np.linalg.norm(places[:, None] - path[:: max(1, len(path) // 20)], axis=2).min(1)
    near = distance < NEAR * height
    return near & (np.abs(above) < FLAT * height), near & (above < -3.0 * FLAT * height)


def _fitted_plane(places: Float64Array, up: FloatArray) -> Plane:
    mean = places.mean(axis=0)
    normal = np.linalg.svd(places - mean, full_matrices=False)[2][2]
    normal = normal * np.sign(normal @ up)
    return Plane(normal, float(normal @ mean))


def with_feet(floor: Plane, places: Float64Array, soles: FloatArray, path: Float64Array) -> Plane:
    """Return the floor on which the feet walk as well, which may go farther than its corners.

    :param places: (n, 3) of its corners.
    :param soles: (T, F, 3) metres, relative to the camera's centre.
    :param path: (T, 3) of the camera, in units.
    """
    row = np.arange(len(soles))
    for _ in range(3):
        scale = scale_by_floor(soles, path, floor)
        lowest = soles[row, (soles @ floor.normal).argmin(axis=1)] / scale + path
        height = np.median(path @ floor.normal - floor.offset)
        near = np.abs(lowest @ floor.normal - floor.offset) < 4.0 * FLAT * height
        on_it, _ = _on_floor(places, path, floor)
        corners = places[on_it]
        if len(corners) < MIN_FLOOR:
            break
        feet = lowest[near][:: max(1, len(lowest) // max(1, len(corners)))]
        floor = _fitted_plane(np.concatenate([corners, feet]), floor.normal)
    return floor


def scale_by_floor(soles: FloatArray, path: Float64Array, floor: Plane) -> float:
    """Return the scale, metres per unit: the median of the height of the camera above the lowest
    sole over that above the floor.

    :param soles: (T, F, 3) metres, relative to the camera's centre.
    :param path: (T, 3) of the camera, in units.
    """
    height_m = -(soles @ floor.normal).min(axis=1)
    height = path @ floor.normal - floor.offset
    return float(np.median(height_m / np.maximum(height, 1e-9)))


def scale_by_feet(placed: PlacedTrack, part: slice, up: FloatArray, path: Float64Array) -> float:
    """Return the scale s of a part of a camera's path, metres per unit; 0 if it is unknown.

    In the world, one foot is at rest most of the time, whichever it is and however the person
    moves. With the speed v of the slowest of a frame's low soles for a scale, s minimizes

        mean_t v² / (v² + σ²) + w log²(s v_c / v_0) + a log²(v_b / v_w) + b log² g
        v = min_f |dq_f/dt + s dc/dt|

    The second term, with the camera's mean speed s v_c, only decides where feet do not tell. The
    last two apply to somebody who walks. Strides along the line of sight appear too short by an
    unknown factor g, so q_f is stretched by 1 / g in that direction, relative to the pelvis. This
    leaves the scale open, and the cadence decides: v_b is the body's mean speed, and v_w that of a
    walker of the same cadence (`walking_speed`).

    :param placed: the person, relative to the camera's centre, in axes that do not rotate.
    :param part: frames of the path.
    :param up: (3,) unit vector.
    :param path: (n, 3) c of the camera in these frames, in units.
    """
    soles = placed.soles[part]
    valid = placed.valid[part]
    times = placed.times[part]
    if valid.sum() < MIN_FRAMES:
        return 0.0
    height = soles @ up
    is_low = height < height.min(axis=1, keepdims=True) + CARRYING_HEIGHT_M
    v_camera = _velocity(path, times)
    unit_speed = float(np.sqrt((v_camera[valid] ** 2).sum(axis=1).mean()))
    if unit_speed <= 0.0:
        return 0.0
    root = placed.root[part]
    from_root = soles - root[:, None]
    sight = unit_vectors(root)
    along_sight = (from_root * sight[:, None]).sum(axis=2, keepdims=True) * sight[:, None]
    walking_m_s = walking_speed(_step_times(placed, up, part))
    shortened = SHORTENED if walking_m_s > 0.0 else SHORTENED[:1]
    v_soles = [_velocity(soles + (1.0 / g - 1.0) * along_sight, times) for g in shortened]
    # Without what changes within a stride.
    v_body = _mean_velocity(root, times)
    v_path = _mean_velocity(path, times)

    def slowest2(scale: float, v_sole: FloatArray) -> Float64Array:
        v = v_sole + scale * v_camera[:, None]
        return np.where(is_low, (v**2).sum(axis=2), np.inf).min(axis=1)[valid]

    def speed_cost(scale: float) -> float:
        cost = SPEED_WEIGHT * np.log(scale * unit_speed / LIKELY_SPEED_M_S) ** 2
        if walking_m_s > 0.0:
            v = (v_body + scale * v_path)[valid]
            level = v - (v @ up)[:, None] * up
            body_m_s = max(float(np.linalg.norm(level, axis=1).mean()), SLOWEST_M_S)
            cost += CADENCE_WEIGHT * np.log(body_m_s / walking_m_s) ** 2
        return float(cost)

    def feet_cost(scale: float, k: int) -> float:
        v2 = slowest2(scale, v_soles[k])
        cost = (v2 / (v2 + CARRYING_M_S**2)).mean()
        return float(cost + SHORTENED_WEIGHT * np.log(shortened[k]) ** 2)

    scales = np.geomspace(*CAMERA_SPEEDS_M_S, SPEEDS) / unit_speed
    costs = np.array([[feet_cost(scale, k) for scale in scales] for k in range(len(shortened))])
    costs += [speed_cost(scale) for scale in scales]
    best_k, column = np.unravel_index(int(costs.argmin()), costs.shape)
    fine = scales[column] * np.linspace(0.97, 1.03, 31)
    fine_costs = [feet_cost(scale, int(best_k)) + speed_cost(scale) for scale in fine]
    best = float(fine[np.argmin(fine_costs)])
    is_carried = slowest2(best, v_soles[best_k]) < CARRYING_M_S**2
    return best if is_carried.mean() >= MIN_CARRIED else 0.0


def walking_speed(step_times: Float64Array) -> float:
    """Return the speed of an adult who takes steps at these times (n,) in seconds, m/s; 0 if they
    are no walk.

    Steps are the longer the faster they follow each other: length over cadence, the walk ratio, is
    about the same at any speed. With f steps per second, the speed is thus `WALK_RATIO` f². In five
    sets of recorded people who walk and run, half of all strides are within 20 % of it.

    Source: Sekiya and Nagasaki 1998.
    """
    apart = np.diff(step_times)
    regular = apart[(apart > FASTEST_STEP_S) & (apart < SLOWEST_STEP_S)]
    if len(regular) < MIN_STEPS or len(regular) < MIN_REGULAR * len(apart):
        return 0.0
    return float(WALK_RATIO / np.median(regular) ** 2)


# By which the strides' speed exceeds the body's.
EXCESS_M_S = 0.4
EXCESS = 2.0  # the same as a factor: strides along the line of sight are seen by a third too short
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
    At a scene cut it stays.

    :param up: (3,) unit vector.
    """
    ahead = _facing(placed, up)[placed.valid].mean(axis=0)
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-6)
    return belt_m_s * np.cumsum(steps_in_scenes(placed.times))[:, None] * ahead


def contradicting_strides(placed: PlacedTrack, up: FloatArray) -> BoolArray:
    """Return (T,) whether the strides of a motion contradict its path in each frame.

    :param up: (3,) unit vector.
    """
    times = placed.times
    contradicts = np.zeros(len(times), bool)
    if len(times) < 3 or np.ptp(times) < SHORTEST_S:
        return contradicts
    along = _ahead(placed, up)
    by_legs = gaussian_smooth(0.5 * np.abs(_velocity(along, times)), times, MEAN_HZ)
    v_pelvis = _mean_velocity(placed.root, times)
    by_path = np.linalg.norm(v_pelvis - (v_pelvis @ up)[:, None] * up, axis=1)
    walks = _reached(along, times) & _reached(-along, times)
    exceeds = (by_legs > by_path + EXCESS_M_S) & (by_legs > EXCESS * by_path)
    for first, end in runs(placed.valid & walks & exceeds):
        if times[end - 1] - times[first] >= SHORTEST_S:
            contradicts |= (times >= times[first] - MARGIN_S) & (times <= times[end - 1] + MARGIN_S)
    return contradicts


def _ahead(placed: PlacedTrack, up: FloatArray) -> FloatArray:
    """Return (T,) how far the left foot is ahead of the right one, metres."""
    apart = placed.soles[:, :2].mean(axis=1) - placed.soles[:, 2:].mean(axis=1)
    return (apart * _facing(placed, up)).sum(axis=1)


def _step_times(placed: PlacedTrack, up: FloatArray, part: slice) -> Float64Array:
    """Return when (n,) a foot overtakes the other one, in frames in which the person was seen.

    Where feet stand side by side, a foot has to be ahead by `MIN_STEP_M` before it counts.
    """
    times = placed.times[part]
    along = gaussian_smooth(_ahead(placed, up), placed.times, CUTOFF_HZ)[part]
    is_ahead = np.abs(along) > MIN_STEP_M / 2
    rows = np.flatnonzero(is_ahead & placed.valid[part])
    changes = np.flatnonzero(np.diff(np.sign(along[rows])) != 0)
    before = rows[changes]
    after = rows[changes + 1]
    share = along[before] / (along[before] - along[after])
    return times[before] + share * (times[after] - times[before])


def _facing(placed: PlacedTrack, up: FloatArray) -> FloatArray:
    """Return the (T, 3) horizontal unit vectors in which the pelvis faces."""
    ahead = placed.rotations[:, 0, :, 2]
    return unit_vectors(ahead - (ahead @ up)[:, None] * up)


def _reached(along: FloatArray, times: Float64Array) -> BoolArray:
    """Return (T,) whether a distance reaches `MIN_STEP_M` near each time."""
    reaching = times[along > MIN_STEP_M]
    after = np.searchsorted(reaching, times - ALTERNATION_S)
    before = np.searchsorted(reaching, times + ALTERNATION_S, side="right")
    return before > after


def _mean_velocity(places: FloatArray, times: Float64Array) -> Float64Array:
    """Return the velocities (T, 3) of places, averaged over a stride."""
    return gaussian_smooth(_velocity(places, times), times, MEAN_HZ)


def _velocity(values: FloatArray, times: Float64Array) -> Float64Array:
    return np.gradient(gaussian_smooth(values, times, CUTOFF_HZ), times, axis=0)
