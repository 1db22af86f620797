# SPDX-License-Identifier: GPL-3.0-or-later
"""Clocks and places of cameras from the people in front of them; who is who in the cameras.

The person whom the first camera shows most prominently is looked for in every other camera: of all
people there, the one whose motion fits best to theirs. All cameras are then adjusted together, and
the other people follow from where the cameras are.

Where cameras stand is first known roughly, from each one's own estimate of a person in 3D.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from ....solver.rotations import exp, log, nearest_rotation
from ...arrays import BoolArray, Float64Array
from ...kinematics.sequences import runs
from ..fitting.outline import spread
from .bundle import KEYPOINT_SIGMA, CameraPlace, Given, adjust, image_residual, triangulate
from .seen_person import BONE_ENDS, BONE_STARTS, SeenPerson
from .synchronize import APART_S, MOST_LIKELY, likely_offsets

# With another offset, keypoints have to fit this much worse; otherwise the offset is uncertain.
_MARGIN = 0.1
# So much worse than with an offset by motion, and the sound is not that of the pictures.
_DUBBED = 2.0
_PAIR_FRAMES = 80  # of a clip that two cameras are adjusted to
_ALL_FRAMES = 150
# Guesses are tried with so many frames first, and those kept that do not cost so much more.
_ROUGH_FRAMES = 25
_ROUGHLY = 2.0
_MOST_GUESSES = 4
# Lifted bodies lean and turn by up to 15 degrees too far, and two cameras that start from such a
# rotation can end in another minimum. So they start from several ones, turned about the person.
_TURNS = np.radians([0.0, -20.0, 20.0])
# Between a camera's rotation and that by lifted bodies: up to 19 degrees in pairs of real cameras.
MOST_TURNED = np.radians(60.0)
# Distances from rays, in standard deviations of a keypoint: of people who are the same, and of a
# camera that contradicts the others, for at least so long.
MOST_APART = 3.0
CONTRADICTS = 6.0
CONTRADICTS_S = 0.5
# Logarithm of bones' lengths, by the points of two cameras, over their usual ones: up to 0.1 in
# four pairs of real cameras, 0.2 where one of two drawn ones is mirrored.
MOST_STRETCHED = 0.15
_LEAST_KNOWN = 6  # keypoints or bones of a moment
UNSEEN_S = 1.0  # for which a person is unseen by a camera before the report says so
_ROUNDS = 10
_FAR_M = 0.15  # from which on a lifted keypoint weighs less


class Clock(StrEnum):
    """What tells a camera's clock."""

    GIVEN = "given"
    SOUND = "sound"
    MOTION = "motion"


@dataclass(frozen=True)
class Match:
    """A camera's place by the first camera's most prominent person."""

    place: CameraPlace
    cost: float  # per keypoint that was seen
    number: int  # of the person in this camera
    clock: Clock
    is_offset_certain: bool = True


def calibrate(
    people: Sequence[Sequence[SeenPerson]],
    given: Sequence[Given],
    mean_lengths: Float64Array,
    tick: Callable[[], None] = lambda: None,
) -> list[Match | None]:
    """Find clocks and places of all cameras, as far as they are not given.

    :param people: (V,) of each camera, the people that it shows, the most prominent one first.
    :param given: (V,) what is known of each camera.
    :param mean_lengths: (B,) bones of the mean body, metres.
    :param tick: called from time to time; what it raises, such as `CancelledError`, is passed on.
    :return: (V,) of each camera, the first one included; None: it could not be placed.
    """
    first = people[0][0]
    matches: list[Match | None] = [Match(CameraPlace.first(), 0.0, 0, Clock.GIVEN)]
    matches += [
        _best_match(first, seen, given[0], known, mean_lengths, tick)
        for seen, known in zip(people[1:], given[1:], strict=True)
    ]
    used = [(v, match) for v, match in enumerate(matches) if match is not None]
    if len(used) < 2:
        return matches
    bundle = adjust(
        [people[v][match.number] for v, match in used],
        [match.place for _, match in used],
        _times_of_all(first, [(people[v][match.number], match.place) for v, match in used[1:]]),
        [given[v].without_clock if match.clock == Clock.MOTION else given[v] for v, match in used],
        mean_lengths,
    )
    for (v, match), place in zip(used, bundle.cameras, strict=True):
        matches[v] = replace(match, place=place)
    return matches


@dataclass(frozen=True)
class _Guess:
    """Who in another camera may be the first one's person, and what may be its clock."""

    number: int  # of the person
    given: Given  # of the other camera
    offset_s: float
    clock: Clock


def _guesses(
    first: SeenPerson,
    people: Sequence[SeenPerson],
    given: Given,
    tick: Callable[[], None],
) -> list[_Guess]:
    """Return who another camera's people may be, and when."""
    offset_s = given.offset_s
    guesses = []
    for number, person in enumerate(people):
        if offset_s is not None:
            clock = Clock.SOUND if given.offset_sigma_s > 0 else Clock.GIVEN
            guesses.append(_Guess(number, given, offset_s, clock))
            if clock == Clock.GIVEN:
                continue
        guesses += [
            _Guess(number, given.without_clock, likely_s, Clock.MOTION)
            for likely_s in likely_offsets(first, person, tick)
        ]
    return guesses


def _best_match(
    first: SeenPerson,
    people: Sequence[SeenPerson],
    of_first: Given,
    given: Given,
    mean_lengths: Float64Array,
    tick: Callable[[], None],
) -> Match | None:
    """Return another camera's place by the one of its people who is the first camera's person; None
    if nobody may be them.

    :param of_first: what is known of the first camera. :param given: of the other one.
    """
    guesses = everything = _guesses(first, people, given, tick)

    def tried(guess: _Guess, frames: int, turns: Float64Array) -> Match | None:
        tick()
        second = people[guess.number]
        return _adjusted_pair(first, second, guess, of_first, frames, turns, mean_lengths)

    if len(guesses) > 1:
        roughly = [(tried(guess, _ROUGH_FRAMES, _TURNS[:1]), guess) for guess in guesses]
        costs = [pair.cost if pair is not None else np.inf for pair, _ in roughly]
        order = np.argsort(costs, kind="stable")[:_MOST_GUESSES]
        guesses = [guesses[k] for k in order if costs[k] < _ROUGHLY * min(costs)]
    pairs = [pair for guess in guesses if (pair := tried(guess, _PAIR_FRAMES, _TURNS)) is not None]
    if given.T_camera_first is None:
        # Whom a place would turn too far is somebody else.
        turned = [_turned_off(first, people[pair.number], pair.place) or 0.0 for pair in pairs]
        pairs = [pair for pair, off in zip(pairs, turned, strict=True) if off <= MOST_TURNED]

    def dearness(pair: Match) -> float:
        return pair.cost * (_DUBBED if pair.clock == Clock.MOTION else 1.0)

    best = min(pairs, key=dearness, default=None)
    if best is None or best.clock != Clock.MOTION:
        return best
    others = [
        pair
        for pair in pairs
        if pair.number == best.number and abs(pair.place.offset_s - best.place.offset_s) > APART_S
    ]
    # Where a person hardly moves, everything fits.
    likely = sum(
        guess.number == best.number and guess.clock == Clock.MOTION for guess in everything
    )
    is_certain = likely < MOST_LIKELY and all(
        other.cost > best.cost * (1.0 + _MARGIN) for other in others
    )
    return replace(best, is_offset_certain=is_certain)


def _adjusted_pair(
    first: SeenPerson,
    second: SeenPerson,
    guess: _Guess,
    of_first: Given,
    frames: int,
    turns: Float64Array,
    mean_lengths: Float64Array,
) -> Match | None:
    """Return the second camera's place if a guess is right; None if both hardly see the person at
    once then.

    :param frames: how many both cameras are adjusted to.
    :param turns: of the places that adjustments start from, radians.
    """
    known = guess.given
    clock = CameraPlace(np.eye(3), np.zeros(3), offset_s=guess.offset_s, drift=known.drift)
    shared = _shared_times(first, second, clock, frames)
    starts = _starts(first, second, shared, clock, known.T_camera_first, turns)
    if not len(shared) or not starts:
        return None
    adjusted = [
        adjust(
            [first, second],
            [CameraPlace.first(), start],
            shared,
            [of_first, known],
            mean_lengths,
        )
        for start in starts
    ]
    best = min(adjusted, key=lambda bundle: bundle.cost)
    return Match(best.cameras[1], best.cost / max(best.known, 1), guess.number, guess.clock)


def _starts(
    first: SeenPerson,
    second: SeenPerson,
    times: Float64Array,
    clock: CameraPlace,
    T_camera_first: Float64Array | None,
    turns: Float64Array,
) -> list[CameraPlace]:
    """Return places from which to adjust the second camera, with the clock of one; none if both
    hardly see the person at once.
    """
    if T_camera_first is not None:
        R, t = T_camera_first[:3, :3], T_camera_first[:3, 3]
        return [replace(clock, R_camera_first=R, t_camera_first=t)]
    start = first_place(first, second, times, clock)
    if start is None:
        return []
    middle = np.median(first.root[first.seen], axis=0)
    return [_turned(start, middle, turn) for turn in turns]


def _turned(place: CameraPlace, point: Float64Array, angle: float) -> CameraPlace:
    """Return a camera moved about the vertical through a point (3,) of the first camera's axes."""
    R = exp(np.array([0.0, angle, 0.0])) @ place.R_camera_first
    return replace(place, R_camera_first=R, t_camera_first=place.of(point) - R @ point)


def _shared_times(
    first: SeenPerson, second: SeenPerson, clock: CameraPlace, most: int = _PAIR_FRAMES
) -> Float64Array:
    """Return at most so many times of the first camera at which both see the person, evenly
    spread.
    """
    both = first.seen & second.at(clock.own_times(first.times)).seen
    return first.times[spread(np.flatnonzero(both), most)]


def _times_of_all(
    first: SeenPerson, others: Sequence[tuple[SeenPerson, CameraPlace]]
) -> Float64Array:
    """Return times of the first camera at which others see the person, too. Each of these cameras
    has its share of them, however long the first one films.
    """
    is_chosen = np.zeros(len(first.times), bool)
    for other, place in others:
        left = replace(first, seen=first.seen & ~is_chosen)
        own = _shared_times(left, other, place, _ALL_FRAMES // len(others))
        is_chosen |= np.isin(first.times, own)
    return first.times[is_chosen]


def adjusted_first_place(matches: Sequence[Match | None]) -> CameraPlace:
    """Return the first camera's place, whose focal length may have been adjusted with those of
    others.
    """
    return matches[0].place if matches[0] is not None else CameraPlace.first()


def same_people(
    people: Sequence[Sequence[SeenPerson]], matches: Sequence[Match | None]
) -> list[list[int | None]]:
    """Return, for each person of the first camera, the same person's number in each camera.

    :return: of each person, (V,) numbers; None: not found there.
    """
    V = len(people)
    first = adjusted_first_place(matches)
    found: list[list[int | None]] = [[k] + [None] * (V - 1) for k in range(len(people[0]))]
    for v in range(1, V):
        match = matches[v]
        if match is None:
            continue
        cameras = first, match.place
        distances = np.array(
            [[apart(one, other, cameras) for other in people[v]] for one in people[0]]
        ).reshape(len(people[0]), len(people[v]))
        distances[0, :] = np.inf
        distances[:, match.number] = np.inf
        distances[0, match.number] = 0.0
        while distances.size and distances.min() < MOST_APART:
            k, number = np.unravel_index(int(distances.argmin()), distances.shape)
            found[int(k)][v] = int(number)
            distances[k, :] = np.inf
            distances[:, number] = np.inf
    return found


def apart(one: SeenPerson, other: SeenPerson, cameras: tuple[CameraPlace, CameraPlace]) -> float:
    """Return the median distance from the rays of two people's keypoints, taken for one person, in
    standard deviations; infinity where both are never seen together.

    :param cameras: the first one, whose focal length may be adjusted, and the other one.
    """
    at, points, both = _common_points(one, other, cameras)
    off = [_distance(each, camera, points) for each, camera in zip(at, cameras, strict=True)]
    return float(np.median(np.maximum(*off)[both])) if both.any() else np.inf


def contradicts(
    one: SeenPerson, other: SeenPerson, cameras: tuple[CameraPlace, CameraPlace]
) -> bool:
    """Return whether one person, as the first and another camera see them, speaks against that
    camera's place: rays pass each other, or the body is turned otherwise.

    Cameras of equal height that were exchanged have rays that meet, in a wrong place. Where both
    hardly see the person at once, nothing speaks against it.
    """
    off = _turned_off(one, other, cameras[1])
    return off is not None and (off > MOST_TURNED or apart(one, other, cameras) > MOST_APART)


def _turned_off(one: SeenPerson, other: SeenPerson, place: CameraPlace) -> float | None:
    """Return the angle between a camera's rotation and that by lifted bodies, radians; None where
    both hardly see the person at once.
    """
    turned = first_place(one, other, _shared_times(one, other, place), place)
    if turned is None:
        return None
    return float(np.linalg.norm(log(turned.R_camera_first @ place.R_camera_first.T)))


def relative_distance(
    one: SeenPerson, other: SeenPerson, cameras: tuple[CameraPlace, CameraPlace]
) -> float:
    """Return how far a person is from the first camera by both cameras' rays, divided by how far
    by the usual size of people.
    """
    at, points, both = _common_points(one, other, cameras)
    if not both.any():
        return 1.0
    usual = np.exp(cameras[0].log_focal) * np.median(at[0].root[:, 2])
    return float(np.median(points[both][:, 2]) / usual)


def _common_points(
    one: SeenPerson, other: SeenPerson, cameras: tuple[CameraPlace, CameraPlace]
) -> tuple[tuple[SeenPerson, SeenPerson], Float64Array, BoolArray]:
    """Return a person at times at which the first and another camera see them, as both do, and
    `_keypoints_by_rays` of both.
    """
    place = cameras[1]
    times = _shared_times(one, other, place)
    at = one.at(times), other.at(place.own_times(times))
    return at, *_keypoints_by_rays(at, cameras)


def _keypoints_by_rays(
    at: Sequence[SeenPerson], cameras: Sequence[CameraPlace]
) -> tuple[Float64Array, BoolArray]:
    """Return the keypoints (N, n, 3) of a person whom cameras see at the same N times, first
    camera's axes, and (N, n) whether at least two cameras see each.
    """
    confidence = np.array([each.confidence for each in at])
    rays = np.array([each.rays for each in at])
    return triangulate(rays, confidence, cameras), (confidence > 0).sum(axis=0) >= 2


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
    used = [
        (v, person, place)
        for v, (person, place) in enumerate(zip(people, places, strict=True))
        if person is not None and place is not None
    ]
    spans: list[list[tuple[float, float]]] = [[] for _ in people]
    if len(used) < 2:
        return spans
    times = used[0][1].times
    at = [person.at(place.own_times(times)) for _, person, place in used]
    cameras = [place for *_, place in used]
    error = np.array([_error_without(at, cameras, k) for k in range(len(used))])
    if len(used) == 2:
        wrong = np.stack([np.zeros(len(times), bool), error[1] > CONTRADICTS])
    else:
        worst = error.argmax(axis=0)
        wrong = (np.arange(len(used))[:, None] == worst) & (error > CONTRADICTS)
    for k, (v, *_) in enumerate(used):
        spans[v] = _long_spans(wrong[k], times, CONTRADICTS_S)
    return spans


def unseen_spans(
    first: SeenPerson, other: SeenPerson, place: CameraPlace
) -> list[tuple[float, float]]:
    """Return when the first camera shows a person, and another one films without showing them: for
    at least `UNSEEN_S`, by the first camera's clock, seconds.
    """
    own_times = place.own_times(first.times)
    films = (own_times >= other.times[0]) & (own_times <= other.times[-1])
    missed = films & first.seen & ~other.at(own_times).seen
    return _long_spans(missed, first.times, UNSEEN_S)


def _error_without(
    at: Sequence[SeenPerson], cameras: Sequence[CameraPlace], k: int
) -> Float64Array:
    """Return the median distance (N,) of camera k's keypoints from those of the others, in standard
    deviations. Zero where too little is seen.

    Two cameras have the common points alone, of which each is half as far from either. These fit
    to both also where one shows somebody else beside the person, at the same height, but then bones
    have other lengths than otherwise.
    """
    is_pair = len(at) == 2
    others = [v for v in range(len(at)) if is_pair or v != k]
    points, known = _keypoints_by_rays([at[v] for v in others], [cameras[v] for v in others])
    known &= at[k].confidence > 0
    distance = _distance(at[k], cameras[k], points)
    error = np.zeros(len(distance))
    for row in np.flatnonzero(known.sum(axis=1) >= _LEAST_KNOWN):
        error[row] = np.median(distance[row, known[row]])
    if not is_pair:
        return error
    return np.maximum(2.0 * error, CONTRADICTS * _stretch(points, known) / MOST_STRETCHED)


def _stretch(points: Float64Array, known: BoolArray) -> Float64Array:
    """Return by how much bones are too long or too short (N,), as the median of logarithms, by
    points (N, n, 3). Zero where fewer than `_LEAST_KNOWN` are known.
    """
    length = np.linalg.norm(points[:, BONE_ENDS] - points[:, BONE_STARTS], axis=-1)
    both = known[:, BONE_ENDS] & known[:, BONE_STARTS]
    logarithm = np.log(np.maximum(length, 1e-3))
    usual = np.array(
        [
            np.median(logarithm[both[:, row], row]) if both[:, row].any() else 0.0
            for row in range(len(BONE_STARTS))
        ]
    )
    change = np.abs(logarithm - usual)
    stretch = np.zeros(len(points))
    for row in np.flatnonzero(both.sum(axis=1) >= _LEAST_KNOWN):
        stretch[row] = np.median(change[row, both[row]])
    return stretch


def _long_spans(wrong: BoolArray, times: Float64Array, least_s: float) -> list[tuple[float, float]]:
    """Return the spans of at least so many seconds, with short pauses closed."""
    spans: list[list[float]] = []
    for first, end in runs(wrong):
        start, stop = float(times[first]), float(times[end - 1])
        if spans and start - spans[-1][1] < least_s:
            spans[-1][1] = stop
        else:
            spans.append([start, stop])
    return [(start, stop) for start, stop in spans if stop - start >= least_s]


def first_place(
    first: SeenPerson, second: SeenPerson, times: Float64Array, clock: CameraPlace
) -> CameraPlace | None:
    """Return the second camera's place in the first one's axes; None if both hardly see the person
    at once.

    The rotation is the one that turns all lifted bodies of the first camera into those of the
    second one, and the translation joins their hips, both by weights that fall with the distance.

    :param times: (N,) of the first camera's clock, seconds.
    :param clock: a place with the second camera's clock.
    """
    a = first.at(times)
    b = second.at(clock.own_times(times))
    both = a.seen & b.seen
    if both.sum() < 3:
        return None
    start = a.points[both].reshape(-1, 3)
    end = b.points[both].reshape(-1, 3)
    confidence = np.minimum(a.confidence, b.confidence)[both].ravel()
    weight = confidence
    R = np.eye(3)
    for _ in range(_ROUNDS):
        R = nearest_rotation((end * weight[:, None]).T @ start)
        error = np.linalg.norm(end - start @ R.T, axis=-1)
        weight = confidence / (1.0 + np.square(error / _FAR_M))
    moves = b.root[both] - a.root[both] @ R.T
    return replace(clock, R_camera_first=R, t_camera_first=np.median(moves, axis=0))
