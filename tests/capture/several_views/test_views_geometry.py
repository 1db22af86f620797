# SPDX-License-Identifier: GPL-3.0-or-later
"""Clocks, cameras and people of several views: made scenes whose truth is exact."""

from dataclasses import replace

import numpy as np
import pytest
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

from ..exact_tracks import network_points

SECONDS = 4.0
BODY = load_body("scope")
REST = np.tile(np.eye(3), (BODY.K + 1, 1, 1))
MEAN_LENGTHS = bone_lengths(network_points(BODY, REST, BODY.rest_joints())[KEYPOINTS])
FIRST = CameraPlace.first()


def moving_points(seed=0, center=(0.0, 0.0, 4.0)):
    """Return a function of times (T,) that gives the keypoints (T, n, 3) of somebody who waves and
    steps, in the first camera's axes.
    """
    rng = np.random.default_rng(seed)
    names = [f"{side}_{name}" for side in ("left", "right") for name in ("shoulder", "hip")]
    names += [f"{side}_{name}" for side in ("left", "right") for name in ("elbow", "knee")]
    parts = [BODY.joint_names.index(name) for name in names]
    amplitude = rng.uniform(-0.6, 0.6, (len(parts), 3, 3))
    phase = rng.uniform(0, 2 * np.pi, (len(parts), 3, 3))
    speed = np.array([1.1, 2.3, 4.1])

    def points(times):
        omega = np.tile(REST, (len(times), 1, 1, 1))
        wave = np.sin(speed * times[:, None, None, None] + phase)
        omega[:, parts] = rotations.exp(0.5 * (amplitude * wave).sum(axis=-1))
        turn = rotations.exp(0.5 * np.sin(0.9 * times)[:, None] * [0.0, 1.0, 0.0])
        omega[:, 0] = np.diag([1.0, -1.0, -1.0]) @ turn
        zero = np.zeros(len(times))
        walk = np.stack([np.sin(0.8 * times), zero, np.cos(1.1 * times)], axis=1)
        root = center + 0.4 * walk
        poses = BODY.forward_kinematics(omega, root - BODY.rest_joints()[0])
        return network_points(BODY, *poses)[:, KEYPOINTS]

    return points


def standing_points(times):
    """Return the keypoints (T, n, 3) of somebody who does not move."""
    return moving_points()(np.zeros(len(times)))


def beside(degrees, distance_m=4.0):
    """Return the place of a camera that looks at the person from so many degrees to the side."""
    R = rotations.exp(np.array([0.0, np.radians(degrees), 0.0]))
    middle = np.array([0.0, 0.0, 4.0])
    return CameraPlace(R, np.array([0.0, 0.0, distance_m]) - R @ middle)


def seen(place, points=None, rate=15.0, noise=0.001, lean_deg=8.0, seed=1, own=None):
    """Return what a camera sees, whose clock is ``place.offset_s`` ahead; its lifted body leans."""
    points = moving_points() if points is None else points
    rng = np.random.default_rng(seed)
    own = np.arange(int(SECONDS * rate)) / rate if own is None else own
    inside = place.of(points(place.first_times(own)))
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


@pytest.mark.parametrize(
    ("offset_s", "rates"), [(0.73, (30.0, 60.0)), (-1.21, (30.0, 24.0)), (0.5, (6.0, 5.0))]
)
def test_offset_of_clocks(offset_s, rates):
    first = seen(FIRST, rate=rates[0])
    second = seen(replace(beside(60.0), offset_s=offset_s), rate=rates[1], seed=2)
    assert likely_offsets(first, second)[0] == pytest.approx(offset_s, abs=0.05)


def test_a_frame_that_is_missing_is_a_gap_at_low_frame_rates():
    own = np.array([0.0, 0.2, 0.4, 0.8, 1.0, 1.2])
    between = Between.of(own, np.ones(6, bool), np.array([0.1, 0.4, 0.6, 1.1]))
    assert between.seen.tolist() == [True, True, False, True]


def test_waiting_for_the_clock_can_be_cancelled():
    def cancelled():
        raise CancelledError

    people = [[seen(FIRST)], [seen(beside(60.0), seed=2)]]
    with pytest.raises(CancelledError):
        calibrate(people, [Given(0.1, offset_s=0.0), Given(0.1)], MEAN_LENGTHS, cancelled)


def test_offset_of_somebody_who_stands_still_is_uncertain():
    own = np.arange(20) / 10.0
    people = [[seen(place, standing_points, own=own)] for place in (FIRST, beside(60.0))]
    found = calibrate(people, [Given(), Given()], MEAN_LENGTHS)
    assert not found[1].is_offset_certain


def test_drift_of_clocks():
    """A clock that goes faster, over twenty minutes of which a few frames are seen."""
    truth = replace(beside(70.0), offset_s=0.3, drift=1.5e-4)
    times = np.linspace(1.0, 1200.0, 80)
    around = (times[:, None] + np.arange(-6, 7) / 30.0).ravel()
    people = [seen(FIRST, own=around), seen(truth, seed=2, own=around + 0.3)]
    start = [FIRST, replace(truth, drift=0.0)]
    found = adjust(people, start, times, [Given(), Given()], MEAN_LENGTHS).cameras[1]
    assert found.drift == pytest.approx(truth.drift, abs=4e-5)
    assert found.own_times(600.0) == pytest.approx(truth.own_times(600.0), abs=0.005)
    assert truth.first_times(truth.own_times(600.0)) == pytest.approx(600.0)


def test_gradient_is_that_of_the_cost():
    people = [seen(FIRST, rate=30.0), seen(beside(70.0), rate=30.0)]
    places = [FIRST, replace(beside(65.0), log_focal=0.05, offset_s=0.01)]
    times = people[0].times[10:40:10]
    problem = bundle._Problem(people, times, places, [Given(0.1)] * 2, 1.1 * MEAN_LENGTHS)
    rng = np.random.default_rng(0)
    start = moving_points()(times) + rng.normal(0, 0.03, (3, 16, 3))
    now = bundle._Unknowns(places, MEAN_LENGTHS, start)
    system = problem.linearize(now)

    def slope(step, points):
        rise = problem.cost(now.moved(1e-6 * step, 1e-6 * points, problem.mean_s))
        rise -= problem.cost(now.moved(-1e-6 * step, -1e-6 * points, problem.mean_s))
        return rise / 4e-6

    free = np.flatnonzero(problem.is_free)
    # Rays are linear between frames, so that their speed is not a derivative at a frame.
    for k in free[(free >= 18) | (free % 9 < 7)]:
        step = np.eye(len(problem.is_free))[k]
        expected = pytest.approx(system.g_global[k], rel=1e-4, abs=1e-2)
        assert slope(step, np.zeros_like(start)) == expected
    direction = rng.normal(size=start.shape)
    expected = (system.g_points.reshape(start.shape) * direction).sum()
    nothing = np.zeros(len(problem.is_free))
    assert slope(nothing, direction) == pytest.approx(expected, rel=1e-4)


def test_cameras_are_found_from_the_people():
    truth = replace(beside(100.0, 5.0), offset_s=0.42, log_focal=0.08)
    people = [[seen(FIRST, rate=30.0)], [seen(truth, rate=59.94, seed=2)]]
    found = calibrate(people, [Given(), Given(0.2)], MEAN_LENGTHS)
    place = found[1].place
    assert angle_deg(place.R_camera_first, truth.R_camera_first) < 1.0
    assert place.offset_s == pytest.approx(0.42, abs=0.008)
    assert place.log_focal == pytest.approx(0.08, abs=0.03)
    off_m = np.linalg.norm(place.center - truth.center)
    assert off_m < 0.03 * np.linalg.norm(truth.center)


def test_lengths_of_bones_tell_the_angle_between_distant_cameras():
    """Without them, cameras that hardly see perspective stay where they started."""
    truth = beside(60.0, 12.0)
    far = replace(FIRST, t_camera_first=np.array([0.0, 0.0, 8.0]))
    people = [seen(far, noise=0.0003), seen(truth, noise=0.0003)]
    R_second_first = truth.R_camera_first @ far.R_camera_first.T
    t_second_first = truth.t_camera_first - R_second_first @ far.t_camera_first
    middle = np.array([0.0, 0.0, 12.0])
    R = rotations.exp(np.array([0.0, np.radians(12.0), 0.0])) @ R_second_first
    t = R_second_first @ middle + t_second_first - R @ middle
    start = [FIRST, CameraPlace(R, t)]
    found = adjust(people, start, people[0].times, [Given(), Given()], MEAN_LENGTHS).cameras[1]
    assert angle_deg(found.R_camera_first, R_second_first) < 1.5


def test_what_is_given_of_a_camera_stays_and_the_rest_is_found():
    truth = replace(beside(80.0), offset_s=0.42)
    people = [[seen(FIRST)], [seen(truth, rate=24.0, seed=2)]]
    T = np.eye(4)
    T[:3, :3] = truth.R_camera_first
    T[:3, 3] = truth.t_camera_first
    place = calibrate(people, [Given(), Given(T_camera_first=T)], MEAN_LENGTHS)[1].place
    np.testing.assert_allclose(place.R_camera_first, truth.R_camera_first, atol=1e-12)
    np.testing.assert_allclose(place.t_camera_first, truth.t_camera_first, atol=1e-12)
    assert place.offset_s == pytest.approx(0.42, abs=0.008)
    place = calibrate(people, [Given(), Given(offset_s=0.42)], MEAN_LENGTHS)[1].place
    assert place.offset_s == 0.42
    assert angle_deg(place.R_camera_first, truth.R_camera_first) < 1.0


@pytest.mark.parametrize("log_focal", [0.0, 0.25])
def test_given_places_are_compared_with_the_people(log_focal):
    camera = replace(FIRST, log_focal=log_focal)
    truth = beside(80.0)
    first = seen(camera)
    second = seen(truth, seed=2)
    assert not contradicts(first, second, (camera, truth))
    assert relative_distance(first, second, (camera, truth)) == pytest.approx(1.0, abs=0.1)
    assert contradicts(first, second, (camera, beside(-80.0)))
    turn = rotations.exp(np.radians([2.0, 0.0, 0.0]))
    moved = CameraPlace(turn @ truth.R_camera_first, turn @ truth.t_camera_first)
    assert contradicts(first, second, (camera, moved))
    never_at_once = replace(beside(-80.0), offset_s=1000.0)
    assert not contradicts(first, second, (camera, never_at_once))
    millimetres = replace(truth, t_camera_first=1000.0 * truth.t_camera_first)
    size = relative_distance(first, second, (camera, millimetres))
    assert size == pytest.approx(1000.0, rel=0.1)


LEFT = moving_points(0)
RIGHT = moving_points(3, (0.9, 0.0, 4.5))


def test_people_are_recognized_by_where_they_are():
    truth = replace(beside(70.0), offset_s=0.2)
    first = [seen(FIRST, each) for each in (LEFT, RIGHT)]
    second = [seen(truth, each, seed=5) for each in (RIGHT, LEFT)]
    found = calibrate([first, second], [Given(), Given(offset_s=0.2)], MEAN_LENGTHS)
    assert [match.number for match in found] == [0, 1]
    assert same_people([first, second], found) == [[0, 1], [1, 0]]
    stranger = seen(truth, moving_points(4, (-1.0, 0.0, 5.0)), seed=5)
    others = [second[1], stranger]
    assert same_people([first, others], [found[0], replace(found[1], number=0)]) == [
        [0, 0],
        [1, None],
    ]


def test_people_are_recognized_with_the_focal_length_that_was_found_of_the_first_camera():
    places = [replace(FIRST, log_focal=0.25), replace(beside(70.0), log_focal=0.25)]
    people = [[seen(place, each) for each in (LEFT, RIGHT)] for place in places]
    matches = [Match(place, 0.0, 0, Clock.GIVEN) for place in places]
    assert same_people(people, matches) == [[0, 0], [1, 1]]


def test_who_would_face_another_way_makes_room_for_somebody_who_fits(monkeypatch):
    """A camera that shows only somebody else has no place."""
    first = seen(FIRST)
    second = [seen(beside(80.0), seed=seed) for seed in (2, 3)]
    degrees = [-80.0, 80.0]

    def adjusted(first, second, guess, *_):
        cost = 1.0 + 0.2 * guess.number
        return Match(beside(degrees[guess.number]), cost, guess.number, Clock.GIVEN)

    monkeypatch.setattr(calibration, "_adjusted_pair", adjusted)
    known = [Given(offset_s=0.0)] * 2
    assert calibrate([[first], second], known, MEAN_LENGTHS)[1].number == 1
    assert calibrate([[first], second[:1]], known, MEAN_LENGTHS)[1] is None


def test_every_camera_has_its_share_of_the_times_that_all_are_adjusted_to():
    first = seen(FIRST, standing_points, own=np.arange(600) / 10.0)
    short = seen(FIRST, standing_points, own=20.0 + np.arange(80) / 10.0)
    times = _times_of_all(first, [(first, FIRST), (short, FIRST)])
    assert len(times) <= 150
    assert np.sum((times >= 20.0) & (times < 28.0)) >= 75


def test_a_camera_that_shows_another_moment_contradicts_for_that_time():
    places = [FIRST, beside(60.0), beside(-60.0)]
    people = [seen(place, rate=30.0, seed=k) for k, place in enumerate(places)]
    people[2].rays[45:80] += 0.15
    spans = contradicting_spans(people, places)
    assert spans[:2] == [[], []]
    ((start, end),) = spans[2]
    assert start == pytest.approx(1.5, abs=0.1)
    assert end == pytest.approx(79 / 30, abs=0.1)


def test_the_second_of_two_cameras_contradicts_while_it_shows_somebody_beside():
    places = [FIRST, beside(60.0)]
    people = [seen(place, rate=30.0, seed=k) for k, place in enumerate(places)]
    assert contradicting_spans(people, places) == [[], []]
    people[1].rays[40:85, :, 0] += 0.25
    first, second = contradicting_spans(people, places)
    assert first == []
    ((start, end),) = second
    assert start == pytest.approx(40 / 30, abs=0.1)
    assert end == pytest.approx(84 / 30, abs=0.1)
