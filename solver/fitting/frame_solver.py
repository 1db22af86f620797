# SPDX-License-Identifier: Apache-2.0
"""Fitting one frame, frame after frame in the same memory, and many frames on all cores."""

from __future__ import annotations

import os
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Literal

import numpy as np

from ..gauss_newton.curvature import make_curvature
from ..gauss_newton.linearize import linearize, make_blocks, make_pose
from ..gauss_newton.optimizer import Memory, Settings, make_settings, optimize
from ..gauss_newton.recursion import make_workspace
from ..gauss_newton.terms import (
    HAS_3D,
    HAS_DIRECTION,
    Layout,
    PackedPriors,
    Terms,
    fill_terms,
    pack_priors,
    usable,
)
from ..kernel import announce_compilation
from ..measurements import SIGMA_3D, Measurements
from ..options import Options, Priors, Stage, default_priors, given_priors
from ..part import Array, Blocks, Pose
from ..points import frames_of, numbered
from ..residuals.external import external_residuals, raise_failure
from ..residuals.registry import KEYPOINT3D, NAMES, SHAPE_PRIOR, column_of
from ..state import MULTI, Fit, State, Status, given_states
from ..tree import BodyArrays, Tree, make_tree
from ..validation import check_count, check_type, warn_of_start
from .initialize import initial_states
from .misfit import (
    COSTLY_IN_IMAGE,
    warn_of_mirrored_clip,
    warn_of_unlikely_shape,
    warn_of_wrong_pixels,
    warn_of_wrong_points,
)

_CHUNK = 16  # frames handed to a thread at a time: a thread changes hands in tens of microseconds
# Cost for each measurement above which a cold start from exact 3D keypoints is repeated. Of 2,000
# random people with deviations of 2 mm, all but six that have a twisted limb cost more; of all,
# a tenth without noise and 61 % with it.
_COSTLY = 1.3
_HALF_TURN = np.diag([-1.0, 1.0, -1.0])
# Deviations of 3D keypoints, metres, in the early stages of the repeated start.
_LOOSE_M = (0.03, 0.015)


def fit(
    body: BodyArrays,
    measurements: Measurements,
    *,
    init: State | Literal["multi"] | None = None,
    priors: Priors | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
) -> Fit:
    """Fit pose and shape to one frame.

    minimize 1/2 sum_i |r_i(T_i, Omega_i, beta)|^2 over T_0, Omega_1..K and beta (section 3 of the
    paper).

    :param body: a `Body`, or any tree with the arrays of `BodyArrays`.
    :param measurements: of one frame, in camera axes: x right, y down, z forward.
    :param init: where to start, camera frame, metres, in one stage; without it, as
        `initial_states` finds, in several. Where 2D keypoints alone are given, that is from 24
        headings, of which the fit of the lowest cost is kept, and where that is large, once more
        from what the flipped image shows; "multi" does so always. Where 3D keypoints of millimetres
        leave a large cost, the default stages run once more, with less exact points at first.
    :param priors: `default_priors(body)` unless given: the learned joint prior, joint limits, the
        population's shape.
    :param options: weights, stages, robust kernels and damping.
    :return: the state and how it was reached; whatever values were measured, see `Status`.
    :raises ShapeError: when an array does not fit the body.
    :raises InvalidValueError: a value that no fit can use.
    """
    solver = FrameSolver(body, priors, options)
    found = solver.fit(measurements, init)
    seen = numbered(body, measurements)
    is_told = False
    if isinstance(init, State):
        warn_of_start(np.asarray(init.t_camera_root), seen.keypoints2d is not None)
    elif priors is None:
        is_told = warn_of_mirrored_clip([seen], [found], solver.priors, solver.fit)
    if not is_told:
        is_told = warn_of_wrong_points(solver.tree, seen, found)
        is_told |= warn_of_wrong_pixels(solver.tree, seen, found)
    if not is_told and priors is None:
        warn_of_unlikely_shape([found.state.beta], solver.priors)
    return found


def fit_batch(
    body: BodyArrays,
    measurements: Sequence[Measurements] | Measurements,
    *,
    init: Sequence[State | None] | Literal["multi"] | None = None,
    priors: Priors | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
    threads: int = 0,
) -> list[Fit]:
    """Fit frames that have nothing to do with each other, in order of `measurements`, on all cores:
    kernels release the GIL, so that plain threads do.

    Every frame comes out as `fit` gives it, bit by bit, whatever the number of threads.

    :param measurements: of each frame; or of all, as arrays with an axis for the frames:
        `frames_of`.
    :param init: a state for each frame, None where there is none; or "multi" for all, as of `fit`.
    :param priors, options: of `fit`, for all frames.
    :param threads: how many; 0 is one for each core.
    :raises ShapeError: an array does not fit the body, whichever frame it belongs to, or `init` has
        another length.
    :raises InvalidValueError: a value that no fit can use, in whichever frame.
    """
    measurements = frames_of(body, measurements)
    states, cold = given_states(init, len(measurements), (State, type(None)))
    starts = [cold] * len(measurements) if states is None else states
    tree = make_tree(body)
    by_default = priors is None and states is None
    priors = default_priors(body) if priors is None else priors

    def some(first: int) -> list[Fit]:
        frames = range(first, min(first + _CHUNK, len(measurements)))
        return [fit_tree(tree, measurements[k], starts[k], priors, options) for k in frames]

    check_count(threads, "threads", 0)
    with ThreadPoolExecutor(threads or os.cpu_count(), thread_name_prefix="scope-fit") as pool:
        chunks = pool.map(some, range(0, len(measurements), _CHUNK))
        fits = [fitted for chunk in chunks for fitted in chunk]
    if by_default and not warn_of_mirrored_clip(
        measurements, fits, priors, lambda m: fit_tree(tree, m, None, priors, options)
    ):
        warn_of_unlikely_shape([fitted.state.beta for fitted in fits], priors)
    return fits


def fit_tree(
    tree: Tree,
    measurements: Measurements,
    init: State | Literal["multi"] | None,
    priors: Priors,
    options: Options,
) -> Fit:
    """`fit` on a tree that has been made already. Calls in a row with the same tree work in the
    same memory.

    :param measurements: with points as numbers. Others as of `fit`; there is no warning of a fit
        that is bad.
    :raises ShapeError: when an array does not fit the tree.
    :raises InvalidValueError: a value that no fit can use.
    """
    solver = getattr(_last, "solver", None)
    if solver is None or solver.tree is not tree:
        solver = _last.solver = FrameSolver(tree, priors, options)
    return solver.fit(measurements, init, priors, options)


class FrameSolver:
    """Fits frames of one body, one after another; everything that they share is prepared once.

    Not for several threads at a time. The arrays of `priors` must not be changed while it is in
    use.
    """

    def __init__(
        self,
        body: BodyArrays | Tree,
        priors: Priors | None = None,
        options: Options = Options(),  # noqa: B008 - frozen
    ) -> None:
        """Check the body and allocate the working memory.

        :param priors, options: of `fit`, for all frames that are given no others.
        :raises ShapeError: when an array does not fit the others.
        :raises InvalidValueError: `priors` or `options` is of another type.
        """
        announce_compilation(optimize)
        self.body = body
        self.tree = body if isinstance(body, Tree) else make_tree(body)
        self.priors = given_priors(body, priors, options)
        self.options = options
        tree = self.tree
        poses = (make_pose(tree), make_pose(tree))
        blocks = (make_blocks(tree), make_blocks(tree))
        self._memory = Memory(poses, blocks, make_curvature(tree), make_workspace(tree))
        self._rest = np.tile(np.eye(3), (len(tree.parents) - 1, 1, 1))
        self._layout: Layout | None = None
        self._packed: tuple[Priors, PackedPriors] | None = None
        self._settings: list[tuple[Options, Sequence[Stage], Settings]] = []

    def fit(
        self,
        measurements: Measurements,
        init: State | Literal["multi"] | None = None,
        priors: Priors | None = None,
        options: Options | None = None,
    ) -> Fit:
        """Fit one frame, as `fit` does, with the priors and options of the constructor unless
        others are given.

        :raises ShapeError: when an array does not fit the body.
        :raises InvalidValueError: a value that no fit can use.
        """
        priors = self.priors if priors is None else priors
        options = self.options if options is None else options
        check_type(measurements, Measurements, "measurements")
        multi = isinstance(init, str) and init == MULTI
        if not multi:
            check_type(init, (State, type(None)), f"init, unless it is {MULTI!r},")
        check_type(priors, Priors, "priors")
        check_type(options, Options, "options")
        tree = self.tree
        packed = self._pack(priors)
        measurements = numbered(self.body, measurements)
        terms, slots, self._layout = fill_terms(tree, measurements, packed, self._layout)
        seen, count = usable(terms, slots)
        settings = self._settings_of(options, cold=init is None or multi)

        def run(start: State, settings: Settings, terms: Terms = terms) -> Fit:
            return self._run(terms, (seen, count), start, settings, options.report)

        if isinstance(init, State):
            return run(init, settings)
        mean = self._mean(priors)
        shape = packed.shape_mean[: tree.shape_count]
        starts = initial_states(tree, terms, mean, shape, several=multi and count > 0)

        def cheapest(starts: Sequence[State], terms: Terms) -> Fit:
            best = run(starts[0], settings, terms)
            for start in starts[1:]:
                best = _cheaper(best, run(start, settings, terms))
            return best

        best = cheapest(starts, terms)
        if options.stages is None and best.cost > _COSTLY * count:
            loose = _with_loose_points(settings, terms)
            if loose is not None:
                best = _cheaper(best, run(starts[0], loose))
        is_image_alone = not (terms.flags & (HAS_3D | HAS_DIRECTION)).any()
        if is_image_alone and len(starts) > 1 and best.cost > COSTLY_IN_IMAGE * count:
            # The body that the flipped image shows, turned round, is seen almost as the one that is
            # searched, from where no heading may lead.
            flipped = terms._replace(image=terms.image * [-1.0, 1.0, 1.0])
            turned = cheapest(initial_states(tree, flipped, mean, shape), flipped).state
            turned.R_camera_root = _HALF_TURN @ turned.R_camera_root
            turned.t_camera_root = turned.t_camera_root * [-1.0, 1.0, 1.0]
            best = _cheaper(best, run(turned, self._settings_of(options, cold=False)))
        return best

    def _run(
        self,
        terms: Terms,
        counts: tuple[int, int],
        start: State,
        settings: Settings,
        report: bool,
    ) -> Fit:
        """Return the fit that the stages lead to from a state.

        :param counts: `Fit.seen` and `Fit.measurements`.
        """
        tree = self.tree
        memory = self._memory
        work = memory.work
        P = tree.shape_count
        last = settings.stages[-1]
        start.write_to(tree, memory.poses[0])
        seen, count = counts
        cost, code, iterations, rejected, which = optimize(tree, terms, count > 0, settings, memory)
        raise_failure()
        found = memory.poses[which]
        information = work.C[:P, :P] - last[0, SHAPE_PRIOR] * terms.shape_information[:P, :P]
        shares = {}
        if report:
            shares = cost_by_term(tree, terms, last, found, memory.blocks[0], work.scratch)
        return fit_at(
            tree,
            found,
            beta_information=information,
            seen=seen,
            measurements=count,
            status=Status(code),
            cost=cost,
            iterations=iterations,
            rejected=rejected,
            cost_by_term=shares,
        )

    def _pack(self, priors: Priors) -> PackedPriors:
        if self._packed is None or self._packed[0] is not priors:
            self._packed = priors, pack_priors(self.tree, priors)
        return self._packed[1]

    def _settings_of(self, options: Options, cold: bool) -> Settings:
        stages = options.schedule(cold)
        for known, its_stages, settings in self._settings:
            if its_stages is stages and known == options:
                return settings
        settings = make_settings(options, stages)
        if isinstance(stages, tuple):  # a list may change
            self._settings = [*self._settings[-3:], (options, stages, settings)]
        return settings

    def _mean(self, priors: Priors) -> Array:
        if priors.joint_mean is None:
            return self._rest
        mean = np.asarray(priors.joint_mean, dtype=np.float64)
        if priors.joint_weights is None:
            return mean
        # a mean without weight may be anything, which no fit can start from
        weigh = np.asarray(priors.joint_weights, dtype=np.float64) > 0.0
        return np.where(weigh[:, None, None], mean, self._rest)


_last = threading.local()


def fit_at(tree: Tree, pose: Pose, **how: Any) -> Fit:
    """Return the result of a fit that ended at a pose; `how` has the other fields of `Fit`."""
    return Fit(
        state=State.from_pose(tree, pose),
        R_camera_part=pose.R.copy(),
        t_camera_part=pose.t.copy(),
        **how,
    )


def _cheaper(best: Fit, other: Fit) -> Fit:
    if other.cost < best.cost or not np.isfinite(best.cost):
        return other
    return best


def _with_loose_points(settings: Settings, terms: Terms) -> Settings | None:
    """Return the settings of a cold start whose early stages take 3D keypoints for less exact;
    None where the points are no more exact than the default.

    With the weights of exact points, a limb that is twisted at first cannot turn back.
    """
    is_3d = terms.flags & HAS_3D > 0
    if not is_3d.any():
        return None
    weight = settings.stages[-1, 0, KEYPOINT3D] * terms.point[is_3d, 3].mean()
    if weight <= SIGMA_3D**-2:
        return None
    stages = settings.stages.copy()
    for stage, sigma_m in zip(stages[:-1], _LOOSE_M, strict=True):
        stage[0, KEYPOINT3D] /= weight * sigma_m**2
    return settings._replace(stages=stages)


def cost_by_term(
    tree: Tree,
    terms: Terms,
    stage: Array,
    pose: Pose,
    blocks: Blocks,
    scratch: Array,
) -> dict[str, float]:
    """Return the cost of each kind of residual at `pose`; they add up to what `linearize` returns
    there.

    Every residual's cost is linear in its weight, so the share of one kind is the cost with all
    other weights at zero. Kinds whose weight is zero are left out.

    :param stage: (2, C) a row of weights and a row of 1/sigma, in the registry's order.
    :param scratch: (6, W) of `make_scratch`. :param blocks: overwritten. Others as of
        `linearize`.
    """
    found = {}
    measured = terms.external.calls[:, 4]  # columns of external residuals that have rows
    external = [name for name in external_residuals() if column_of(name) in measured]
    for name in (*NAMES, *external):
        column = column_of(name)
        if stage[0, column] > 0.0:
            alone = stage.copy()
            alone[0] = np.where(np.arange(len(stage[0])) == column, stage[0], 0.0)
            found[name] = float(linearize(tree, terms, alone, pose, blocks, scratch))
    raise_failure()
    return found
