# SPDX-License-Identifier: GPL-3.0-or-later
"""The causal filters against what is known of them in closed form, and against what they are
for.
"""

import numpy as np
import pytest
from scope.scope_addon.live.low_pass import Response, RotationFilter, VectorFilter
from scope.scope_addon.live.smoothing import DELAY_S, PoseFilter
from scope.solver import rotations

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
