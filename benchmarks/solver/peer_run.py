# SPDX-License-Identifier: GPL-3.0-or-later
"""Run one peer on the benchmark problem, in the peer's own environment; print the microseconds of
one iteration.

Unknowns are the coordinates d of a step away from a state of the bank, as in dense.py; residuals
and Jacobian come from the same compiled code as there.
"""

from __future__ import annotations

import os
import sys
import time

os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np
from numpy.typing import NDArray

from ...solver.gauss_newton.linearize import make_pose, place_parts
from ...solver.gauss_newton.recursion import make_workspace, retract
from .dense import Dense, fill
from .loops import put
from .problem import make_problem

REPEATS = 30
ITERATIONS = 10


class Residuals:
    """Residuals r(d) and their Jacobian at a state of the bank."""

    def __init__(self) -> None:
        """Make the problem K = 23, P = 10, N = 120."""
        self.problem = make_problem(23, 10, 120)
        self.dense = Dense(self.problem)
        tree = self.problem.tree
        self.base = make_pose(tree)
        self.trial = make_pose(tree)
        self.work = make_workspace(tree)
        self.size = len(self.dense.direction)

    def start(self, k: int) -> None:
        """Begin at state k."""
        put(self.problem.bank, k, self.base)
        place_parts(self.problem.tree, self.base)

    def at(self, d: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return r and J at d."""
        p = self.problem
        work = self.work
        n = len(work.u)
        work.x[0] = d[:6]
        work.u[1:] = d[6 : 3 + 3 * n].reshape(-1, 3)
        work.dbeta[: p.tree.shape_count] = d[3 + 3 * n :]
        retract(p.tree, self.base, work, self.trial)
        fill(p.tree, p.terms, p.stage, self.trial, self.dense.J, self.dense.r, self.dense.moved)
        return self.dense.r, self.dense.J


def run_scipy(residuals: Residuals) -> float:
    """Time of an iteration of scipy.optimize.least_squares (MINPACK's Levenberg-Marquardt)."""
    from scipy.optimize import least_squares

    times = []
    for k in range(REPEATS):
        residuals.start(k)
        start = time.perf_counter()
        found = least_squares(
            lambda d: residuals.at(d)[0].copy(),
            np.zeros(residuals.size),
            lambda d: residuals.at(d)[1].copy(),
            method="lm",
            max_nfev=ITERATIONS,
            x_scale=1.0,
        )
        times.append((time.perf_counter() - start) / max(found.nfev, 1))
    return float(np.median(times[2:])) * 1e6


def run_ceres(residuals: Residuals) -> float:
    """Time of an iteration of Ceres with dense normal equations and Cholesky; its callback into
    Python included.
    """
    import pyceres

    class Cost(pyceres.CostFunction):
        """All residuals in one block."""

        def __init__(self) -> None:
            super().__init__()
            self.set_num_residuals(len(residuals.dense.r))
            self.set_parameter_block_sizes([residuals.size])

        def Evaluate(self, parameters, r, jacobians) -> bool:  # type: ignore[no-untyped-def]
            """Write r, and J where it is wanted."""
            values, J = residuals.at(np.asarray(parameters[0]))
            r[:] = values
            if jacobians is not None and jacobians[0] is not None:
                jacobians[0][:] = J.ravel()
            return True

    times = []
    for k in range(REPEATS):
        residuals.start(k)
        d = np.zeros(residuals.size)
        problem = pyceres.Problem()
        options = pyceres.SolverOptions()
        problem.add_residual_block(Cost(), None, [d])
        options.linear_solver_type = pyceres.LinearSolverType.DENSE_NORMAL_CHOLESKY
        options.max_num_iterations = ITERATIONS
        options.num_threads = 1
        options.logging_type = pyceres.LoggingType.SILENT
        summary = pyceres.SolverSummary()
        start = time.perf_counter()
        pyceres.solve(options, problem, summary)
        times.append((time.perf_counter() - start) / max(summary.num_successful_steps, 1))
    return float(np.median(times[2:])) * 1e6


if __name__ == "__main__":
    print({"scipy": run_scipy, "ceres": run_ceres}[sys.argv[1]](Residuals()))
