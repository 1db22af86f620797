# SPDX-License-Identifier: GPL-3.0-or-later
"""The remaining time, against what captures have really taken.

`measured_progress.json` has the messages of captures: seconds, stage, done and total. The last is
at the end.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from scope.scope_addon.job.job_progress import BUILDING, STAGES, JobProgress

MEASURED = json.loads((Path(__file__).parent / "measured_progress.json").read_text("utf-8"))
OF_SEVERAL = 0.04  # of a capture of several people, by which the estimate may be off besides
LAST_S = 2.0  # of a capture, in which the estimate does not matter any more


def replayed(messages, earlier=None):
    """Return the time, what is left in truth and the estimate at 400 times of a capture, and its
    progress.
    """
    now = [0.0]
    rest = list(messages)
    progress = JobProgress(lambda: now[0], earlier)
    found = []
    end = messages[-1][0]
    for t in np.linspace(0.0, end, 400, endpoint=False):
        while rest and rest[0][0] <= t:
            now[0], stage, done, total = rest.pop(0)
            progress.update(stage, done, total)
        now[0] = t
        found.append((t, end - t, progress.seconds_left))
    now[0] = end
    progress.update(BUILDING, 0, 0)
    return found, progress


def of_each_frame(messages):
    """Return the seconds of each stage for a frame, as they are kept for the next capture."""
    progress = replayed(messages)[1]
    return {stage: seconds / progress.frames for stage, seconds in progress.seconds.items()}


@pytest.mark.parametrize("again", [False, True], ids=["first", "again"])
@pytest.mark.parametrize("name", MEASURED)
def test_the_remaining_time_is_right_to_about_a_half_whenever_it_is_shown(name, again):
    found, _ = replayed(MEASURED[name], of_each_frame(MEASURED[name]) if again else None)
    estimates = [
        (left, estimate) for _, left, estimate in found if estimate is not None and left > LAST_S
    ]
    margin = OF_SEVERAL * MEASURED[name][-1][0] if "people" in name else 0.0
    assert [
        (left, x) for left, x in estimates if not 0.6 * left - margin < x < 1.6 * left + margin
    ] == []
    ratios = [estimate / left for left, estimate in estimates]
    assert abs(np.median(ratios) - 1) < 0.3
    shown = [estimate is not None for _, _, estimate in found]
    assert np.mean(shown) > (0.4 if again else 0.3)


@pytest.mark.parametrize("name", MEASURED)
def test_captures_have_the_stages_whose_shares_the_bar_shows(name):
    stages = [stage for _, stage, _, _ in MEASURED[name]]
    assert set(stages) | {"starting"} == set(STAGES)
    _, progress = replayed(MEASURED[name])
    assert progress.fraction == pytest.approx(1.0 - STAGES["writing"])
    # How long the networks take to load does not depend on the footage.
    took = progress.seconds
    loading = STAGES["starting"]
    end = MEASURED[name][-1][0] - took["starting"]
    for stage in list(STAGES)[1:]:
        assert abs(took.get(stage, 0.0) / end - STAGES[stage] / (1.0 - loading)) < 0.12, stage


def test_before_the_solver_is_compiled_nothing_is_said_of_what_is_left():
    """Compiling takes minutes: a capture of 205 s, of whose frames half were found after 15 s."""
    now = [0.0]
    progress = JobProgress(clock=lambda: now[0], may_compile=True)
    steps = [(second, "finding the person", 6 * second, 150) for second in range(1, 26)]
    steps += [(26 + k, "compiling the solver", k, 102) for k in range(103)]
    for second, stage, done, total in steps:
        now[0] = float(second)
        progress.update(stage, done, total)
        assert progress.seconds_left is None, (second, stage)
    for done in range(60):
        now[0] += 0.5
        progress.update("finding the shape", done, 100)
    assert progress.seconds_left is not None


def test_a_stage_that_slows_down_has_no_remaining_time_until_it_is_steady():
    now = [0.0]
    progress = JobProgress(clock=lambda: now[0])
    for k in range(200):  # what an earlier capture has kept is passed quickly
        now[0] = 0.01 * k
        progress.update("finding the person", k, 1000)
    for k in range(200, 230):
        now[0] += 0.5
        progress.update("finding the person", k, 1000)
        assert progress.seconds_left is None or progress.seconds_left > 250
    for k in range(230, 300):
        now[0] += 0.5
        progress.update("finding the person", k, 1000)
    assert progress.seconds_left == pytest.approx(0.5 * 700 * 1.3, rel=0.1)


@pytest.mark.parametrize("name", [name for name in MEASURED if "people" in name])
@pytest.mark.parametrize("again", [False, True], ids=["first", "again"])
def test_several_people_have_a_remaining_time_in_all_stages_for_each_of_them(name, again):
    found, _ = replayed(MEASURED[name], of_each_frame(MEASURED[name]) if again else None)
    begin = next(t for t, stage, _, _ in MEASURED[name] if stage == "finding the shape")
    ratios = [(t, left, estimate) for t, left, estimate in found if t >= begin and left > LAST_S]
    assert len(ratios) > 20
    assert all(estimate is not None for _, _, estimate in ratios)
    assert 0.5 < np.median([estimate / left for _, left, estimate in ratios]) < 1.5


def test_an_estimate_that_is_gone_a_moment_later_is_shown(monkeypatch):
    """The clock goes on between two looks at it."""
    estimates = iter([75.0, None, None])
    monkeypatch.setattr(JobProgress, "seconds_left", property(lambda _: next(estimates)))
    assert "1 min 15 s left" in JobProgress().lines()[-1]
