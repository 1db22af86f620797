# SPDX-License-Identifier: GPL-3.0-or-later
"""The causal filters against what is known of them in closed form, and against what they are for.

Poses after the causal filter: still ones stay, moving ones come as late as is said, and noise
is less.
"""

import numpy as np
import pytest
from scope.scope_addon.live.smoothing import (
    DELAY_S,
    PoseFilter,
    Response,
    RotationFilter,
    VectorFilter,
)
from scope.solver import rotations
from scope.solver.rotations import exp, log

MOTION = Response(4, 6.0, 0.08)


@pytest.mark.parametrize("step_s", [1 / 60, 1 / 30, 1 / 12])
def test_the_delay_of_steady_motion_is_known_at_any_frame_rate(step_s):
    times = np.arange(0, 6, step_s)
    low_pass = VectorFilter(MOTION)
    last = [low_pass(np.array([2.0 * t]), step_s)[0] for t in times][-1]
    assert times[-1] - last / 2.0 == pytest.approx(4 / (2 * np.pi * 6.0) - 0.08, abs=1e-4)


def test_one_stage_responds_to_a_step_as_a_resistor_and_a_capacitor_do():
    low_pass = VectorFilter(Response(1, 1.0))
    low_pass(np.zeros(1), 1e-3)
    values = [low_pass(np.ones(1), 1e-3)[0] for _ in range(400)]
    assert values[-1] == pytest.approx(1 - np.exp(-2 * np.pi * 0.4), abs=2e-3)


def mean_step(R):
    return np.linalg.norm(rotations.log(np.swapaxes(R[:-1], 1, 2) @ R[1:]), axis=1).mean()


def test_rotations_at_rest_jitter_less_and_turning_ones_are_followed():
    noise = rotations.exp(np.random.default_rng(0).normal(0, 0.02, (90, 3)))
    still = RotationFilter(MOTION)
    turning = RotationFilter(MOTION)
    assert mean_step(np.array([still(R[None], 1 / 30)[0] for R in noise])) < 0.5 * mean_step(noise)
    truth = rotations.exp(np.linspace(0, 6, 60)[:, None] * [0, 0, 1.0])  # 3 rad/s
    last = [turning(R[None], 2 / 59)[0] for R in truth][-1]
    assert np.linalg.norm(rotations.log(last.T @ truth[-1])) == pytest.approx(3 * 0.0261, abs=0.005)


def test_after_a_pause_the_filter_starts_again():
    low_pass = VectorFilter(MOTION)
    low_pass(np.zeros(1), 0.03)
    assert low_pass(np.ones(1), 2.0)[0] == 1.0


def test_the_lead_grows_after_the_start_so_that_a_wrong_first_value_does_not_overshoot():
    response = Response.delayed(6, 7.0, 1 / 30)
    low_pass = VectorFilter(response)
    low_pass(np.ones(1), 1 / 30)
    values = [low_pass(np.zeros(1), 1 / 30)[0] for _ in range(30)]
    assert min(values) > -0.1  # with all of the lead from the start, -0.12
    assert response.lead(10.0) == pytest.approx(6 / (2 * np.pi * 7.0) - 1 / 30)


def roots_of_a_pose_filter(distances, rate):
    """The pelvis (n, 3) of a body straight in front of the camera, after the filters have begun."""
    poses = PoseFilter()
    roots = [
        poses(np.eye(3)[None], np.array([0.0, 0.0, z]), k / rate)[1]
        for k, z in enumerate(distances)
    ]
    return np.array(roots)[rate:]


def test_noise_of_the_distance_moves_the_body_gently():
    noise = np.random.default_rng(0).normal(0, 0.01, 1200)
    roots = roots_of_a_pose_filter(4 + noise, 60)
    # m/s³; four stages of 3 Hz: 77
    assert np.linalg.norm(60**3 * np.diff(roots, 3, axis=0), axis=1).mean() < 50.0


@pytest.mark.parametrize("rate", [15, 30, 60])
def test_who_walks_towards_the_camera_is_where_they_were_a_moment_ago(rate):
    times = np.arange(3 * rate) / rate
    roots = roots_of_a_pose_filter(8 - 1.4 * times, rate)
    late = roots[:, 2] - (8 - 1.4 * (times[rate:] - DELAY_S))
    assert np.abs(late).max() < 0.01


AXIS = np.array([0.6, 0.0, 0.8])


PLACE = np.array([0.4, 0.2, 4.0])


def filtered(
    angles: np.ndarray, places: np.ndarray, times: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the filtered angles about the axis, and places (T, 3)."""
    smooth = PoseFilter()
    found = [
        smooth(exp(a * AXIS)[None], p, t) for a, p, t in zip(angles, places, times, strict=True)
    ]
    return np.array([log(R[0]) @ AXIS for R, _ in found]), np.array([p for _, p in found])


@pytest.mark.parametrize("fps", [15, 30, 60])
def test_who_stands_still_stays_where_they_are(fps: int) -> None:
    times = np.arange(3 * fps) / fps
    angles, places = filtered(np.full(len(times), 0.7), np.tile(PLACE, (len(times), 1)), times)
    np.testing.assert_allclose(angles, 0.7, atol=1e-6)
    np.testing.assert_allclose(places, np.tile(PLACE, (len(times), 1)), atol=1e-6)


@pytest.mark.parametrize("fps", [30, 60])
def test_an_even_motion_comes_late_by_the_delay(fps: int) -> None:
    times = np.arange(4 * fps) / fps
    places = PLACE + times[:, None] * [0.5, 0.0, 0.0]
    angles, found = filtered(0.8 * times, places, times)
    late = 0.8 * (times - DELAY_S)
    np.testing.assert_allclose(angles[2 * fps :], late[2 * fps :], atol=0.01)
    np.testing.assert_allclose(found[2 * fps :, 0], places[2 * fps :, 0] - 0.5 * DELAY_S, atol=0.01)


def test_noise_is_less() -> None:
    rng = np.random.default_rng(4)
    times = np.arange(300) / 30
    noisy = PLACE + 0.02 * rng.normal(size=(300, 3))
    angles, places = filtered(0.05 * rng.normal(size=300), noisy, times)
    assert angles[60:].std() < 0.7 * 0.05
    assert places[60:].std(axis=0).max() < 0.7 * 0.02


def test_the_distance_is_smoothed_more_than_the_place_in_the_image() -> None:
    """A camera measures it less accurately."""
    times = np.arange(600) / 60
    shaking = 0.02 * np.sin(2 * np.pi * 4.0 * times)
    left = []
    for direction in ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]):
        _, places = filtered(
            np.zeros(600), np.array([0.0, 0.0, 4.0]) + np.outer(shaking, direction), times
        )
        left.append((places @ direction)[120:].std())
    assert left[1] < 0.8 * left[0]


def test_after_a_reset_nothing_of_before_is_left() -> None:
    smooth = PoseFilter()
    for t in range(30):
        smooth(exp(1.0 * AXIS)[None], PLACE, t / 30)
    smooth.reset()
    R, place = smooth(exp(-0.5 * AXIS)[None], 2.0 * PLACE, 1.0)
    assert log(R[0]) @ AXIS == pytest.approx(-0.5, abs=1e-9)
    np.testing.assert_allclose(place, 2 * PLACE)
