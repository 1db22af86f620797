# SPDX-License-Identifier: Apache-2.0
"""The normal equations of a frame and their solution, for those who study the step itself.

The unknowns of a step are d = (w, nu, u_1..u_K, dbeta), n = 6 + 3K + P of them: the root's twist in
camera axes about the pelvis, the rotation of each joint in camera axes, and the shape,
    R_0 <- exp(w) R_0,   t_0 <- t_0 + nu,   Omega_i <- R_parᵀ exp(u_i) R_par Omega_i
Part i moves by x_i = x_par + U_i u_i, U_i = [I; [t_i - t_0]x], so that the sparse blocks of
`part.Blocks` are those of the paper's equation (20), and with x_i = X_i d the dense ones
    H = sum_i X_iᵀ M_i X_i + ...,   g = sum_i X_iᵀ m_i + ...
The direction comes from the recursion in O(K) + O(N) and never forms H.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..gauss_newton.linearize import linearize as write_blocks
from ..gauss_newton.linearize import make_blocks
from ..gauss_newton.optimizer import MIN_DAMPING
from ..gauss_newton.recursion import Workspace, make_workspace, step
from ..gauss_newton.terms import Terms, make_terms
from ..measurements import Measurements
from ..options import Options, Priors, default_priors
from ..part import GRADIENT, SHAPE, Array, Blocks, Pose
from ..points import numbered
from ..residuals.external import raise_failure
from ..rotations import exp, hat
from ..state import State
from ..tree import BodyArrays, Tree, make_tree
from ..validation import check_type, check_weight


@dataclass
class NormalEquations:
    """H d = -g of 1/2 sum |r|^2 at a state; n = 6 + 3K + P unknowns, as the module orders them."""

    cost: float
    g: Array  # (n,) gradient Jᵀr
    H: Array  # (n, n) JᵀJ, of robust kernels with their weights


@dataclass
class GaussNewtonStep:
    """A solution of (H + Lambda) d = -g."""

    direction: Array  # (n,)
    predicted_decrease: float  # of the cost: 1/2 gᵀ(H + Lambda)^-1 g + 1/2 dᵀ Lambda d
    state: State  # moved by the direction


def linearize(
    body: BodyArrays,
    measurements: Measurements,
    state: State,
    *,
    priors: Priors | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
) -> NormalEquations:
    """Return the normal equations of a frame at a state, as dense arrays.

    :param state: camera frame, metres. :param priors: `default_priors(body)` unless given.
    :param options: weights and robust kernels are those of the last stage from a known state.
    :raises ShapeError: an array does not fit the body.
    :raises InvalidValueError: a value that no fit can use.
    """
    tree, terms, stage = problem_of(body, measurements, priors, options)
    return equations(tree, terms, stage, state, options.triggs)


def gauss_newton_step(
    body: BodyArrays,
    measurements: Measurements,
    state: State,
    *,
    priors: Priors | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
    damping: float = 0.0,
) -> GaussNewtonStep:
    """Return the Gauss-Newton step of a frame from a state, by the recursion in O(K) + O(N).

    :param damping: lambda of Lambda = lambda diag(1, 1, 1, s^2, s^2, s^2, 1, ..., 1, 0, ..., 0),
        with s = 1 / `Options.root_length` for the root's position and 0 for the shape. Unknowns of
        which nothing is measured need some, or stay where they are.
    Others as of `linearize`.
    :raises ShapeError: an array does not fit the body.
    :raises InvalidValueError: a value that no fit can use.
    """
    check_weight(damping, "damping")
    tree, terms, stage = problem_of(body, measurements, priors, options)
    _, pose, blocks, work = _linearized(tree, terms, stage, state, options.triggs)
    decrease = step(tree, pose, blocks, float(damping), 1.0 / options.root_length, work)
    direction = _direction(tree, work)
    return GaussNewtonStep(direction, float(decrease), moved(tree, state, direction))


def problem_of(
    body: BodyArrays, measurements: Measurements, priors: Priors | None, options: Options
) -> tuple[Tree, Terms, Array]:
    """Return tree, terms, and the row (2, weights) of weights and 1/sigma.

    :raises ShapeError: an array does not fit the body.
    :raises InvalidValueError: a value that no fit can use.
    """
    check_type(measurements, Measurements, "measurements")
    check_type(priors, (Priors, type(None)), "priors")
    check_type(options, Options, "options")
    tree = make_tree(body)
    priors = default_priors(body) if priors is None else priors
    terms = make_terms(tree, numbered(body, measurements), priors)
    last = options.schedule(cold=False)[-1]
    return tree, terms, options.stage_table([last])[0][0]


def equations(
    tree: Tree, terms: Terms, stage: Array, state: State, triggs: float = 0.0
) -> NormalEquations:
    """Return the normal equations at a state.

    :param stage: (2, C) a row of weights and a row of 1/sigma, as of `Options.stage_table`.
    """
    cost, pose, blocks, _ = _linearized(tree, terms, stage, state, triggs)
    return NormalEquations(cost, *_dense(tree, pose, blocks))


def gradient(tree: Tree, terms: Terms, stage: Array, state: State, triggs: float = 0.0) -> Array:
    """Return g (n,) of `equations` alone, in O(K) + O(N).

    The force and moment about the pelvis on a joint are those on all parts below it.
    """
    _, pose, blocks, _ = _linearized(tree, terms, stage, state, triggs)
    forces = blocks.A[:, :, GRADIENT].copy()
    for i in range(len(tree.parents) - 1, 0, -1):
        forces[tree.parents[i]] += forces[i]
    moments = forces[1:, :3] - np.cross(pose.t[1:] - pose.t[0], forces[1:, 3:])
    joints = blocks.H_u[1:, :, GRADIENT] + moments
    return np.concatenate([forces[0], joints.ravel(), blocks.c[: tree.shape]])


def preconditioner(
    tree: Tree, terms: Terms, stage: Array, state: State, triggs: float = 0.0
) -> Callable[[Array], Array]:
    """Return the function that solves (H + Lambda) d = b (n,) by the recursion, hardly damped."""
    _, pose, blocks, work = _linearized(tree, terms, stage, state, triggs)
    end = 3 + 3 * len(tree.parents)

    def solve(b: Array) -> Array:
        blocks.A[:, :, GRADIENT] = 0.0
        blocks.A[0, :, GRADIENT] = b[:6]
        blocks.H_u[1:, :, GRADIENT] = b[6:end].reshape(-1, 3)
        blocks.c[: tree.shape] = b[end:]
        step(tree, pose, blocks, MIN_DAMPING, 1.0, work)
        return -_direction(tree, work)

    return solve


def _direction(tree: Tree, work: Workspace) -> Array:
    """Return the step (n,) that is in `work`."""
    return np.concatenate([work.x[0], work.u[1:].ravel(), work.dbeta[: tree.shape]])


def _linearized(
    tree: Tree, terms: Terms, stage: Array, state: State, triggs: float
) -> tuple[float, Pose, Blocks, Workspace]:
    """Return the cost, the placed parts and the blocks at a state, and memory for a step."""
    pose = state.pose(tree)
    blocks = make_blocks(tree)
    work = make_workspace(tree)
    cost = write_blocks(tree, terms, stage, float(triggs), pose, blocks, work.scratch)
    raise_failure()
    return float(cost), pose, blocks, work


def _dense(tree: Tree, pose: Pose, blocks: Blocks) -> tuple[Array, Array]:
    """Return the gradient (n,) and JᵀJ (n, n) of the blocks of all parts."""
    P = tree.shape
    n = 3 + 3 * len(tree.parents) + P
    end = SHAPE + P
    g = np.zeros(n)
    H = np.zeros((n, n))
    X = np.zeros((len(tree.parents), 6, n))
    beta = np.eye(n)[n - P :]
    for i, parent in enumerate(tree.parents):
        if i == 0:
            X[0] = np.eye(6, n)
        else:
            u = np.eye(n)[3 + 3 * i : 6 + 3 * i]
            U = np.vstack([np.eye(3), hat(pose.t[i] - pose.t[0])])
            X[i] = X[parent] + U @ u
            H_u = blocks.H_u[i]
            g += u.T @ H_u[:, GRADIENT]
            mixed = u.T @ (H_u[:, :6] @ X[i] + H_u[:, SHAPE:end] @ beta)
            H += mixed + mixed.T + u.T @ blocks.H_uu[i] @ u
        A = blocks.A[i]
        g += X[i].T @ A[:, GRADIENT]
        mixed = X[i].T @ A[:, SHAPE:end] @ beta
        H += mixed + mixed.T + X[i].T @ A[:, :6] @ X[i]
    C = np.triu(blocks.C[:P, :P])
    g += beta.T @ blocks.c[:P]
    H += beta.T @ (C + np.triu(C, 1).T) @ beta
    return g, H


def moved(tree: Tree, state: State, d: Array) -> State:
    """Return the state after a step d (n,) of the unknowns."""
    R_parent = state.pose(tree).R[tree.parents[1:]]
    last = len(d) - tree.shape
    turns = exp(d[6:last].reshape(-1, 3))
    Omega = np.swapaxes(R_parent, 1, 2) @ turns @ R_parent @ state.Omega
    R = exp(d[:3]) @ state.R_camera_root
    return State(R, state.t_camera_root + d[3:6], Omega, state.beta + d[last:])
