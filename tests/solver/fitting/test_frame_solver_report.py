# SPDX-License-Identifier: GPL-3.0-or-later
"""What a fit tells of itself: what the cost is made of, how many steps were rejected, why it
stopped.
"""

from dataclasses import replace

import pytest
from scope.solver import (
    FootContacts,
    Options,
    Stage,
    Status,
    Weights,
    fit,
    fit_clip,
    fit_motion,
)
from scope.solver.residuals.registry import NAMES

from .. import small_problem
from ..residuals.test_foot_contact import BODY, FEET, points, seen, standing
from .test_frame_solver import measured, scene

REPORT = Options(report=True)


def test_the_shares_add_up_to_the_cost_and_name_what_was_measured():
    body, state = scene(2)
    found = fit(body, measured(body, state, noise=1.0), options=REPORT)
    assert sum(found.cost_by_term.values()) == pytest.approx(found.cost, rel=1e-10)
    assert set(found.cost_by_term) <= set(NAMES)
    used = {name for name, cost in found.cost_by_term.items() if cost > 0.0}
    assert {"keypoints2d", "keypoints3d", "orientation_field", "joint_prior", "shape_prior"} <= used
    assert not used & {"pose_prior", "foot_contact", "floor"}
    assert fit(body, measured(body, state)).cost_by_term == {}


def test_a_share_is_the_residuals_own_cost():
    """Of a single contact without anything else: half weight times squared distance."""
    state = standing()
    stand = points(state)[FEET[:1]] + [0.0, 0.0, 0.1]
    m = replace(seen(state), foot_contacts=FootContacts(FEET[:1], stand, [0.5]))
    still = Options(stages=[Stage(max_iterations=0)], report=True)
    found = fit(BODY, m, init=state, options=still)
    assert found.cost_by_term["foot_contact"] == pytest.approx(0.5 * 4e4 * 0.5 * 0.01, rel=1e-9)
    assert found.cost_by_term["keypoints3d"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("focal", [False, True])
def test_a_clips_shares_count_the_shape_once(focal):
    state = standing(1)
    frames = [seen(state, 0.02, seed) for seed in range(4)]
    found = fit_clip(BODY, frames, options=REPORT, focal=focal)
    assert sum(found.cost_by_term.values()) == pytest.approx(found.cost, rel=1e-9)
    beta = found.beta
    assert found.cost_by_term["shape_prior"] == pytest.approx(
        0.5 * Weights().shape * float(beta @ beta), rel=1e-9
    )
    assert ("focal_prior" in found.cost_by_term) == focal


@pytest.mark.filterwarnings("ignore:The body fits the .D keypoints badly")
def test_rejected_steps_are_counted_among_the_iterations():
    """Keypoints that contradict each other, from a bad start and hardly damped: not every step can
    be right.
    """
    body, state = scene(4, angle=1.5)
    m = measured(body, state, noise=30.0)
    found = fit(body, m, options=Options(damping=1e-9, robust_keypoints3d=0.01, stages=[Stage()]))
    assert 0 < found.rejected < found.iterations
    assert found.status in (Status.CONVERGED, Status.STALLED, Status.MAX_ITERATIONS)
    short = fit(body, m, options=Options(stages=[Stage(max_iterations=2, tolerance=0.0)]))
    assert (short.status, short.iterations) == (Status.MAX_ITERATIONS, 2)


def test_a_printed_result_is_one_short_line():
    """Of a single frame, a clip and a motion alike: how it ended, without its many arrays."""
    body, seen = small_problem.BODY, [small_problem.SEEN] * 2
    found = fit(body, seen[0]), fit_clip(body, seen), fit_motion(body, seen, [0.0, 0.1])
    for result in found:
        printed = str(result)
        assert "\n" not in printed
        assert len(printed) < 300
        assert "array" not in printed  # that of a shape of ten parameters has two lines
        assert "CONVERGED" in printed
        assert f"cost={result.cost}" in printed
        assert "rejected" not in printed  # which reads as rejected measurements
