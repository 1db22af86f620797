# SPDX-License-Identifier: GPL-3.0-or-later
"""Gauss-Newton steps, sparse and dense, on the benchmark problem; the paper's Experiments 1 to
3.
"""

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
JOINTS = (23, 51, 100, 200)  # the last two of random trees
SPARSE_BATCH = 40
DENSE_BATCH = 4


def sparse_run(p: Problem) -> Callable[[int], object]:
    """Return run(n): n steps of the solver, each linearized at another state."""
    pose = make_pose(p.tree)
    blocks = make_blocks(p.tree)
    work = make_workspace(p.tree)
    return lambda n: loops.steps(
        n, p.tree, p.terms, p.stage, p.damping, p.root_scale, p.bank, pose, blocks, work
    )


def called_run(p: Problem) -> Callable[[int], object]:
    """Return run(n): n steps of the solver, each called from Python, as those of the dense baseline
    are.
    """
    steps = sparse_run(p)
    return lambda n: [steps(1) for _ in range(n)]


def dense_run(p: Problem) -> Callable[[int], object]:
    """Return run(n): n dense steps."""
    dense = Dense(p)
    return lambda n: [dense.step(k) for k in range(n)]


def iteration_run(p: Problem) -> Callable[[int], object]:
    """Return run(n): n whole iterations: step, move, linearize at the trial point."""
    poses = (make_pose(p.tree), make_pose(p.tree))
    blocks = (make_blocks(p.tree), make_blocks(p.tree))
    curvature = make_curvature(p.tree)
    work = make_workspace(p.tree)
    return lambda n: loops.iterations(
        n,
        p.tree,
        p.terms,
        p.stage,
        p.damping,
        p.root_scale,
        p.bank,
        *poses,
        *blocks,
        curvature,
        work,
    )


def prior_run(p: Problem) -> Callable[[int], object]:
    """Return run(n): n evaluations of the joint prior of all joints, with Jacobian and sums."""
    pose = make_pose(p.tree)
    blocks = make_blocks(p.tree)
    return lambda n: loops.priors(n, p.tree, p.terms, p.stage, p.bank, pose, blocks)


def compare(
    problems: dict[str, Problem], rounds: int
) -> tuple[dict[str, float], dict[str, float], dict[str, float]]:
    """Return the times of a sparse step in a compiled loop, of one called from Python, and of a
    dense step.

    Microseconds, measured in turns. The dense step is called from Python.
    """
    runs = {}
    counts = {}
    for name, p in problems.items():
        runs[f"s {name}"] = sparse_run(p)
        counts[f"s {name}"] = SPARSE_BATCH
        runs[f"c {name}"] = called_run(p)
        counts[f"c {name}"] = SPARSE_BATCH
        runs[f"d {name}"] = dense_run(p)
        counts[f"d {name}"] = DENSE_BATCH
    times = take_turns(runs, counts, rounds)
    sparse, called, dense = ({n: times[f"{kind} {n}"] for n in problems} for kind in "scd")
    return sparse, called, dense


def target_table(rounds: int) -> dict[str, object]:
    """Return gn_step, dense_over_sparse, dense_over_called, iteration and prior_23_joints."""
    problems = {name: make_problem(K, P, N, prior) for name, (K, P, N, prior, _) in TARGETS.items()}
    sparse, called, dense = compare(problems, rounds)
    more = take_turns(
        {
            "iteration": iteration_run(make_problem(23, 10, 120, everything=True)),
            "prior_23_joints": prior_run(make_problem(23, 10, 52, joint_flow=True)),
        },
        {"iteration": SPARSE_BATCH, "prior_23_joints": SPARSE_BATCH},
        rounds,
    )
    ratios = {n: dense[n] / sparse[n] for n in sparse}
    called_ratios = {n: dense[n] / called[n] for n in sparse}
    return {
        "gn_step": sparse,
        "dense_over_sparse": ratios,
        "dense_over_called": called_ratios,
        **more,
    }


def experiment(which: int, rounds: int, terms: int | None = None) -> list[dict[str, float]]:
    """Return the rows of the paper's Experiment 1 (P = 0, growing N), 2 (P = 10, growing N) or 3
    (growing P).

    :param terms: N of Experiment 3. If None, as in the paper: one term of each kind for every part,
        N = 3 (K + 1).
    :return: rows of K, P, N, and the times of a sparse and of a dense step in microseconds.
    """
    if which == 3:
        points = [(K, P, terms or 3 * (K + 1)) for K in (23, 51) for P in SHAPES]
    else:
        points = [(K, 10 * (which - 1), N) for K in (23, 51) for N in SIZES]
    problems = {point: make_problem(*point) for point in points}
    sparse, _, dense = compare({str(key): p for key, p in problems.items()}, rounds)
    return [
        {"K": K, "P": P, "N": N, "sparse": sparse[str((K, P, N))], "dense": dense[str((K, P, N))]}
        for K, P, N in problems
    ]


def many_joints(rounds: int) -> list[dict[str, float]]:
    """Return the times of a sparse and of a dense step in microseconds for growing K, N = 600."""
    points = [(K, P) for P in (0, 10) for K in JOINTS]
    problems = {f"K{K}_P{P}": make_problem(K, P, 600) for K, P in points}
    sparse, _, dense = compare(problems, rounds)
    return [
        {"K": K, "P": P, "N": 600, "sparse": sparse[f"K{K}_P{P}"], "dense": dense[f"K{K}_P{P}"]}
        for K, P in points
    ]


def growth(rows: list[dict[str, float]], K: int, method: str) -> float:
    """Return the exponent a of time ~ N^a, fitted over the rows of K joints."""
    chosen = [row for row in rows if row["K"] == K]
    return float(
        np.polyfit(np.log([r["N"] for r in chosen]), np.log([r[method] for r in chosen]), 1)[0]
    )


def growth_in_joints(rows: list[dict[str, float]], method: str) -> float:
    """Return the median exponent a of time ~ K^a between the bodies of the rows, whose points are
    in the same order.
    """
    small, large = ([row[method] for row in rows if row["K"] == K] for K in (23, 51))
    return float(
        np.median([np.log(b / a) / np.log(51 / 23) for a, b in zip(small, large, strict=True)])
    )
