# SPDX-License-Identifier: GPL-3.0-or-later
"""The step of a whole clip: time per frame against the number of frames, and against conjugate
gradients.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np

from ...solver import (
    Measurements,
    MotionPrior,
    Options,
    Priors,
    Stage,
    StandingPoints,
    Weights,
    rotations,
)
from ...solver.gauss_newton.optimizer import SharedPriors, make_settings
from ...solver.gauss_newton.terms import pack_priors
from ...solver.motion.band import make_factor, solve_clip
from ...solver.motion.problem import ClipProblem, MotionTerms
from ...solver.motion.system import make_poses
from ...solver.motion.views import View, pack_frames
from ...solver.part import Pose
from ...solver.tree import make_tree, with_fixed_shape
from .clip_gradients import ConjugateGradients
from .problem import make_problem

RATE = 30.0
LENGTHS = (75, 150, 300, 600)
GAP = 30  # frames without measurements
OUTLINE_WEIGHT = 1e5
# larger ones need more conjugate gradients
MOTION = MotionPrior(joints=0.1, root_rotation=0.1, root_position=3.0)


def make_clip(
    K: int,
    frames: int,
    gap: int = 0,
    fixed: bool = False,
    contacts: int = 4,
    pool: ThreadPoolExecutor | None = None,
    added: Callable[[Measurements, int], Measurements] = lambda seen, _: seen,
) -> tuple[ClipProblem, Pose]:
    """Return a clip with 120 terms a frame about one state, and poses that swing about it; `gap`
    frames see nothing.

    :param added: returns a frame's measurements with further ones.
    """
    p = make_problem(K, 10, 120)
    tree = make_tree(p.body)
    if fixed:
        tree = with_fixed_shape(tree, p.bank[3][0][:10])
    priors = Priors()
    packed = pack_priors(tree, replace(priors, shape_mean=None))
    first = (frames - gap) // 2
    seen = [
        Measurements() if first <= f < first + gap else added(p.measurements, f)
        for f in range(frames)
    ]
    views, _ = pack_frames(tree, [[View(m)] for m in seen], packed)
    poses = make_poses(tree, frames)
    for f in range(frames):
        swing = 0.1 * np.sin(3.0 * f / RATE)
        poses.R[f, 0] = p.bank[0][0] @ rotations.exp([0.0, swing, 0.0])
        poses.t[f, 0] = p.bank[1][0] + [swing, 0.0, 0.0]
        poses.Omega[f] = p.bank[2][0] @ rotations.exp([swing, 0.0, swing])
    if not fixed:
        poses.beta[:] = p.bank[3][0]
    stands = StandingPoints(np.arange(contacts), np.full((frames, contacts), 0.5))
    motion = MotionTerms.make(tree, np.arange(frames) / RATE, MOTION, stands)
    stage = Stage(Weights(tables={"outline": OUTLINE_WEIGHT}))
    settings = make_settings(Options(stages=[stage]), [stage])
    P = tree.shape_count
    return ClipProblem(
        tree, views, motion, SharedPriors(np.zeros(P), np.eye(P), None), settings, pool
    ), poses


def clip_table(rounds: int) -> list[dict[str, float]]:
    """Return rows of K, frames, and the least milliseconds a frame of linearization and of a step,
    two threads.
    """
    rows = []
    for K in (23, 51):
        for frames in LENGTHS:
            with ThreadPoolExecutor(2) as pool:
                problem, poses = make_clip(K, frames, pool=pool)
                system = problem.make_system()
                factor = make_factor(system)
                scale = problem.settings.root_scale
                linearize = _least(rounds, partial(problem.linearize, 0, poses, system))
                solve = partial(solve_clip, problem.tree, system, 1.0, scale, factor, pool)
                step = _least(rounds, solve)
            rows.append(
                {
                    "K": K,
                    "frames": frames,
                    "linearize_ms": linearize / frames,
                    "step_ms": step / frames,
                }
            )
    return rows


def against_gradients(rounds: int, frames: int = 300) -> list[dict[str, float]]:
    """Return rows of a gap's length, a tolerance, iterations, and milliseconds a frame of both
    ways, in one thread.
    """
    rows = []
    for gap in (0, GAP):
        problem, poses = make_clip(23, frames, gap, fixed=True, contacts=0)
        system = problem.make_system()
        scale = problem.settings.root_scale
        problem.linearize(0, poses, system)
        factor = make_factor(system)
        used = 3 + 3 * len(problem.tree.parents)
        eliminated = _least(rounds, partial(solve_clip, problem.tree, system, 1.0, scale, factor))
        gradients = ConjugateGradients(problem, poses, 1.0, scale)
        gradient = np.ascontiguousarray(system.N[:, :used, 0])
        for tolerance in (1e-2, 1e-4, 1e-8):
            d, iterations = gradients.solve(gradient, tolerance)
            ms = _least(rounds, partial(gradients.solve, gradient, tolerance))
            error = np.abs(d - factor.d[:, :used]).max() / np.abs(factor.d).max()
            rows.append({
                "gap": gap, "tolerance": tolerance, "iterations": iterations, "error": float(error),
                "gradients_ms": ms / frames, "elimination_ms": eliminated / frames,
            })  # fmt: skip
    return rows


def in_turns(
    rounds: int, *runs: Callable[[], object], clock: Callable[[], float] = time.process_time
) -> list[float]:
    """Return the least time of each run in milliseconds, taken in turns; the first, which may
    compile, does not count.

    :param clock: the processor's time by default, which other load changes little.
    """
    times: list[list[float]] = [[] for _ in runs]
    for k in range(rounds + 1):
        for run, measured in zip(runs, times, strict=True):
            start = clock()
            run()
            if k:
                measured.append(clock() - start)
    return [1e3 * min(measured) for measured in times]


def _least(rounds: int, run: Callable[[], object]) -> float:
    return in_turns(rounds, run, clock=time.perf_counter)[0]
