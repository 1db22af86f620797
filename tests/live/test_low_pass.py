# SPDX-License-Identifier: GPL-3.0-or-later
"""The causal filters against what is known of them in closed form, and against what they are for.

Poses after the causal filter: still ones stay, moving ones come as late as is said, and noise
is less.
"""

import numpy as np
import pytest
from scope.scope_addon.live.smoothing import (
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


def test_noise_is_less() -> None:
    rng = np.random.default_rng(4)
    times = np.arange(150) / 30
    noisy = PLACE + 0.02 * rng.normal(size=(150, 3))
    angles, places = filtered(0.05 * rng.normal(size=150), noisy, times)
    assert angles[60:].std() < 0.7 * 0.05
    assert places[60:].std(axis=0).max() < 0.7 * 0.02
