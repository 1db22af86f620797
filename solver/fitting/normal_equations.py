# SPDX-License-Identifier: Apache-2.0
"""The normal equations of a frame and their solution, for those who study the step itself; and
whether the blocks of a registered residual are those of its cost.

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
from typing import Any

import numpy as np

from ..errors import InvalidValueError
from ..gauss_newton.linearize import linearize as write_blocks
from ..gauss_newton.linearize import make_blocks
from ..gauss_newton.optimizer import MIN_DAMPING
from ..gauss_newton.recursion import Workspace, make_workspace, step
from ..gauss_newton.terms import Terms, make_terms
from ..measurements import Keypoints3D, Measurements
from ..options import Options, Priors, Stage, Weights, default_priors
from ..part import GRADIENT, SHAPE, Array, Blocks, Pose
from ..points import numbered
from ..residuals.external import raise_failure
from ..rotations import exp, hat
from ..state import State
from ..tree import BodyArrays, Tree, make_tree
from ..validation import check_count, check_type, check_weight


@dataclass
class NormalEquations:
    """H d = -g of 1/2 sum |r|^2 at a state, in n = 6 + 3K + P unknowns: the root's turn and shift
    in camera axes about the pelvis, the turns of joints 1..K in camera axes, and the shape.

    cost; g (n,): gradient Jᵀr; H (n, n): JᵀJ, of robust kernels with their weights.
    """

    cost: float
    g: Array
    H: Array


@dataclass
class GaussNewtonStep:
    """A solution d of (H + Lambda) d = -g.

    direction (n,): d, in the order of `NormalEquations`. predicted_decrease: of the cost,
    1/2 gᵀ(H + Lambda)^-1 g + 1/2 dᵀ Lambda d. state: moved by the direction.
    """

    direction: Array
    predicted_decrease: float
    state: State


def linearize(
    body: BodyArrays,
    measurements: Measurements,
    state: State,
    *,
    priors: Priors | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
) -> NormalEquations:
    """Return the normal equations of a frame at a state, as dense arrays.

    Those of the paper's equation (20), with the twists of all parts but the root eliminated.

    :param state: camera frame, metres. :param priors: `default_priors(body)` unless given.
    :param options: weights and robust kernels are those of the last stage from a known state.
    :raises ShapeError: an array does not fit the body.
    :raises InvalidValueError: a value that no fit can use.
    """
    tree, terms, stage = problem_of(body, measurements, priors, options)
    return equations(tree, terms, stage, state)


def gauss_newton_step(
    body: BodyArrays,
    measurements: Measurements,
    state: State,
    *,
    priors: Priors | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
    damping: float = 0.0,
) -> GaussNewtonStep:
    """Return the Gauss-Newton step of a frame from a state, by the recursion in O(K) + O(N) of
    section 3 of the paper.

    :param damping: lambda of Lambda = lambda diag(1, 1, 1, s^2, s^2, s^2, 1, ..., 1, 0, ..., 0),
        with s = 1 / `Options.root_length` for the root's position and 0 for the shape. Unknowns of
        which nothing is measured need some, or stay where they are.
    Others as of `linearize`.
    :raises ShapeError: an array does not fit the body.
    :raises InvalidValueError: a value that no fit can use.
    """
    check_weight(damping, "damping")
    tree, terms, stage = problem_of(body, measurements, priors, options)
    _, pose, blocks, work = _linearized(tree, terms, stage, state)
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


def equations(tree: Tree, terms: Terms, stage: Array, state: State) -> NormalEquations:
    """Return the normal equations at a state.

    :param stage: (2, C) a row of weights and a row of 1/sigma, as of `Options.stage_table`.
    """
    cost, pose, blocks, _ = _linearized(tree, terms, stage, state)
    return NormalEquations(cost, *_dense(tree, pose, blocks))


def gradient(tree: Tree, terms: Terms, stage: Array, state: State) -> Array:
    """Return g (n,) of `equations` alone, in O(K) + O(N).

    The force and moment about the pelvis on a joint are those on all parts below it.
    """
    _, pose, blocks, _ = _linearized(tree, terms, stage, state)
    forces = blocks.A[:, :, GRADIENT].copy()
    for i in range(len(tree.parents) - 1, 0, -1):
        forces[tree.parents[i]] += forces[i]
    moments = forces[1:, :3] - np.cross(pose.t[1:] - pose.t[0], forces[1:, 3:])
    joints = blocks.H_u[1:, :, GRADIENT] + moments
    return np.concatenate([forces[0], joints.ravel(), blocks.c[: tree.shape_count]])


def preconditioner(
    tree: Tree, terms: Terms, stage: Array, state: State
) -> Callable[[Array], Array]:
    """Return the function that solves (H + Lambda) d = b (n,) by the recursion, hardly damped."""
    _, pose, blocks, work = _linearized(tree, terms, stage, state)
    end = 3 + 3 * len(tree.parents)

    def solve(b: Array) -> Array:
        blocks.A[:, :, GRADIENT] = 0.0
        blocks.A[0, :, GRADIENT] = b[:6]
        blocks.H_u[1:, :, GRADIENT] = b[6:end].reshape(-1, 3)
        blocks.c[: tree.shape_count] = b[end:]
        step(tree, pose, blocks, MIN_DAMPING, 1.0, work)
        return -_direction(tree, work)

    return solve


def remaining_decrease(tree: Tree, terms: Terms, stage: Array, state: State) -> tuple[float, float]:
    """Return the decrease of the cost that a hardly damped step predicts, and the cost."""
    cost, pose, blocks, work = _linearized(tree, terms, stage, state)
    return float(step(tree, pose, blocks, MIN_DAMPING, 1.0, work)), cost


def _direction(tree: Tree, work: Workspace) -> Array:
    """Return the step (n,) that is in `work`."""
    return np.concatenate([work.x[0], work.u[1:].ravel(), work.dbeta[: tree.shape_count]])


def _linearized(
    tree: Tree, terms: Terms, stage: Array, state: State
) -> tuple[float, Pose, Blocks, Workspace]:
    """Return the cost, the placed parts and the blocks at a state, and memory for a step."""
    pose = state.pose(tree)
    blocks = make_blocks(tree)
    work = make_workspace(tree)
    cost = write_blocks(tree, terms, stage, pose, blocks, work.scratch)
    raise_failure()
    return float(cost), pose, blocks, work


def _dense(tree: Tree, pose: Pose, blocks: Blocks) -> tuple[Array, Array]:
    """Return the gradient (n,) and JᵀJ (n, n) of the blocks of all parts."""
    P = tree.shape_count
    n = 3 + 3 * len(tree.parents) + P
    end = SHAPE + P
    g = np.zeros(n)
    H = np.zeros((n, n))
    X = motion_of_parts(tree, pose)
    beta = np.eye(n)[n - P :]
    for i in range(len(tree.parents)):
        if i > 0:
            u = np.eye(n)[3 + 3 * i : 6 + 3 * i]
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


def motion_of_parts(tree: Tree, pose: Pose) -> Array:
    """Return X (K+1, 6, n): the twist of each part about the pelvis is x_i = X_i d."""
    n = 3 + 3 * len(tree.parents) + tree.shape_count
    X = np.zeros((len(tree.parents), 6, n))
    X[0] = np.eye(6, n)
    levers = hat(pose.t - pose.t[0])
    for i, parent in enumerate(tree.parents[1:], start=1):
        X[i] = X[parent]
        X[i, :3, 3 + 3 * i : 6 + 3 * i] = np.eye(3)
        X[i, 3:, 3 + 3 * i : 6 + 3 * i] = levers[i]
    return X


def motion_of_joints(tree: Tree, pose: Pose) -> Array:
    """Return the derivatives (K+1, 3, n) of the joints' positions by the unknowns: a joint moves
    with the twist (w, v) of its part about the pelvis, v + w x (t_i - t_0), and with the shape by
    D_i.
    """
    X = motion_of_parts(tree, pose)
    motion: Array = X[:, 3:] - hat(pose.t - pose.t[0]) @ X[:, :3]
    motion[:, :, X.shape[2] - tree.shape_count :] += pose.D[:, :, : tree.shape_count]
    return motion


def moved(tree: Tree, state: State, d: Array) -> State:
    """Return the state after a step d (n,) of the unknowns."""
    R_parent = state.pose(tree).R[tree.parents[1:]]
    last = len(d) - tree.shape_count
    turns = exp(d[6:last].reshape(-1, 3))
    Omega = np.swapaxes(R_parent, 1, 2) @ turns @ R_parent @ state.Omega
    R = exp(d[:3]) @ state.R_camera_root
    return State(R, state.t_camera_root + d[3:6], Omega, state.beta + d[last:])


_STEP = 1e-5  # of the differences, radians and metres
_UNEXPLAINED = 1e-6  # of the gradient, outside the range of JᵀJ: more is no rounding
_OTHERS_OFF = {"joint_prior": 0.0, "joint_limits": 0.0, "joint_flow": 0.0, "shape": 0.0}


def check_residual(
    body: BodyArrays, name: str, ints: Any, floats: Any, *, seed: int = 0
) -> dict[str, float]:
    """Compare the derivatives that a registered residual returns with differences of its cost, at a
    random state.

    A wrong Jacobian makes a fit slow, or stops it away from the minimum, without any error. The
    differences are relative to the largest derivative: with the right Jacobian they are below 1e-5,
    unless the residual has a kink.

    :param ints, floats: rows for `name`, as in `Measurements.tables`.
    :param seed: of the state: the root 3 m in front of the camera, joints rotated by about 50°, the
        shape as varied as the population's.
    :return: the largest difference for the root's six unknowns ("root"), the joints' rotations
        ("joints") and the shape ("shape"); by how much JᵀJ is too small for them: gᵀ (JᵀJ)⁺ g /
        2 cost - 1, with g = Jᵀr ("curvature"), infinite where JᵀJ is missing; and how far, relative
        to their own size, cost, g and JᵀJ beside other residuals and with twice the weight are from
        twice those alone ("sum"): a kernel has to multiply by its weight, and to add to the blocks.
    :raises ShapeError: the rows do not fit the residual or the body.
    :raises InvalidValueError: there is no residual of that name, its kernel does not compile, or
        its cost is 0 or not finite at that state, where derivatives say nothing; its Jᵀr or JᵀJ is
        not finite there; or the seed is not a whole number of at least 0.
    """
    check_type(name, str, "name")
    check_count(seed, "seed", 0)
    tree = make_tree(body)
    state = _random_state(tree, seed)
    points = np.arange(len(tree.v_bar))
    beside = Keypoints3D(points, np.zeros((len(points), 3)))

    def weighted(weight: float, measurements: Measurements) -> tuple[Terms, Array]:
        weights = Weights(tables={name: weight}, **_OTHERS_OFF)
        stage = Options().stage_table([Stage(weights)])[0][0]
        return make_terms(tree, measurements, Priors()), stage

    tables = {name: (ints, floats)}
    terms, stage = weighted(1.0, Measurements(tables=tables))
    at_state = equations(tree, terms, stage, state)
    cost = at_state.cost
    g = at_state.g
    H = at_state.H
    found = np.zeros(len(g))
    if not 0.0 < cost < np.inf:
        raise InvalidValueError(
            f"The cost of {name!r} must be positive and finite to be differentiated, but is "
            f"{cost:g} at the random "
            f"state of seed {seed}; use other rows or another seed."
        )
    if not (np.isfinite(g).all() and np.isfinite(H).all()):
        raise InvalidValueError(
            f"The derivatives Jᵀr and JᵀJ of {name!r} must be finite, but hold NaN or infinity at "
            "the random state of "
            f"seed {seed}."
        )
    for k, change in enumerate(_STEP * np.eye(len(g))):
        ahead = equations(tree, terms, stage, moved(tree, state, change)).cost
        behind = equations(tree, terms, stage, moved(tree, state, -change)).cost
        found[k] = (ahead - behind) / (2.0 * _STEP)
    off = np.abs(g - found) / max(np.abs(found).max(), np.abs(g).max(), 1e-300)
    joints = 6 + 3 * (len(tree.parents) - 1)
    x = np.linalg.pinv(H, rcond=1e-10, hermitian=True) @ g
    # the pseudoinverse drops that part of g
    is_missing = np.linalg.norm(g - H @ x) > _UNEXPLAINED * np.linalg.norm(g)
    explained = np.inf if is_missing else float(g @ x) / (2.0 * cost)
    others = equations(tree, *weighted(0.0, Measurements(keypoints3d=beside)), state)
    seen = Measurements(keypoints3d=beside, tables=tables)
    together = equations(tree, *weighted(2.0, seen), state)
    differences = [
        np.abs(
            getattr(together, kind) - getattr(others, kind) - 2.0 * getattr(at_state, kind)
        ).max()
        / np.abs(getattr(at_state, kind)).max(initial=1e-300)
        for kind in ("cost", "g", "H")
    ]
    return {
        "root": float(off[:6].max()),
        "joints": float(off[6:joints].max(initial=0.0)),
        "shape": float(off[joints:].max(initial=0.0)),
        "curvature": max(0.0, explained - 1.0),
        "sum": float(max(differences)),
    }


def _random_state(tree: Tree, seed: int) -> State:
    rng = np.random.default_rng(seed)
    K = len(tree.parents) - 1
    place = np.array([0.0, 0.0, 3.0]) + 0.2 * rng.standard_normal(3)
    Omega = exp(0.5 * rng.standard_normal((K, 3)))
    return State(exp(rng.standard_normal(3)), place, Omega, rng.standard_normal(tree.shape_count))
