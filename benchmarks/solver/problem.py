# SPDX-License-Identifier: GPL-3.0-or-later
"""The benchmark problem: a real kinematic tree with N terms spread evenly over it.

Every keypoint has a dense, non-zero V_j and one term of each kind (2D, 3D, orientation field), so N
terms are N / 3 keypoints. Weights are set at run time, the robust kernel is on, and the states of
`Problem.bank` alternate, so that each step is linearized at a different state. N = 52 are 19 2D, 17
3D and 16 orientation terms on 20 keypoints.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver import (
    Measurements,
    Options,
    Priors,
    Stage,
    State,
    Tree,
    Weights,
    load_body,
    make_tree,
    rotations,
)
from ...solver.gauss_newton.terms import Terms, make_terms
from ...solver.learned_prior import load_joint_prior
from ...solver.measurements import Keypoints2D, Keypoints3D, OrientationField, PosePriors
from ...solver.residuals import joint_limits
from ...solver.residuals.registry import RESIDUALS

BODIES = {23: "scope", 51: "scope_h"}
INTRINSICS = np.array([[1100.0, 0.0, 640.0], [0.0, 1100.0, 360.0], [0.0, 0.0, 1.0]])
SPLIT = {52: (19, 17, 16)}  # 2D, 3D, orientation; a third of N each otherwise
BANK = 16  # states that alternate


@dataclass
class Arrays:
    """The arrays of a body that the solver reads: see `BodyArrays`."""

    parents: NDArray[np.intp]
    S: NDArray[np.float64]
    l: NDArray[np.float64]
    keypoint_part: NDArray[np.intp]
    v_bar: NDArray[np.float64]
    V: NDArray[np.float64]


@dataclass
class Problem:
    """One frame, ready for the kernels, and the states to linearize it at."""

    tree: Tree
    terms: Terms
    stage: NDArray[np.float64]  # (2, weights)
    damping: float
    root_scale: float
    bank: tuple[Any, ...]  # R_0 (B, 3, 3), t_0 (B, 3), Omega (B, K+1, 3, 3), beta (B, W)
    body: Arrays
    measurements: Measurements


def make_problem(
    K: int, P: int, N: int, joint_flow: bool = False, everything: bool = False, seed: int = 0
) -> Problem:
    """Return the benchmark problem; with `everything` also a root prior, both joint priors and
    limits.

    :param K: joints, of one of BODIES, or of a random tree that only the step's time is of.
    """
    rng = np.random.default_rng(seed)
    body: Any = load_body(BODIES[K]) if K in BODIES else _random_tree(rng, K)
    n2, n3, nd = SPLIT.get(N, (N // 3,) * 3)
    M = max(n2, n3, nd, 20 if N in SPLIT else 0)
    part = np.sort(np.arange(M) % (K + 1))
    arrays = Arrays(
        body.parents, body.S[:, :, :P], body.l, part, 0.15 * rng.standard_normal((M, 3)),
        0.01 * rng.standard_normal((M, 3, P)),
    )  # fmt: skip
    tree = make_tree(arrays)
    truth = _state(rng, K, P)
    pose = truth.pose(tree)
    lever = np.einsum("mij,mj->mi", pose.R[part], arrays.V @ truth.beta + arrays.v_bar)
    points = lever + pose.t[part]
    pixels = points @ INTRINSICS.T
    confidence = rng.uniform(0.4, 1.0, (3, M))
    a, b, c = (np.sort(rng.permutation(M)[:n]) for n in (n2, n3, nd))
    measurements = Measurements(
        INTRINSICS,
        Keypoints2D(
            a, pixels[a, :2] / pixels[a, 2:] + 3.0 * rng.standard_normal((n2, 2)), confidence[0, a]
        ),
        Keypoints3D(b, points[b] + 0.02 * rng.standard_normal((n3, 3)), confidence[1, b]),
        OrientationField(
            M + part[c], c, lever[c] + 0.01 * rng.standard_normal((nd, 3)), confidence[2, c]
        ),
    )
    priors = Priors()
    if joint_flow or everything:
        priors = replace(priors, flow=load_joint_prior().tables(body.joint_names))
    if everything:
        priors = replace(priors, limits=joint_limits.hinges_of(list(body.joint_names)))
        root = PosePriors([0], pose.R[:1], pose.t[:1], [100.0], [100.0])
        measurements = replace(measurements, pose_priors=root)
    terms = make_terms(tree, measurements, priors)
    if not everything:  # the rest-pose prior of all joints is not part of the problem
        rest = list(RESIDUALS).index("joint_prior")
        terms = terms._replace(
            ints=tuple(t[:0] if k == rest else t for k, t in enumerate(terms.ints)),
            floats=tuple(t[:0] if k == rest else t for k, t in enumerate(terms.floats)),
        )
    options = Options()
    table, _, _ = options.stage_table([Stage(Weights())])
    bank = _bank(rng, truth, tree)
    return Problem(
        tree,
        terms,
        table[0],
        options.damping,
        1.0 / options.root_length,
        bank,
        arrays,
        measurements,
    )


def _random_tree(rng: np.random.Generator, K: int) -> Arrays:
    """Return K joints in branches as long as those of a body, without keypoints."""
    parents = np.array([-1, *(rng.integers(max(0, i - 4), i) for i in range(1, K + 1))])
    S = 0.02 * rng.standard_normal((K + 1, 3, 10))
    offsets = 0.15 * rng.standard_normal((K + 1, 3))
    nothing = np.zeros((0, 3))
    return Arrays(parents, S, offsets, np.zeros(0, np.intp), nothing, np.zeros((0, 3, 10)))


def _state(rng: np.random.Generator, K: int, P: int) -> State:
    return State(
        np.diag([1.0, -1.0, -1.0]) @ rotations.exp(0.2 * rng.standard_normal(3)),
        np.array([0.1, -0.1, 4.0]),
        rotations.exp(0.25 * rng.standard_normal((K, 3))),
        0.5 * rng.standard_normal(P),
    )


def _bank(rng: np.random.Generator, truth: State, tree: Tree) -> tuple[Any, ...]:
    """Return states near the truth, as during an optimization."""
    poses = []
    for _ in range(BANK):
        moved = State(
            truth.R_camera_root @ rotations.exp(0.03 * rng.standard_normal(3)),
            truth.t_camera_root + 0.02 * rng.standard_normal(3),
            truth.Omega @ rotations.exp(0.05 * rng.standard_normal((len(truth.Omega), 3))),
            truth.beta + 0.1 * rng.standard_normal(len(truth.beta)),
        )
        poses.append(moved.pose(tree))
    return (
        np.array([p.R[0] for p in poses]),
        np.array([p.t[0] for p in poses]),
        np.array([p.Omega for p in poses]),
        np.array([p.beta for p in poses]),
    )
