# SPDX-License-Identifier: GPL-3.0-or-later
"""Clocks and places of cameras from the people in front of them; who is who in the cameras.

The person whom the first camera shows most prominently is looked for in every other camera: of all
people there, the one whose motion fits best to theirs. All cameras are then adjusted together, and
the other people follow from where the cameras are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....solver.rotations import exp, log
from ...arrays import BoolArray, Float64Array
from ...kinematics.runs import runs
from ..fitting.track_fit import spread
from .bundle import KEYPOINT_SIGMA, CameraPlace, Given, adjust, image_residual, triangulate
from .first_places import first_place
from .seen_person import SeenPerson
from .synchronize import Offset, offset_between

LONGEST_OFFSET_S = 60.0
_PAIR_FRAMES = 80  # of a clip that two cameras are adjusted to
_ALL_FRAMES = 150
# Lifted bodies lean and turn by up to 15 degrees too far, and two cameras that start from such a
# rotation can end in another minimum. So they start from several ones, turned about the person.
_TURNS = np.radians([0.0, -20.0, 20.0])
# Between a given rotation of a camera and that by lifted bodies.
MOST_TURNED = np.radians(60.0)
# Distances from rays, in standard deviations of a keypoint: of people who are the same, and of a
# camera that contradicts the others, for at least so long.
MOST_APART = 3.0
CONTRADICTS = 6.0
CONTRADICTS_S = 0.5


@dataclass(frozen=True)
class Calibration:
    """What the cameras say about each other. V cameras, the first one included."""

    places: list[CameraPlace | None]  # (V,); None: the camera could not be placed
    # (V,) the number of the first camera's most prominent person in each camera
    main: list[int | None]
    is_offset_certain: list[bool]  # (V,)


def calibrate(
    people: Sequence[Sequence[SeenPerson]],
    given: Sequence[Given],
    mean_lengths: Float64Array,
) -> Calibration:
    """Find clocks and places of all cameras, as far as they are not given.

    :param people: (V,) of each camera, the people that it shows, the most prominent one first.
    :param given: (V,) what is known of each camera.
    :param mean_lengths: (B,) bones of the mean body, metres.
    """
    first = people[0][0]
    places: list[CameraPlace | None] = [CameraPlace.first()]
    main: list[int | None] = [0]
    certain = [True]
    for v in range(1, len(people)):
        known = (given[0], given[v])
        found = [
            (pair, number)
            for number, person in enumerate(people[v])
            if (pair := _pair(first, person, known, mean_lengths)) is not None
        ]
        best, number = min(found, key=lambda each: each[0].cost, default=(None, None))
        places.append(best.place if best is not None else None)
        main.append(number)
        certain.append(best.is_offset_certain if best is not None else False)
    used = [v for v, place in enumerate(places) if place is not None]
    if len(used) < 2:
        return Calibration(places, main, certain)
    bundle = adjust(
        [people[v][main[v] or 0] for v in used],
        [place for place in places if place is not None],
        _times(first, _ALL_FRAMES),
        [given[v] for v in used],
        mean_lengths,
    )
    for v, place in zip(used, bundle.cameras, strict=True):
        places[v] = place
    return Calibration(places, main, certain)


@dataclass(frozen=True)
class _Pair:
    """Another camera's place from one person, and the cost per keypoint that was seen."""

    place: CameraPlace
    is_offset_certain: bool
    cost: float


def _pair(
    first: SeenPerson,
    second: SeenPerson,
    given: tuple[Given, Given],
    mean_lengths: Float64Array,
) -> _Pair | None:
    """Return the second camera's place, if both may have seen the same person."""
    offset_s = given[1].offset_s
    if offset_s is not None:
        offset = Offset(offset_s, is_certain=True)
    elif (found := offset_between(first, second, LONGEST_OFFSET_S)) is not None:
        offset = found
    else:
        return None
    shared = _shared_times(first, second, offset.seconds)
    starts = _starts(first, second, shared, offset.seconds, given[1].T_camera_first)
    if not len(shared) or not starts:
        return None
    adjusted = [
        adjust([first, second], [CameraPlace.first(), start], shared, given, mean_lengths)
        for start in starts
    ]
    best = min(adjusted, key=lambda bundle: bundle.cost)
    return _Pair(best.cameras[1], offset.is_certain, best.cost / max(best.known, 1))


def _starts(
    first: SeenPerson,
    second: SeenPerson,
    times: Float64Array,
    offset_s: float,
    T_camera_first: Float64Array | None,
) -> list[CameraPlace]:
    """Return places from which to adjust the second camera; none if both hardly see the person at
    once.
    """
    if T_camera_first is not None:
        return [CameraPlace(T_camera_first[:3, :3], T_camera_first[:3, 3], offset_s=offset_s)]
    start = first_place(first, second, times, offset_s)
    if start is None:
        return []
    middle = np.median(first.root[first.seen], axis=0)
    return [_turned(start, middle, turn) for turn in _TURNS]


def _turned(place: CameraPlace, point: Float64Array, angle: float) -> CameraPlace:
    """Return a camera moved about the vertical through a point (3,) of the first camera's axes."""
    R = exp(np.array([0.0, angle, 0.0])) @ place.R_camera_first
    return replace(place, R_camera_first=R, t_camera_first=place.of(point) - R @ point)


def _times(person: SeenPerson, most: int) -> Float64Array:
    """Return at most so many times at which the person is seen, evenly spread."""
    times: Float64Array = person.times[spread(np.flatnonzero(person.seen), most)]
    return times


def _shared_times(first: SeenPerson, second: SeenPerson, offset_s: float) -> Float64Array:
    """Return times of the first camera at which both see the person."""
    both = first.seen & second.at(first.times + offset_s).seen
    return _times(replace(first, seen=both), _PAIR_FRAMES)


def same_people(
    people: Sequence[Sequence[SeenPerson]], calibration: Calibration
) -> list[list[int | None]]:
    """Return, for each person of the first camera, the same person's number in each camera.

    :return: of each person, (V,) numbers; None: not found there.
    """
    V = len(people)
    found: list[list[int | None]] = [[k] + [None] * (V - 1) for k in range(len(people[0]))]
    for v in range(1, V):
        place = calibration.places[v]
        if place is None:
            continue
        distances = np.array(
            [[apart(one, other, place) for other in people[v]] for one in people[0]]
        ).reshape(len(people[0]), len(people[v]))
        main = calibration.main[v]
        if main is not None:
            distances[0, :] = np.inf
            distances[:, main] = np.inf
            distances[0, main] = 0.0
        while distances.size and distances.min() < MOST_APART:
            k, number = np.unravel_index(int(distances.argmin()), distances.shape)
            found[int(k)][v] = int(number)
            distances[k, :] = np.inf
            distances[:, number] = np.inf
    return found


def apart(one: SeenPerson, other: SeenPerson, place: CameraPlace) -> float:
    """Return the median distance from the rays of two people's keypoints, taken for one person, in
    standard deviations; infinity where both are never seen together.
    """
    at, points = _common_points(one, other, place)
    cameras = CameraPlace.first(), place
    off = [_distance(each, camera, points) for each, camera in zip(at, cameras, strict=True)]
    both = (at[0].confidence > 0) & (at[1].confidence > 0)
    return float(np.median(np.maximum(*off)[both])) if both.any() else np.inf


def contradicts(one: SeenPerson, other: SeenPerson, place: CameraPlace) -> bool:
    """Return whether one person, as the first and another camera see them, speaks against that
    camera's place: rays pass each other, or the body is turned otherwise.

    Cameras of equal height that were exchanged have rays that meet, in a wrong place.
    """
    turned = first_place(one, other, _shared_times(one, other, place.offset_s), place.offset_s)
    if turned is None:
        return False
    angle = float(np.linalg.norm(log(turned.R_camera_first @ place.R_camera_first.T)))
    return angle > MOST_TURNED or apart(one, other, place) > MOST_APART


def relative_distance(one: SeenPerson, other: SeenPerson, place: CameraPlace) -> float:
    """Return how far a person is from the first camera by both cameras' rays, divided by how far
    by the usual size of people.
    """
    at, points = _common_points(one, other, place)
    both = (at[0].confidence > 0) & (at[1].confidence > 0)
    if not both.any():
        return 1.0
    return float(np.median(points[both][:, 2]) / np.median(at[0].root[:, 2]))


def _common_points(
    one: SeenPerson, other: SeenPerson, place: CameraPlace
) -> tuple[tuple[SeenPerson, SeenPerson], Float64Array]:
    """Return a person at times at which the first and another camera see them, as both do, and the
    keypoints (N, n, 3) by the rays of both, first camera's axes.
    """
    times = _shared_times(one, other, place.offset_s)
    at = one.at(times), other.at(times + place.offset_s)
    confidence = np.array([each.confidence for each in at])
    rays = np.array([each.rays for each in at])
    return at, triangulate(rays, confidence, [CameraPlace.first(), place])


def _distance(person: SeenPerson, camera: CameraPlace, points: Float64Array) -> Float64Array:
    """Return the distances (N, n) of points from a person's rays, in standard deviations."""
    residual, depth = image_residual(person.rays, camera, points)
    return np.where(depth > 0, np.linalg.norm(residual, axis=-1) / KEYPOINT_SIGMA, np.inf)


def contradicting_spans(
    people: Sequence[SeenPerson | None], places: Sequence[CameraPlace | None]
) -> list[list[tuple[float, float]]]:
    """Return when a camera contradicts the others, by the first camera's clock, seconds.

    At every moment, the keypoints are triangulated without each camera in turn; a camera
    contradicts where its own keypoints are far from those of the others, and these agree without
    it. With two cameras nobody can tell which one is wrong: the second one counts as such.

    :param people: (V,) one person as each camera sees them; None: not found there.
    :param places: (V,) of the cameras.
    """
    used = [v for v, each in enumerate(people) if each is not None and places[v] is not None]
    spans: list[list[tuple[float, float]]] = [[] for _ in people]
    first = people[0]
    if len(used) < 2 or first is None:
        return spans
    times = first.times
    at = [people[v].at(times + places[v].offset_s) for v in used]  # type: ignore[union-attr]
    cameras = [places[v] for v in used]
    error = np.array([_error_without(at, cameras, k) for k in range(len(used))])
    if len(used) == 2:
        wrong = np.stack([np.zeros(len(times), bool), error[1] > CONTRADICTS])
    else:
        worst = error.argmax(axis=0)
        wrong = (np.arange(len(used))[:, None] == worst) & (error > CONTRADICTS)
    for k, v in enumerate(used):
        spans[v] = _long_spans(wrong[k], times)
    return spans


def _error_without(
    at: Sequence[SeenPerson], cameras: Sequence[CameraPlace | None], k: int
) -> Float64Array:
    """Return the median distance (N,) of camera k's keypoints from those of the others; with two
    cameras, of both from their common points. Zero where too little is seen.
    """
    others = [v for v in range(len(at)) if v != k] if len(at) > 2 else list(range(len(at)))
    confidence = np.array([at[v].confidence for v in others])
    rays = np.array([at[v].rays for v in others])
    places = [cameras[v] for v in others]
    points = triangulate(rays, confidence, places)  # type: ignore[arg-type]
    known = ((confidence > 0).sum(axis=0) >= 2) & (at[k].confidence > 0)
    distance = _distance(at[k], cameras[k], points)  # type: ignore[arg-type]
    error = np.zeros(len(distance))
    for row in np.flatnonzero(known.sum(axis=1) >= 6):
        error[row] = np.median(distance[row, known[row]])
    return error


def _long_spans(wrong: BoolArray, times: Float64Array) -> list[tuple[float, float]]:
    """Return the spans of at least `CONTRADICTS_S`, with short pauses closed."""
    spans: list[list[float]] = []
    for first, end in runs(wrong):
        start, stop = float(times[first]), float(times[end - 1])
        if spans and start - spans[-1][1] < CONTRADICTS_S:
            spans[-1][1] = stop
        else:
            spans.append([start, stop])
    return [(start, stop) for start, stop in spans if stop - start >= CONTRADICTS_S]
