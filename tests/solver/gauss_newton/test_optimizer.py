# SPDX-License-Identifier: GPL-3.0-or-later
"""The damping follows Nielsen's rule: the better a step was predicted, the less the next one is
damped.
"""

import numpy as np
import pytest
from scope.solver import Options, Stage, Status
from scope.solver.gauss_newton.optimizer import judge_trial, make_settings

RUNNING = judge_trial(10.0, 5.0, 5.0, 1.0, 2.0, 0.0)[3]


@pytest.mark.parametrize(
    ("decrease", "factor"),
    [(5.0, 1 / 9), (4.0, 1 - 0.6**3), (2.5, 1.0), (1.0, 1 + 0.6**3), (7.5, 1 / 9), (0.0001, 2.0)],
)
def test_an_accepted_step_changes_the_damping_by_its_gain_ratio(decrease, factor):
    accepted, damping, growth, status = judge_trial(10.0, 10.0 - decrease, 5.0, 0.01, 8.0, 1e-9)
    assert accepted
    assert np.isclose(damping, 0.01 * factor, rtol=1e-3)
    assert growth == 2.0
    assert status == RUNNING


@pytest.mark.parametrize("trial_cost", [10.0, 11.0, np.nan, np.inf])
def test_a_rejected_step_is_damped_more_and_more(trial_cost):
    assert judge_trial(10.0, trial_cost, 5.0, 0.01, 8.0, 1e-9) == (False, 0.08, 16.0, RUNNING)


def test_a_small_decrease_ends_in_convergence_and_damping_without_end_in_a_stall():
    assert judge_trial(10.0, 9.999, 0.001, 0.01, 2.0, 1e-3)[3] == Status.CONVERGED.value
    damping = 0.01
    growth = 2.0
    status = RUNNING
    for _ in range(100):
        if status == RUNNING:
            _, damping, growth, status = judge_trial(10.0, 11.0, 5.0, damping, growth, 1e-3)
    assert status == Status.STALLED.value


def test_the_pelvis_moves_by_the_root_length_as_readily_as_a_joint_turns_by_a_radian():
    settings = make_settings(Options(root_length=0.25), [Stage()])
    assert settings.root_scale * 0.25 == 1.0  # radians
