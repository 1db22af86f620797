# SPDX-License-Identifier: GPL-3.0-or-later
"""Clocks, cameras and people of several views: made scenes whose truth is exact."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scope.scope_addon.capture.fitting.keypoint_offsets import with_keypoint_offsets
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.several_views import bundle
from scope.scope_addon.capture.several_views import calibrate as calibration
from scope.scope_addon.capture.several_views.bundle import CameraPlace, Given, adjust
from scope.scope_addon.capture.several_views.calibrate import (
    Clock,
    Match,
    _times_of_all,
    calibrate,
    contradicting_spans,
    contradicts,
    relative_distance,
    same_people,
)
from scope.scope_addon.capture.several_views.seen_person import (
    KEYPOINTS,
    Between,
    SeenPerson,
    bone_lengths,
)
from scope.scope_addon.capture.several_views.synchronize import likely_offsets
from scope.scope_addon.errors import CancelledError
from scope.solver import load_body, rotations

SECONDS = 4.0


@cache
def moving_points(seed=0, center=(0.0, 0.0, 4.0)):
    """Return a function of time that gives the keypoints (n, 3) of somebody who waves and steps, in
    the first camera's axes.
    """
    body = with_keypoint_offsets(load_body("scope"))
    at = body.keypoint_set("blazepose")
    indices = [at[KEYPOINT_NAMES[k]] for k in KEYPOINTS]
    rng = np.random.default_rng(seed)
    names = [f"{side}_{name}" for side in ("left", "right") for name in ("shoulder", "hip")]
    names += [f"{side}_{name}" for side in ("left", "right") for name in ("elbow", "knee")]
    parts = [body.joint_names.index(name) for name in names]
    amplitude = rng.uniform(-0.6, 0.6, (len(parts), 3, 3))
    phase = rng.uniform(0, 2 * np.pi, (len(parts), 3, 3))
    speed = np.array([1.1, 2.3, 4.1])

    @cache
    def points(time_s):
        omega = np.tile(np.eye(3), (body.K + 1, 1, 1))
        wave = np.sin(speed * time_s + phase)
        omega[parts] = rotations.exp(0.5 * (amplitude * wave).sum(axis=2))
        turn = rotations.exp(np.array([0.0, 0.5 * np.sin(0.9 * time_s), 0.0]))
        omega[0] = rotations.exp(np.array([np.pi, 0.0, 0.0])) @ turn
        walk = np.array([0.4 * np.sin(0.8 * time_s), 0.0, 0.4 * np.cos(1.1 * time_s)])
        root = np.asarray(center) + walk
        R, t = body.forward_kinematics(omega, root - body.rest_joints()[0])
        return body.keypoints(R, t, which=indices)

    return points


@cache
def mean_lengths():
    body = with_keypoint_offsets(load_body("scope"))
    at = body.keypoint_set("blazepose")
    indices = [at[KEYPOINT_NAMES[k]] for k in KEYPOINTS]
    identity = np.tile(np.eye(3), (body.K + 1, 1, 1))
    return bone_lengths(body.keypoints(identity, body.rest_joints(), which=indices))


def beside(degrees, distance_m=4.0):
    """Return the place of a camera that looks at the person from so many degrees to the side."""
    R = rotations.exp(np.array([0.0, np.radians(degrees), 0.0]))
    middle = np.array([0.0, 0.0, 4.0])
    return CameraPlace(R, np.array([0.0, 0.0, distance_m]) - R @ middle)


def seen(place, points, rate, noise=0.001, lean_deg=8.0, seed=1, own=None):
    """Return what a camera sees, whose clock is ``place.offset_s`` ahead; its lifted body leans."""
    rng = np.random.default_rng(seed)
    own = np.arange(int(SECONDS * rate)) / rate if own is None else own
    inside = np.array([place.of(points(place.first_times(time_s))) for time_s in own])
    rays = np.exp(place.log_focal) * inside[..., :2] / inside[..., 2:]
    rays = rays + rng.normal(0.0, noise, rays.shape)
    root = inside[:, 6:8].mean(axis=1)
    lean = rotations.exp(np.array([np.radians(lean_deg), 0.0, 0.0]))
    lifted = (inside - root[:, None]) @ lean.T
    # As far as somebody of this size is by the assumed focal length.
    far = root * rng.normal(1.0, 0.02, (len(own), 1)) / np.exp(place.log_focal)
    everything = np.ones(rays.shape[:2])
    return SeenPerson(own, np.ones(len(own), bool), rays, everything, lifted, far)


def angle_deg(R, R_true):
    return float(np.degrees(np.linalg.norm(rotations.log(R @ R_true.T))))


@pytest.mark.parametrize(("offset_s", "rate"), [(0.0, 30.0), (0.73, 60.0), (-1.21, 24.0)])
def test_offset_of_clocks(offset_s, rate):
    points = moving_points()
    first = seen(CameraPlace.first(), points, 30.0)
    place = replace(beside(60.0), offset_s=offset_s)
    second = seen(place, points, rate, seed=2)
    found = likely_offsets(first, second)
    assert found[0] == pytest.approx(offset_s, abs=0.05)


def test_offset_of_clocks_at_low_frame_rates():
    points = moving_points()
    first = seen(CameraPlace.first(), points, 6.0)
    second = seen(replace(beside(60.0), offset_s=0.5), points, 5.0, seed=2)
    assert likely_offsets(first, second)[0] == pytest.approx(0.5, abs=0.06)


def test_a_frame_that_is_missing_is_a_gap_at_low_frame_rates():
    own = np.array([0.0, 0.2, 0.4, 0.8, 1.0, 1.2])
    between = Between.of(own, np.ones(6, bool), np.array([0.1, 0.4, 0.6, 1.1]))
    assert between.seen.tolist() == [True, True, False, True]


def test_waiting_for_the_clock_can_be_cancelled():
    points = moving_points()

    def cancelled():
        raise CancelledError

    first = seen(CameraPlace.first(), points, 30.0)
    second = seen(beside(60.0), points, 30.0, seed=2)
    with pytest.raises(CancelledError):
        calibrate(
            [[first], [second]], [Given(0.1, offset_s=0.0), Given(0.1)], mean_lengths(), cancelled
        )


def test_offset_of_somebody_who_stands_still_is_uncertain():
    still = moving_points()(0.0)
    own = np.arange(60) / 30.0
    first = seen(CameraPlace.first(), lambda _: still, 30.0, own=own)
    second = seen(beside(60.0), lambda _: still, 30.0, seed=2, own=own)
    found = calibrate([[first], [second]], [Given(), Given()], mean_lengths())
    assert not found[1].is_offset_certain


def test_drift_of_clocks():
    """A clock that goes faster, over twenty minutes of which a few frames are seen."""
    points = moving_points()
    truth = replace(beside(70.0), offset_s=0.3, drift=1.5e-4)
    times = np.linspace(1.0, 1200.0, 80)
    around = (times[:, None] + np.arange(-6, 7) / 30.0).ravel()
    first = seen(CameraPlace.first(), points, 30.0, own=around)
    second = seen(truth, points, 30.0, seed=2, own=around + 0.3)
    start = replace(truth, drift=0.0)
    places = [CameraPlace.first(), start]
    found = adjust([first, second], places, times, [Given(), Given()], mean_lengths()).cameras[1]
    assert found.drift == pytest.approx(truth.drift, abs=4e-5)
    assert found.own_times(600.0) == pytest.approx(truth.own_times(600.0), abs=0.005)
    assert truth.first_times(truth.own_times(600.0)) == pytest.approx(600.0)


def test_gradient_is_that_of_the_cost():
    points = moving_points()
    people = [seen(CameraPlace.first(), points, 30.0), seen(beside(70.0), points, 30.0)]
    places = [CameraPlace.first(), replace(beside(65.0), log_focal=0.05, offset_s=0.01)]
    times = people[0].times[10:40:10]
    problem = bundle._Problem(people, times, places, [Given(0.1)] * 2, 1.1 * mean_lengths())
    rng = np.random.default_rng(0)
    start = np.array([points(time_s) for time_s in times]) + rng.normal(0, 0.03, (3, 16, 3))
    now = bundle._Unknowns(places, mean_lengths(), start)
    system = problem.linearize(now)
    free = np.flatnonzero(problem.is_free)
    # Rays are linear between frames, so that their speed is not a derivative at a frame.
    for k in free[(free >= 18) | (free % 9 < 7)]:
        step = np.zeros(len(problem.is_free))
        step[k] = 1e-6
        nothing = np.zeros_like(start)
        rise = problem.cost(now.moved(step, nothing, problem.mean_s)) - problem.cost(
            now.moved(-step, nothing, problem.mean_s)
        )
        assert rise / 4e-6 == pytest.approx(system.g_global[k], rel=1e-4, abs=1e-2)
    direction = rng.normal(size=start.shape)
    nothing = np.zeros(len(problem.is_free))
    rise = problem.cost(now.moved(nothing, 1e-6 * direction, problem.mean_s))
    rise -= problem.cost(now.moved(nothing, -1e-6 * direction, problem.mean_s))
    slope = (system.g_points.reshape(start.shape) * direction).sum()
    assert rise / 4e-6 == pytest.approx(slope, rel=1e-4)


@pytest.mark.parametrize("degrees", [45.0, 100.0])
def test_cameras_are_found_from_the_people(degrees):
    points = moving_points()
    truth = replace(beside(degrees, 5.0), offset_s=0.42, log_focal=0.08)
    people = [[seen(CameraPlace.first(), points, 30.0)], [seen(truth, points, 59.94, seed=2)]]
    found = calibrate(people, [Given(), Given(0.2)], mean_lengths())
    place = found[1].place
    assert angle_deg(place.R_camera_first, truth.R_camera_first) < 1.0
    assert place.offset_s == pytest.approx(0.42, abs=0.008)
    assert place.log_focal == pytest.approx(0.08, abs=0.03)
    baseline = place.center @ truth.center
    baseline /= np.linalg.norm(place.center) * np.linalg.norm(truth.center)
    assert np.degrees(np.arccos(min(baseline, 1.0))) < 2.0
    assert np.linalg.norm(place.center) == pytest.approx(np.linalg.norm(truth.center), rel=0.03)


def test_lengths_of_bones_tell_the_angle_between_distant_cameras():
    """Without them, cameras that hardly see perspective stay where they started."""
    points = moving_points()
    truth = beside(60.0, 12.0)
    far = replace(CameraPlace.first(), t_camera_first=np.array([0.0, 0.0, 8.0]))
    people = [seen(far, points, 30.0, noise=0.0003), seen(truth, points, 30.0, noise=0.0003)]
    R_second_first = truth.R_camera_first @ far.R_camera_first.T
    t_second_first = truth.t_camera_first - R_second_first @ far.t_camera_first
    middle = np.array([0.0, 0.0, 12.0])
    R = rotations.exp(np.array([0.0, np.radians(12.0), 0.0])) @ R_second_first
    t = R_second_first @ middle + t_second_first - R @ middle
    start = [CameraPlace.first(), CameraPlace(R, t)]
    times = people[0].times[::2]
    found = adjust(people, start, times, [Given(), Given()], mean_lengths()).cameras[1]
    assert angle_deg(found.R_camera_first, R_second_first) < 1.5


def given_place(place):
    T = np.eye(4)
    T[:3, :3] = place.R_camera_first
    T[:3, 3] = place.t_camera_first
    return T


def test_what_is_given_of_a_camera_stays_and_the_rest_is_found():
    points = moving_points()
    truth = replace(beside(80.0), offset_s=0.42)
    people = [[seen(CameraPlace.first(), points, 30.0)], [seen(truth, points, 59.94, seed=2)]]
    placed = Given(T_camera_first=given_place(truth))
    place = calibrate(people, [Given(), placed], mean_lengths())[1].place
    np.testing.assert_allclose(place.R_camera_first, truth.R_camera_first, atol=1e-12)
    np.testing.assert_allclose(place.t_camera_first, truth.t_camera_first, atol=1e-12)
    assert place.offset_s == pytest.approx(0.42, abs=0.008)
    place = calibrate(people, [Given(), Given(offset_s=0.42)], mean_lengths())[1].place
    assert place.offset_s == 0.42
    assert angle_deg(place.R_camera_first, truth.R_camera_first) < 1.0


@pytest.mark.parametrize("log_focal", [0.0, 0.25])
def test_given_places_are_compared_with_the_people(log_focal):
    points = moving_points()
    camera = replace(CameraPlace.first(), log_focal=log_focal)
    truth = beside(80.0)
    first = seen(camera, points, 30.0)
    second = seen(truth, points, 30.0, seed=2)
    assert not contradicts(first, second, (camera, truth))
    assert relative_distance(first, second, (camera, truth)) == pytest.approx(1.0, abs=0.1)
    assert contradicts(first, second, (camera, beside(-80.0)))
    turn = rotations.exp(np.radians([2.0, 0.0, 0.0]))
    moved = CameraPlace(turn @ truth.R_camera_first, turn @ truth.t_camera_first)
    assert contradicts(first, second, (camera, moved))
    millimetres = replace(truth, t_camera_first=1000.0 * truth.t_camera_first)
    size = relative_distance(first, second, (camera, millimetres))
    assert size == pytest.approx(1000.0, rel=0.1)


def test_people_are_recognized_with_the_focal_length_that_was_found_of_the_first_camera():
    left, right = moving_points(0), moving_points(3, (0.9, 0.0, 4.5))
    places = [replace(CameraPlace.first(), log_focal=0.25), replace(beside(70.0), log_focal=0.25)]
    people = [[seen(place, each, 30.0) for each in (left, right)] for place in places]
    matches = [Match(place, 0.0, 0, Clock.GIVEN) for place in places]
    assert same_people(people, matches) == [[0, 0], [1, 1]]


def test_people_are_recognized_by_where_they_are():
    left, right = moving_points(0), moving_points(3, (0.9, 0.0, 4.5))
    truth = replace(beside(70.0), offset_s=0.2)
    first = [seen(CameraPlace.first(), each, 30.0) for each in (left, right)]
    second = [seen(truth, each, 30.0, seed=5) for each in (right, left)]
    people = [first, second]
    found = calibrate(people, [Given(), Given()], mean_lengths())
    assert [match.number for match in found] == [0, 1]
    assert same_people(people, found) == [[0, 1], [1, 0]]


@pytest.mark.parametrize(("degrees", "is_placed"), [(80.0, True), (-80.0, False)])
def test_a_camera_of_which_the_person_would_face_another_way_has_no_place(
    monkeypatch, degrees, is_placed
):
    """As where it shows somebody else alone."""
    points = moving_points()
    first = seen(CameraPlace.first(), points, 30.0)
    second = seen(beside(80.0), points, 30.0, seed=2)
    adjusted = Match(beside(degrees), 1.0, 0, Clock.GIVEN)
    monkeypatch.setattr(calibration, "_adjusted_pair", lambda *_: adjusted)
    known = Given(offset_s=0.0)
    found = calibrate([[first], [second]], [known, known], mean_lengths())
    assert (found[1] is not None) == is_placed


def test_who_would_face_another_way_makes_room_for_somebody_who_fits(monkeypatch):
    points = moving_points()
    first = seen(CameraPlace.first(), points, 30.0)
    second = [seen(beside(80.0), points, 30.0, seed=seed) for seed in (2, 3)]
    degrees = [-80.0, 80.0]

    def adjusted(first, second, guess, *_):
        cost = 1.0 + 0.2 * guess.number
        return Match(beside(degrees[guess.number]), cost, guess.number, Clock.GIVEN)

    monkeypatch.setattr(calibration, "_adjusted_pair", adjusted)
    known = Given(offset_s=0.0)
    found = calibrate([[first], second], [known, known], mean_lengths())
    assert found[1].number == 1


def test_a_person_whom_two_cameras_never_show_at_once_contradicts_no_place():
    points = moving_points()
    first = seen(CameraPlace.first(), points, 30.0)
    second = seen(beside(80.0), points, 30.0, seed=2)
    cameras = CameraPlace.first(), replace(beside(80.0), offset_s=1000.0)
    assert not contradicts(first, second, cameras)
    assert contradicts(first, second, (CameraPlace.first(), beside(-80.0)))


def test_every_camera_has_its_share_of_the_times_that_all_are_adjusted_to():
    points = moving_points()
    first = seen(CameraPlace.first(), points, 30.0, own=np.arange(600) / 10.0)
    long = seen(beside(60.0), points, 30.0, own=np.arange(600) / 10.0)
    short = seen(beside(-60.0), points, 30.0, own=20.0 + np.arange(80) / 10.0)
    times = _times_of_all(first, [(long, beside(60.0)), (short, beside(-60.0))])
    assert len(times) <= 150
    assert np.sum((times >= 20.0) & (times < 28.0)) >= 75


def test_somebody_else_is_nobody_in_the_other_camera():
    left, right = moving_points(0), moving_points(3, (0.9, 0.0, 4.5))
    truth = beside(70.0)
    people = [
        [seen(CameraPlace.first(), each, 30.0) for each in (left, right)],
        [seen(truth, left, 30.0, seed=5)],
    ]
    found = calibrate(people, [Given(), Given()], mean_lengths())
    assert same_people(people, found) == [[0, 0], [1, None]]


def test_a_camera_that_shows_another_moment_contradicts_for_that_time():
    points = moving_points()
    places = [CameraPlace.first(), beside(60.0), beside(-60.0)]
    people = [seen(place, points, 30.0, seed=k) for k, place in enumerate(places)]
    wrong = people[2].rays.copy()
    wrong[45:80] += 0.15
    people[2] = replace(people[2], rays=wrong)
    spans = contradicting_spans(people, places)
    assert spans[:2] == [[], []]
    ((start, end),) = spans[2]
    assert start == pytest.approx(1.5, abs=0.1)
    assert end == pytest.approx(79 / 30, abs=0.1)


def test_the_second_of_two_cameras_contradicts_while_it_shows_somebody_beside():
    points = moving_points()
    places = [CameraPlace.first(), beside(60.0)]
    people = [seen(place, points, 30.0, seed=k) for k, place in enumerate(places)]
    assert contradicting_spans(people, places) == [[], []]
    beside_them = people[1].rays.copy()
    beside_them[40:85, :, 0] += 0.25
    people[1] = replace(people[1], rays=beside_them)
    first, second = contradicting_spans(people, places)
    assert first == []
    ((start, end),) = second
    assert start == pytest.approx(40 / 30, abs=0.1)
    assert end == pytest.approx(84 / 30, abs=0.1)
