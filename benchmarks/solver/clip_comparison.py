# SPDX-License-Identifier: GPL-3.0-or-later
"""The step of a whole clip against one dense matrix, against frames that are fitted alone and
smoothed, and with outlines.

The dense way writes the clip's normal equations H (n, n), n = T (6 + 3K) + P, as one matrix,
factorizes it by LAPACK's Cholesky and solves the two triangular systems. In front of it stands, as
in `dense.py`, the product H = JᵀJ by BLAS.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.kinematics.smoothing import smooth_root, smooth_rotations
from ...solver import Options, Priors, Stage, State, Weights, fit_motion
from ...solver.fitting.frame_solver import fit_tree
from ...solver.measurements import Measurements
from ...solver.motion.band import make_factor, solve_clip
from ...solver.motion.system import GLOBALS, ClipSystem
from ...solver.residuals.outline import pack
from ...solver.tree import make_tree, with_fixed_shape
from .clip_steps import MOTION, RATE, in_turns, make_clip
from .dense import solve_cholesky
from .problem import Problem, make_problem

DENSE_LENGTHS = (5, 10, 20)
FRAMES = 150  # of the other comparisons
RESIDUALS_PER_FRAME = 320  # of 120 terms, 40 of each kind with 2, 3 and 3 rows
OUTLINE_ROWS = 150  # of a frame, about as many as the capture finds
_SIGMA = 1e-4  # of the robust kernel, normalized image coordinates, squared


def against_dense(rounds: int) -> list[dict[str, float]]:
    """Return rows of frames, and the least milliseconds of the whole step in both ways, in one
    thread, K=23, P=10.
    """
    rows = []
    for frames in DENSE_LENGTHS:
        problem, poses = make_clip(23, frames, contacts=0)
        system = problem.make_system()
        scale = problem.settings.root_scale
        problem.linearize(0, poses, system)
        factor = make_factor(system)
        parts = len(problem.tree.parents)
        H, g = dense_equations(system, frames, parts, problem.tree.global_count, 1.0, scale)
        J = np.random.default_rng(0).standard_normal(
            (frames * RESIDUALS_PER_FRAME + 3 * (frames - 2) * parts, len(g))
        )
        eliminated, solved, product = in_turns(
            rounds,
            partial(solve_clip, problem.tree, system, 1.0, scale, factor),
            partial(solve_cholesky, H, g),
            partial(np.matmul, J.T, J),
        )
        rows.append({
            "frames": frames, "elimination_ms": eliminated, "dense_solve_ms": solved,
            "dense_product_ms": product,
            "dense_over_elimination": (solved + product) / eliminated,
            "solve_alone": solved / eliminated,
        })  # fmt: skip
    return rows


def dense_equations(
    system: ClipSystem, frames: int, parts: int, count: int, damping: float, root_scale: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the damped normal equations of a clip without standing points as one matrix (n, n),
    and Jᵀr (n,).
    """
    m = 3 + 3 * parts
    H = np.zeros((frames * m + count, frames * m + count))
    g = np.zeros(frames * m + count)
    slots = [0, *range(6, m, 3), 3]
    for f in range(frames):
        here = slice(f * m, (f + 1) * m)
        H[here, here] = np.triu(system.D[f, :m, :m])
        for hop, blocks in ((1, system.B1[f]), (2, system.B2[f])):
            for block, at in zip(blocks if f >= hop else (), slots, strict=False):
                first = (f - hop) * m + at
                H[first : first + 3, f * m + at : f * m + at + 3] = block.T
        H[here, frames * m :] = system.N[f, :m, GLOBALS : GLOBALS + count]
        g[here] = system.N[f, :m, 0]
    H[frames * m :, frames * m :] = np.triu(system.C[:count, :count])
    g[frames * m :] = system.c[:count]
    H = np.triu(H) + np.triu(H, 1).T
    damped = np.tile(np.r_[np.ones(3), np.full(3, root_scale**2), np.ones(m - 6)], frames)
    H[np.arange(frames * m), np.arange(frames * m)] += damping * damped
    return H, g


def against_frames(rounds: int) -> list[dict[str, float]]:
    """Return the least milliseconds a frame of a clip fitted at once, and of its frames fitted
    alone and smoothed.

    Both start from the same poses, with the shape given, and stop at the relative decrease at which
    a capture does; K=23, 120 terms a frame with 3 pixels of noise.
    """
    problem, seen, states = _noisy_clip(FRAMES)
    options, clip_options = (Options(stages=[Stage(Weights(), stop, 50)]) for stop in (1e-4, 1e-3))
    beta = states[0].beta
    times = np.arange(FRAMES) / RATE
    tree = with_fixed_shape(make_tree(problem.body), beta)

    def together() -> None:
        fit_motion(
            problem.body,
            seen,
            times,
            init=states,
            priors=Priors(),
            options=clip_options,
            motion=MOTION,
            shape=beta,
            window=np.inf,
        )

    def alone() -> None:
        starts = [replace(state, beta=np.zeros(0)) for state in states]
        fits = [
            fit_tree(tree, m, state, Priors(), options)
            for m, state in zip(seen, starts, strict=True)
        ]
        smooth_rotations(
            np.array([[fit.state.R_camera_root, *fit.state.Omega] for fit in fits]), times
        )
        smooth_root(np.array([fit.state.t_camera_root for fit in fits]), times)

    clip, frames = in_turns(rounds, together, alone)
    return [
        {
            "frames": FRAMES,
            "clip_ms": clip / FRAMES,
            "frames_ms": frames / FRAMES,
            "ratio": clip / frames,
        }
    ]


def with_outlines(rounds: int) -> list[dict[str, float]]:
    """Return the least milliseconds a frame of linearizing a clip, without outlines, with one in
    six frames, in all.
    """
    calls: list[Callable[[], object]] = []
    for every in (0, 6, 1):
        problem, poses = make_clip(23, FRAMES, added=partial(_with_outline, every=every))
        calls.append(partial(problem.linearize, 0, poses, problem.make_system()))
    without, some, all_ = in_turns(rounds, *calls)
    return [{
        "frames": FRAMES, "rows_a_frame": OUTLINE_ROWS, "without_ms": without / FRAMES,
        "one_in_six_ms": some / FRAMES,
        "all_ms": all_ / FRAMES,
    }]  # fmt: skip


def _with_outline(measurements: Measurements, f: int, every: int) -> Measurements:
    if not every or f % every:
        return measurements
    rng = np.random.default_rng(f)
    assert measurements.keypoints2d is not None
    points = np.resize(np.asarray(measurements.keypoints2d.indices), OUTLINE_ROWS)
    angle = rng.uniform(0.0, 2 * np.pi, OUTLINE_ROWS)
    ones = np.ones(OUTLINE_ROWS)
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    contour = rng.uniform(-0.1, 0.1, (OUTLINE_ROWS, 2))
    rows = pack(
        points,
        np.zeros((OUTLINE_ROWS, 3)),
        contour,
        normal,
        (ones, ones),
        (_SIGMA * ones, _SIGMA * ones),
    )
    return replace(measurements, tables={"outline": rows})


def _noisy_clip(frames: int) -> tuple[Problem, list[Measurements], list[State]]:
    """Return a benchmark problem, its measurements with noise of each frame's own, and states near
    the truth.
    """
    problem = make_problem(23, 10, 120)
    rng = np.random.default_rng(2)
    seen = []
    states = []
    bank = problem.bank
    for f in range(frames):
        points = problem.measurements.keypoints2d
        assert points is not None
        pixels = np.asarray(points.pixels) + 3.0 * rng.standard_normal(np.shape(points.pixels))
        seen.append(replace(problem.measurements, keypoints2d=replace(points, pixels=pixels)))
        k = f % len(bank[0])
        states.append(State(bank[0][k], bank[1][k], bank[2][k, 1:], bank[3][0][:10]))
    return problem, seen, states
