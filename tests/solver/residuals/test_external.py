# SPDX-License-Identifier: GPL-3.0-or-later
"""Residuals that a program registers give what those within the solver give, compiled or not."""

import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scope.solver import (
    Floor,
    InvalidValueError,
    Options,
    PosePriors,
    Priors,
    ShapeError,
    Stage,
    Status,
    Weights,
    fit,
    fit_batch,
    fit_clip,
    fit_motion,
    register_residual,
    rotations,
)
from scope.solver.kernels import add_to_point
from scope.solver.residuals import external, floor, joint_prior, pose_prior

from ..small_problem import BODY, JOINTS, POINTS, SEEN, TRUTH, K, M

# Weights that fix every unknown well, so that derivatives by differences end at the same place.
STIFF = Weights(keypoints3d=24000.0, joint_prior=50.0, shape=100.0)


def solved(m, weights=STIFF):
    """Fit to the last digit, from the truth and without robust kernels, so that there is one
    minimum to find.
    """
    options = Options(stages=[Stage(weights, 1e-14, 200)], robust_keypoints3d=np.inf, report=True)
    return fit(BODY, m, init=TRUTH, priors=Priors(), options=options)


def accumulate(tree, ints, floats, weight, pose, blocks):
    """A joint at a known height: r = sqrt(w) (t_y - height), metres; floats (n, 2): height, w."""
    cost = 0.0
    for k in range(ints.shape[0]):
        i = ints[k, 0]
        w = weight * floats[k, 1]
        r = pose.t[i, 1] - floats[k, 0]
        cost += 0.5 * w * r * r
        origin = tree.keypoints + i  # a joint is a point too
        add_to_point(
            tree, pose, blocks, origin, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, w, 0.0, 0.0, 0.0, w * r, 0.0
        )
    return cost


RAISED_M = JOINTS[3, 1] + 0.05
HEIGHT = np.array([[3]]), np.array([[RAISED_M, 2.0]])
register_residual("height", kernel=accumulate, floats=2)
register_residual("own_floor", kernel=floor.accumulate, ints=1, floats=6, indexes="points")
register_residual(
    "slow_joint",
    function=lambda part, ints, f: (
        np.sqrt(f[9]) * rotations.log(f[:9].reshape(3, 3).T @ part.Omega)
    ),
    floats=10,
    indexes="joints",
)


def slow_pose(part, ints, f):
    """pose_prior.py's residual, from its equation alone."""
    turn = rotations.log(f[:9].reshape(3, 3).T @ part.R)
    return np.concatenate([np.sqrt(f[12]) * turn, np.sqrt(f[13]) * (part.t - f[9:12])])


register_residual("slow_pose", function=slow_pose, floats=14)


UP = np.array([0.0, -1.0, 0.0])


def fitted(name, rows, weight=1.0):
    return solved(replace(SEEN, tables={name: rows}), replace(STIFF, tables={name: weight}))


def assert_same(a, b, atol):
    np.testing.assert_allclose(a.t_camera_part, b.t_camera_part, atol=atol)
    np.testing.assert_allclose(a.R_camera_part, b.R_camera_part, atol=atol)
    np.testing.assert_allclose(a.state.beta, b.state.beta, atol=atol)
    np.testing.assert_allclose(a.cost, b.cost, rtol=1e-6)


UP = np.array([0.0, -1.0, 0.0])


def test_a_registered_kernel_fits_as_the_same_kernel_within_the_solver():
    """One that numba has compiled already."""
    within = replace(SEEN, floor=Floor(np.arange(M), UP, -0.1, contact=np.full(M, 0.5)))
    b = solved(within, replace(STIFF, floor=4e4))
    rows = floor.pack(np.arange(M), UP, np.full(M, -0.1), np.ones(M), np.full(M, 0.5))
    a = fitted("own_floor", rows, 4e4)
    none = solved(SEEN)
    assert_same(a, b, 1e-9)
    assert np.abs(a.t_camera_part - none.t_camera_part).max() > 1e-3
    np.testing.assert_allclose(a.cost_by_term["own_floor"], b.cost_by_term["floor"], rtol=1e-9)


def test_a_python_residual_of_a_joint_fits_as_the_solvers_own_kernel():
    rows = joint_prior.pack(np.array([2, 4]), rotations.exp(0.3 * np.eye(3)[:2]), [90.0, 70.0])
    a = fitted("slow_joint", rows, 3.0)
    floats = rows[1].copy()
    floats[:, -1] *= 3.0 / STIFF.joint_prior
    assert_same(a, solved(replace(SEEN, tables={"joint_prior": (rows[0], floats)})), 1e-6)
    assert a.cost_by_term["slow_joint"] > 1.0


def test_a_python_residual_of_a_part_fits_as_the_solvers_own_kernel():
    parts = np.array([0, 3])
    R = rotations.exp(np.eye(3)[:2])
    t = POINTS[:2]
    a = fitted("slow_pose", pose_prior.pack(parts, R, t, [40.0, 9.0], [10.0, 300.0]), 3.0)
    assert_same(
        a,
        solved(replace(SEEN, pose_priors=PosePriors(parts, R, t, [120.0, 27.0], [30.0, 900.0]))),
        1e-6,
    )
    assert a.cost_by_term["slow_pose"] > 1.0


def test_the_cost_of_an_own_residual_is_what_its_equation_says():
    found = fitted("height", HEIGHT, 500.0)
    r = found.t_camera_part[3, 1] - RAISED_M
    np.testing.assert_allclose(found.cost_by_term["height"], 0.5 * 500.0 * 2.0 * r * r, rtol=1e-9)
    np.testing.assert_allclose(sum(found.cost_by_term.values()), found.cost, rtol=1e-9)


def test_without_a_weight_it_is_one_and_zero_turns_it_off():
    m = replace(SEEN, tables={"height": HEIGHT})
    assert_same(solved(m), fitted("height", HEIGHT, 1.0), 1e-12)
    assert_same(fitted("height", HEIGHT, 0.0), solved(SEEN), 1e-9)


def test_a_clip_and_a_batch_know_it_too():
    options = Options(stages=[Stage(Weights(tables={"height": 1e5}))], report=True)
    m = replace(SEEN, tables={"height": HEIGHT})
    single = fit(BODY, m, priors=Priors(), options=options)
    for found in fit_batch(BODY, [m] * 20, priors=Priors(), options=options, threads=2):
        np.testing.assert_array_equal(found.t_camera_part, single.t_camera_part)
    clip = fit_clip(BODY, [m, m], priors=Priors(), options=options)
    assert clip.cost_by_term["height"] > 0.0
    assert abs(clip.frames[1].t_camera_part[3, 1] - RAISED_M) < 0.05


def broken(part, ints, floats):
    raise KeyError("a mistake of the user's")


def test_what_a_python_residual_raises_reaches_the_caller_once():
    """From a long motion too, whose second half another thread linearizes."""
    register_residual("broken", function=broken, floats=0)
    m = replace(SEEN, tables={"broken": (np.array([[1]]), np.zeros((1, 0)))})
    times = np.arange(20) / 30
    for attempt in (
        lambda: fit(BODY, m),
        lambda: fit_clip(BODY, [m]),
        lambda: fit_batch(BODY, [m]),
        lambda: fit_motion(BODY, [SEEN] * 19 + [m], times, init=[TRUTH] * 20, priors=Priors()),
    ):
        with pytest.raises(
            InvalidValueError, match="residual 'broken' raised KeyError: \"a mistake of the user's"
        ):
            attempt()
    assert fit(BODY, SEEN).status is Status.CONVERGED


@pytest.mark.parametrize(
    ("returned", "message"),
    [
        ("text", "must return numbers"),
        (1.0, r"shape \(n,\), but returned shape \(\)"),
        ([np.nan], "finite numbers"),
    ],
)
def test_what_a_python_residual_must_return_is_said(returned, message):
    register_residual("broken", function=lambda part, ints, floats: returned)
    m = replace(SEEN, tables={"broken": (np.array([[1]]), np.zeros((1, 1)))})
    with pytest.raises(InvalidValueError, match=message):
        fit(BODY, m)


def test_a_kernel_that_does_not_compile_is_refused():
    def wrong(tree, ints, floats, weight, pose, blocks):
        return tree.nothing_of_the_sort

    register_residual("broken", kernel=wrong)
    m = replace(SEEN, tables={"broken": (np.array([[1]]), np.zeros((1, 1)))})
    with pytest.raises(
        InvalidValueError,
        match="kernel of residual 'broken' does not compile: .*nothing_of_the_sort",
    ):
        fit(BODY, m)


def test_rows_that_do_not_fit_are_refused_as_the_solvers_own():
    for name, index, columns, wanted in (
        ("height", K + 1, 2, f"Parts of 'height' must lie in 0..{K}"),
        ("height", -1, 2, f"Parts of 'height' must lie in 0..{K}"),
        ("own_floor", M + K + 1, 6, f"Points of 'own_floor' must lie in 0..{M + K}"),
    ):
        with pytest.raises(ShapeError, match=f"{wanted}, but go from {index}"):
            fitted(name, (np.array([[index]]), np.ones((1, columns))))
    with pytest.raises(ShapeError, match=r"\(n, 1\) and \(n, 2\), but got \(1, 1\) and \(1, 3\)"):
        fitted("height", (np.array([[1]]), np.ones((1, 3))))


def test_an_unknown_name_is_answered_with_the_known_ones():
    for make in (
        lambda: Weights(tables={"hight": 1.0}),
        lambda: fit(BODY, replace(SEEN, tables={"hight": ([], [])})),
    ):
        with pytest.raises(
            InvalidValueError,
            match="no residual named 'hight'; .* pose_prior, .* floor, outline, .*height",
        ):
            make()


def nothing(*_):
    return 0.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"name": "floor", "kernel": nothing}, "name other than .*floor.* but got 'floor'"),
        ({"name": "mine"}, "exactly one callable"),
        ({"name": "mine", "kernel": nothing, "function": nothing}, "exactly one callable"),
        (
            {"name": "mine", "kernel": nothing, "ints": 0},
            "ints of 'mine' must be a whole number of at least 1",
        ),
        (
            {"name": "mine", "kernel": nothing, "floats": 1.5},
            "floats of 'mine' must be a whole number of at least 0",
        ),
        (
            {"name": "mine", "kernel": nothing, "indexes": "bones"},
            "one of points, parts, joints, but is 'bones'",
        ),
        (
            {"name": "mine", "function": nothing, "indexes": "points"},
            "one of parts, joints, but is 'points'",
        ),
    ],
)
def test_registrations_that_cannot_work_are_refused(arguments, message):
    with pytest.raises(InvalidValueError, match=message):
        register_residual(**arguments)


def test_registering_again_replaces_and_other_threads_see_it():
    rows = np.array([[3]]), np.array([[RAISED_M]])
    register_residual("again", function=lambda part, ints, floats: part.t[2:] - floats - 3.0)
    before = fitted("again", rows, 1e4)
    register_residual("again", function=lambda part, ints, floats: part.t[1:2] - floats)
    after = []
    thread = threading.Thread(target=lambda: after.append(fitted("again", rows, 1e4)))
    thread.start()
    thread.join()
    expected = fitted("height", (rows[0], np.array([[RAISED_M, 1.0]])), 1e4)
    assert_same(after[0], expected, 1e-6)
    assert np.abs(before.t_camera_part - expected.t_camera_part).max() > 1e-3


def test_the_solvers_machine_code_on_disk_stays_good():
    """A first fit with an external residual finds `optimize` compiled by the sessions without
    it.
    """
    code = """
import scope.scope_addon
from tests.solver.residuals.test_external import HEIGHT, fitted
from scope.solver.gauss_newton.optimizer import optimize
fitted("height", HEIGHT)
stats = optimize.stats
assert sum(stats.cache_hits.values()) == 1 and not stats.cache_misses, stats
"""
    solved(SEEN)
    root = Path(__file__).resolve().parents[3]
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=root)
    assert done.returncode == 0, done.stderr


def test_there_is_room_for_sixteen_and_each_can_be_replaced(monkeypatch):
    monkeypatch.setattr(external, "_external", {})
    for k in range(16):
        register_residual(f"number {k}", function=lambda part, ints, floats: part.t)
    with pytest.raises(InvalidValueError, match="room for 16 residuals"):
        register_residual("number 16", function=lambda part, ints, floats: part.t)
    register_residual("number 3", function=lambda part, ints, floats: part.beta)
    assert sorted(residual.slot for residual in external.external_residuals().values()) == list(
        range(16)
    )


def test_an_interruption_within_a_python_residual_reaches_the_caller_as_it_is():
    """ctypes dropped it, and any number that was in the register became the cost."""
    calls = []

    def interrupted(part, ints, floats):
        calls.append(part)
        raise KeyboardInterrupt

    register_residual("interrupted", function=interrupted, floats=0)
    m = replace(SEEN, tables={"interrupted": (np.array([[1]]), np.zeros((1, 0)))})
    for attempt in (fit, lambda body, m: fit_clip(body, [m, m])):
        calls.clear()
        with pytest.raises(KeyboardInterrupt):
            attempt(BODY, m)
        assert len(calls) == 1
    assert fit(BODY, SEEN).status is Status.CONVERGED


def test_an_interruption_of_the_report_reaches_the_caller_of_that_fit():
    def count(part, ints, floats):
        calls.append(part)
        if len(calls) == last:
            raise KeyboardInterrupt
        return part.t[:1]

    register_residual("interrupted", function=count, floats=0)
    m = replace(SEEN, tables={"interrupted": (np.array([[1]]), np.zeros((1, 0)))})
    options = Options(stages=[Stage(max_iterations=0)], report=True)
    calls = []
    last = 0
    fit(BODY, m, init=TRUTH, priors=Priors(), options=options)
    last = len(calls)
    calls.clear()
    with pytest.raises(KeyboardInterrupt):
        fit(BODY, m, init=TRUTH, priors=Priors(), options=options)
