# SPDX-License-Identifier: GPL-3.0-or-later
"""Run Meta's momentum on the benchmark problem, in its own environment; print the microseconds of
one iteration.

    python momentum_run.py PROBLEM.npz        (numpy and pymomentum alone; nothing of Scope is
                                              imported)

As close to the problem as momentum's error functions allow: the same tree, N / 3 points with a
position, a projection and an axis each; beta moves the joints through the parameter transform.
Differences: Euler angles for joint states, no beta in the points themselves (V_j = 0, which saves
momentum work), no robust kernel on the projections, single precision.
"""

from __future__ import annotations

import sys
import time

import numpy as np

REPEATS = 30
ITERATIONS = 10


def main(path: str) -> float:
    """Return the median time of an iteration in microseconds."""
    import pymomentum.geometry as geometry
    import pymomentum.solver2 as solver

    with np.load(path) as data:
        d = {key: data[key] for key in data}
    n = len(d["parents"])
    P = d["S"].shape[2]
    identity = np.array([0, 0, 0, 1], np.float32)
    joints = [
        geometry.Joint(f"joint{i}", int(d["parents"][i]), identity, d["l"][i].astype(np.float32))
        for i in range(n)
    ]
    skeleton = geometry.Skeleton(joints)
    names = [f"root{k}" for k in range(6)] + [f"joint{i}_{a}" for i in range(1, n) for a in "xyz"]
    names += [f"beta{k}" for k in range(P)]
    transform = np.zeros((7 * n, len(names)), np.float32)
    transform[range(6), range(6)] = 1.0
    for i in range(1, n):
        for axis in range(3):
            transform[7 * i + 3 + axis, 6 + 3 * (i - 1) + axis] = 1.0
        transform[7 * i : 7 * i + 3, len(names) - P :] = d["S"][i]
    character = geometry.Character(
        "body", skeleton, geometry.ParameterTransform(names, skeleton, transform)
    )

    positions = solver.PositionErrorFunction(
        character, alpha=-2.0, c=0.1, weight=float(d["weights"][1])
    )
    projections = solver.ProjectionErrorFunction(
        character, near_clip=0.05, weight=float(d["weights"][0])
    )
    axes = solver.FixedAxisDiffErrorFunction(
        character, alpha=-2.0, c=0.3, weight=float(d["weights"][2])
    )
    shape = solver.ModelParametersErrorFunction(character, weight=float(d["weights"][3]))
    held = np.array([0.0] * (len(names) - P) + [1.0] * P, np.float32)
    shape.set_target_parameters(np.zeros(len(names), np.float32), held)
    camera = np.concatenate([np.eye(3), np.zeros((3, 1))], axis=1).astype(np.float32)
    for j, part in enumerate(d["part"]):
        offset = d["v_bar"][j].astype(np.float32)
        positions.add_constraint(int(part), target=d["points"][j].astype(np.float32), offset=offset)
        target = (d["points"][j, :2] / d["points"][j, 2]).astype(np.float32)
        projections.add_constraint(
            projection=camera, target=target, parent=int(part), offset=offset
        )
        local = offset / np.linalg.norm(offset)
        axes.add_constraint(local, d["axes"][j].astype(np.float32), int(part))
    function = solver.SkeletonSolverFunction(character, [positions, projections, axes, shape])
    options = solver.GaussNewtonSolverOptions()
    options.min_iterations = options.max_iterations = ITERATIONS
    options.regularization = 0.05
    options.do_line_search = False
    options.threshold = 0.0
    optimizer = solver.GaussNewtonSolver(function, options)
    rng = np.random.default_rng(0)
    times = []
    for _ in range(REPEATS):
        start = (0.1 * rng.standard_normal(len(names))).astype(np.float32)
        start[:3] += d["root"].astype(np.float32)
        began = time.perf_counter()
        optimizer.solve(start)
        done = max(len(optimizer.per_iteration_errors), 1)
        times.append((time.perf_counter() - began) / done)
    return float(np.median(times[2:])) * 1e6


if __name__ == "__main__":
    print(main(sys.argv[1]))
