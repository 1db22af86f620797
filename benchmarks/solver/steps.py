# SPDX-License-Identifier: GPL-3.0-or-later
"""Gauss-Newton steps, sparse and dense, on the benchmark problem; the paper's Experiments 1 to 3."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...solver.gauss_newton.curvature import make_curvature
from ...solver.gauss_newton.linearize import make_blocks, make_pose
from ...solver.gauss_newton.recursion import make_workspace
from . import loops
from .dense import Dense
from .problem import Problem, make_problem
from .timing import take_turns

TARGETS = {  # name: K, P, N, with the joint prior, target in microseconds
    "K23_P10_N52_prior": (23, 10, 52, True, 15.0),
    "K23_P10_N120": (23, 10, 120, False, 15.0),
    "K23_P10_N600": (23, 10, 600, False, None),
    "K51_P10_N120": (51, 10, 120, False, 22.0),
    "K51_P10_N600": (51, 10, 600, False, None),
    "K23_P0_N120": (23, 0, 120, False, None),
}
SIZES = (120, 240, 360, 480, 600)
SHAPES = tuple(range(11))
SPARSE_BATCH, DENSE_BATCH = 40, 4


def sparse_run(p: Problem) -> Callable[[int], object]:
    """Return run(n): n steps of the solver, each linearized at another state."""
    pose, blocks, work = make_pose(p.tree), make_blocks(p.tree), make_workspace(p.tree)
    return lambda n: loops.steps(n, p.tree, p.terms, p.stage, p.damping, p.root_scale, p.bank, pose, blocks, work)


def dense_run(p: Problem) -> Callable[[int], object]:
    """Return run(n): n dense steps."""
    dense = Dense(p)
    return lambda n: [dense.step(k) for k in range(n)]


def iteration_run(p: Problem) -> Callable[[int], object]:
    """Return run(n): n whole iterations: step, move, linearize at the trial point."""
    poses, blocks = (make_pose(p.tree), make_pose(p.tree)), (make_blocks(p.tree), make_blocks(p.tree))
    curvature, work = make_curvature(p.tree), make_workspace(p.tree)
    return lambda n: loops.iterations(
        n, p.tree, p.terms, p.stage, p.damping, p.root_scale, p.bank, *poses, *blocks, curvature, work
    )


def prior_run(p: Problem) -> Callable[[int], object]:
    """Return run(n): n evaluations of the joint prior of all joints, with Jacobian and sums."""
    pose, blocks = make_pose(p.tree), make_blocks(p.tree)
    return lambda n: loops.priors(n, p.tree, p.terms, p.stage, p.bank, pose, blocks)


def compare(problems: dict[str, Problem], rounds: int) -> tuple[dict[str, float], dict[str, float]]:
    """Return the times of a sparse and of a dense step in microseconds, measured in turns."""
    runs, counts = {}, {}
    for name, p in problems.items():
        runs[f"s {name}"], counts[f"s {name}"] = sparse_run(p), SPARSE_BATCH
        runs[f"d {name}"], counts[f"d {name}"] = dense_run(p), DENSE_BATCH
    times = take_turns(runs, counts, rounds)
    return {n: times[f"s {n}"] for n in problems}, {n: times[f"d {n}"] for n in problems}


def target_table(rounds: int) -> dict[str, object]:
    """Return gn_step, dense_over_sparse, iteration and prior_23_joints."""
    problems = {name: make_problem(K, P, N, prior) for name, (K, P, N, prior, _) in TARGETS.items()}
    sparse, dense = compare(problems, rounds)
    more = take_turns(
        {
            "iteration": iteration_run(make_problem(23, 10, 120, everything=True)),
            "prior_23_joints": prior_run(make_problem(23, 10, 52, joint_flow=True)),
        },
        {"iteration": SPARSE_BATCH, "prior_23_joints": SPARSE_BATCH},
        rounds,
    )
    return {"gn_step": sparse, "dense_over_sparse": {n: dense[n] / sparse[n] for n in sparse}, **more}


def experiment(which: int, rounds: int) -> list[dict[str, float]]:
    """Return the rows of the paper's Experiment 1 (P = 0, growing N), 2 (P = 10, growing N) or 3 (N = 600, growing P).

    A row: K, P, N, sparse and dense time in microseconds.
    """
    points = [(P, 600) for P in SHAPES] if which == 3 else [(10 * (which - 1), N) for N in SIZES]
    problems = {(K, P, N): make_problem(K, P, N) for K in (23, 51) for P, N in points}
    sparse, dense = compare({str(key): p for key, p in problems.items()}, rounds)
    return [
        {"K": K, "P": P, "N": N, "sparse": sparse[str((K, P, N))], "dense": dense[str((K, P, N))]}
        for K, P, N in problems
    ]


def growth(rows: list[dict[str, float]], K: int, method: str) -> float:
    """Return the exponent a of time ~ N^a, fitted over the rows of K joints."""
    chosen = [row for row in rows if row["K"] == K]
    return float(np.polyfit(np.log([r["N"] for r in chosen]), np.log([r[method] for r in chosen]), 1)[0])


def growth_in_joints(rows: list[dict[str, float]], method: str) -> float:
    """Return the median exponent a of time ~ K^a between the bodies of the rows, over points of equal P and N."""
    by_place = {(row["K"], row["P"], row["N"]): row[method] for row in rows}
    pairs = [(t, by_place[51, P, N]) for (K, P, N), t in by_place.items() if K == 23]
    return float(np.median([np.log(b / a) / np.log(51 / 23) for a, b in pairs]))
