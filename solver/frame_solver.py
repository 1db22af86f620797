# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitting one frame, and frame after frame in the same memory."""

import threading
from collections.abc import Sequence

import numpy as np

from .curvature import make_curvature
from .initialize import initial_state
from .kernel import announce_compilation, kernel
from .linearize import make_blocks, make_pose
from .measurements import Measurements, as_array
from .optimizer import optimize
from .options import Options, Priors, Stage, default_priors
from .recursion import make_workspace
from .report import cost_by_term
from .residuals.external import raise_failure
from .residuals.part import Array
from .residuals.registry import SHAPE_PRIOR
from .rotations import nearest_rotation, orthonormalize
from .state import Fit, State, Status
from .terms import Layout, PackedPriors, fill_terms, pack_priors
from .tree import BodyArrays, Tree, make_tree


def fit(
    body: BodyArrays,
    measurements: Measurements,
    *,
    init: State | None = None,
    priors: Priors | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
) -> Fit:
    """Fit pose and shape to one frame.

    minimize 1/2 sum_i |r_i(T_i, Omega_i, beta)|^2 over T_0, Omega_1..K and beta (section 3 of the paper).

    With `init` (camera frame, metres) the fit starts there, in one stage; without, from a guess by `initial_state`,
    in several. `priors` are `default_priors(body)` unless given: the learned joint prior, joint limits and the
    population's shape. Raises ShapeError for arrays that do not fit the body; never for measured values: see Status.
    """
    return FrameSolver(body, priors, options).fit(measurements, init)


def fit_tree(tree: Tree, measurements: Measurements, init: State | None, priors: Priors, options: Options) -> Fit:
    """`fit` on a tree that has been made already. Calls in a row with the same tree work in the same memory."""
    solver = getattr(_last, "solver", None)
    if solver is None or solver.tree is not tree:
        solver = _last.solver = FrameSolver(tree, priors, options)
    return solver.fit(measurements, init, priors, options)


class FrameSolver:
    """Fits frames of one body, one after another; everything that they share is prepared once.

    Not for several threads at a time. The arrays of `priors` must not be changed while it is in use.
    """

    def __init__(
        self,
        body: BodyArrays | Tree,
        priors: Priors | None = None,
        options: Options = Options(),  # noqa: B008 - frozen
    ) -> None:
        """Check the body and make room. Raises ShapeError."""
        announce_compilation(optimize)
        self.tree = body if isinstance(body, Tree) else make_tree(body)
        self.priors = default_priors(body) if priors is None else priors
        self.options = options
        tree = self.tree
        self._poses = make_pose(tree), make_pose(tree)
        self._blocks = make_blocks(tree), make_blocks(tree)
        self._curvature = make_curvature(tree)
        self._work = make_workspace(tree)
        self._rest = np.tile(np.eye(3), (len(tree.parents) - 1, 1, 1))
        self._layout: Layout | None = None
        self._packed: tuple[Priors, PackedPriors] | None = None
        self._schedules: list[tuple[Options, Sequence[Stage], tuple[Array, Array, Array]]] = []

    def fit(
        self,
        measurements: Measurements,
        init: State | None = None,
        priors: Priors | None = None,
        options: Options | None = None,
    ) -> Fit:
        """Fit one frame, as `fit` does; priors and options are those given at the start unless others are given."""
        priors = self.priors if priors is None else priors
        options = self.options if options is None else options
        tree, work, (pose, other) = self.tree, self._work, self._poses
        packed = self._pack(priors)
        terms, count, self._layout = fill_terms(tree, measurements, packed, self._layout)
        count += len(terms.ints[0])
        table, tolerances, limits = self._schedule(options, cold=init is None)
        if init is None:
            init = initial_state(tree, terms, self._mean(priors), packed.shape_mean[: tree.shape])
        self._enter(init)
        cost, code, iterations, rejected, which = optimize(
            tree, terms, count > 0, table, tolerances, limits, options.triggs, options.damping,
            1.0 / options.root_length, pose, other, self._blocks[0], self._blocks[1],
            self._curvature, work,
        )  # fmt: skip
        raise_failure()
        found, P = self._poses[which], tree.shape
        information = work.C[:P, :P] - table[-1, 0, SHAPE_PRIOR] * packed.shape_information[:P, :P]
        state = State.from_pose(tree, found)
        shares = {}
        if options.report:
            blocks, last = self._blocks[0], table[-1]
            shares = cost_by_term(tree, terms, last, options.triggs, found, blocks, work.scratch)
        return Fit(
            state, Status(code), cost, iterations, found.R.copy(), found.t.copy(), information, count, rejected, shares
        )

    def _pack(self, priors: Priors) -> PackedPriors:
        if self._packed is None or self._packed[0] is not priors:
            self._packed = priors, pack_priors(self.tree, priors)
        return self._packed[1]

    def _schedule(self, options: Options, cold: bool) -> tuple[Array, Array, Array]:
        stages = options.schedule(cold)
        for known, its_stages, table in self._schedules:
            if its_stages is stages and known == options:
                return table
        table = options.stage_table(stages)
        if isinstance(stages, tuple):  # a list may change
            self._schedules = [*self._schedules[-3:], (options, stages, table)]
        return table

    def _mean(self, priors: Priors) -> Array:
        if priors.joint_mean is None:
            return self._rest
        return np.asarray(priors.joint_mean, dtype=np.float64)

    def _enter(self, state: State) -> None:
        """Put `state` into the first pose, with rotations made orthonormal."""
        tree, pose = self.tree, self._poses[0]
        K, P = len(tree.parents) - 1, tree.shape
        R = as_array(state.R_camera_root, (3, 3), "R_camera_root")
        t = as_array(state.t_camera_root, (3,), "t_camera_root")
        Omega = as_array(state.Omega, (K, 3, 3), "Omega")
        State.check(R, Omega)
        if not _enter(R, t, Omega, as_array(state.beta, (P,), "beta"), pose):
            pose.R[0], pose.Omega[1:] = nearest_rotation(R), nearest_rotation(Omega)


_last = threading.local()


@kernel
def _enter(R, t, Omega, beta, pose) -> bool:  # type: ignore[no-untyped-def]
    """Copy a state; return whether its rotations could be made orthonormal in passing."""
    for r in range(3):
        pose.t[0, r] = t[r]
        for c in range(3):
            pose.R[0, r, c] = R[r, c]
    for i in range(Omega.shape[0]):
        for r in range(3):
            for c in range(3):
                pose.Omega[i + 1, r, c] = Omega[i, r, c]
    for a in range(beta.shape[0]):
        pose.beta[a] = beta[a]
    pose.log_focal[0] = 0.0
    return orthonormalize(pose.R[:1]) and orthonormalize(pose.Omega)
