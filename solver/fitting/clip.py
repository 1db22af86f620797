# SPDX-License-Identifier: Apache-2.0
"""One shape, and if asked one focal length, over a clip: O(T (K + N)) for a step of all poses and
the shape.

Given beta (and the focal length) the frames are independent, so each frame's pose is eliminated by
itself and leaves
    (C - N_0ᵀ M_0^-1 N_0) dbeta = -(c - N_0ᵀ M_0^-1 m_0)
These systems add up over the frames; the shape prior enters once. Their solution is substituted
back in every frame. That is the exact Gauss-Newton step of the clip. Causally, the information
matrix summed so far is the prior of the next frame (`carry`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ..arrays import as_array
from ..errors import ShapeError
from ..gauss_newton.linearize import linearize, make_blocks, make_pose
from ..gauss_newton.optimizer import MIN_DAMPING, SeveralFrames, SharedPriors, make_settings
from ..gauss_newton.recursion import (
    Workspace,
    eliminate,
    make_workspace,
    retract,
    solve_globals,
    substitute,
)
from ..gauss_newton.terms import Terms, fill_terms, pack_priors, usable
from ..measurements import Measurements, as_confidence
from ..options import Options, Priors, given_priors
from ..part import Array, Blocks, Pose
from ..points import frames_of
from ..residuals.external import raise_failure
from ..residuals.registry import SHAPE_PRIOR
from ..state import ClipFit, Fit, State, Status, given_states
from ..tree import BodyArrays, Tree, make_tree, with_fixed_shape
from ..validation import check_count, check_switch, check_type, check_weight
from .frame_solver import cost_by_term, fit_at, fit_tree
from .misfit import warn_of_mirrored_clip, warn_of_unlikely_shape


def carry(priors: Priors, fitted: Fit, shape_weight: float) -> Priors:
    """Return the priors of the next frame: the shape at this frame's estimate, with its information
    added.

    The information is that of the measurements once the pose is eliminated, so that the sum over
    frames is that of one shape for all, linearized where each frame was fitted.

    :param fitted: by `fit` with these priors.
    :param shape_weight: `Weights.shape` of the fit, over which the information is kept.
    :raises ShapeError: the shape's information in `priors` does not fit the shape.
    :raises InvalidValueError: `priors` or `fitted` is of another type, or the weight is negative,
        infinite or not a number.
    """
    check_type(priors, Priors, "priors")
    check_type(fitted, Fit, "fitted")
    check_weight(shape_weight, "shape_weight")
    P = len(fitted.state.beta)
    if fitted.status in (Status.NO_MEASUREMENTS, Status.NON_FINITE) or shape_weight == 0.0:
        return priors
    _, information = priors.packed_shape(P)
    total = information + fitted.beta_information / shape_weight
    return replace(
        priors, shape_mean=fitted.state.beta.copy(), shape_information=0.5 * (total + total.T)
    )


def fit_clip(
    body: BodyArrays,
    measurements: Sequence[Measurements] | Measurements,
    *,
    init: Sequence[State] | Literal["multi"] | None = None,
    priors: Priors | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
    focal: bool = False,
    focal_weight: float = 1.0,
    shape_frames: int = 500,
) -> ClipFit:
    """Fit every frame's pose and one shape, and with `focal` one focal length, to a clip.

    First every frame is fitted in order, from the frame before and with the shape's information
    carried along (not if `init` is given; with "multi", as `fit` does where the person appears);
    then all poses and the shape are optimized together.
    A frame without measurements gets the pose of the last frame before it that has some, or of the
    first after it; its status is `NO_MEASUREMENTS`. `focal_weight` is a prior on the squared
    logarithm of the focal scale.
    At most `shape_frames` frames, evenly spaced, decide the shape; the others are then fitted with
    it fixed.

    :param measurements: of each frame; or of the clip, as arrays with an axis for the frames:
        `frames_of`.
    :param init: each frame's state, camera frame, metres.
    :param priors, options: of `fit`; the shape's prior counts once for the clip.
    :return: the frames' fits and the shape they share.
    :raises ShapeError: when there is no frame, or when an array does not fit the body.
    :raises InvalidValueError: a value that no fit can use.
    """
    measurements = frames_of(body, measurements)
    if len(measurements) == 0:
        raise ShapeError("A clip needs at least one frame of measurements, but got none.")
    check_weight(focal_weight, "focal_weight")
    check_count(shape_frames, "shape_frames")
    check_switch(focal, "focal")
    states, cold = given_states(init, len(measurements))
    by_default = priors is None and states is None
    priors = given_priors(body, priors, options)
    tree = make_tree(body)
    if states is None:
        states = fit_in_order(tree, measurements, priors, options, cold=cold)
    clip_tree = make_tree(body, focal)
    packed = pack_priors(clip_tree, priors)
    terms = [fill_terms(clip_tree, m, packed, None)[0] for m in measurements]
    seen = [k for k, its in enumerate(terms) if usable(its)[1]]
    chosen = seen
    if len(seen) > shape_frames:
        chosen = [seen[k] for k in np.linspace(0, len(seen) - 1, shape_frames).round().astype(int)]
    joint = _Joint(
        clip_tree,
        [terms[k] for k in chosen],
        [states[k] for k in chosen],
        priors,
        options,
        focal_weight if focal else None,
    )
    joint.optimize()
    beta = joint.beta[: tree.shape_count].copy()
    scale = float(np.exp(joint.log_focal))
    joint_fits = joint.fits()
    by_frame = dict(zip(chosen, joint_fits, strict=True))
    fixed = with_fixed_shape(tree, beta)
    # in the normalized coordinates of the estimated focal length, squares are less by its square
    rescaled = replace(options, robust_keypoints2d=options.robust_keypoints2d / scale**2)

    def alone(k: int, start: State) -> Fit:
        m = _with_focal(measurements[k], scale)
        start = replace(start, beta=np.zeros(0))
        found = fit_tree(fixed, m, start, without_shape(priors), rescaled)
        found.state.beta = beta.copy()
        return replace(found, beta_information=np.zeros((len(beta),) * 2))

    for k in seen:
        if k not in by_frame:
            by_frame[k] = alone(k, states[k])
    last = by_frame[seen[0]].state if seen else None
    for k, state in enumerate(states):
        if k in by_frame:
            last = by_frame[k].state
        else:
            by_frame[k] = alone(k, state if last is None else last)
    fits = [by_frame[k] for k in range(len(states))]
    if by_default and not warn_of_mirrored_clip(
        measurements, fits, priors, lambda m: fit_tree(tree, m, None, priors, options)
    ):
        warn_of_unlikely_shape([beta], priors)
    shares = joint.cost_by_term(joint_fits) if options.report else {}
    return ClipFit(
        fits,
        beta,
        joint.information(),
        scale,
        joint.status,
        joint.cost,
        joint.iterations,
        joint.rejected,
        shares,
    )


# R_camera_world (3, 3), t_camera_world (3,)
Camera = tuple[Array, Array]
_AT_ORIGIN: Camera = np.eye(3), np.zeros(3)


def fit_in_order(
    tree: Tree,
    measurements: Sequence[Measurements],
    priors: Priors,
    options: Options,
    cameras: Sequence[Camera] | None = None,
    cold: Literal["multi"] | None = None,
) -> list[State]:
    """Fit each frame from the one before, carrying the shape's information; a lost person starts
    afresh.

    Frames without measurements hold the last state that was measured, before the first the first.

    :param cameras: the camera in whose axes each frame's measurements are; without it, all are in
        the states' axes.
    :param cold: `init` of `fit` where no frame before has a state.
    :return: states in the axes of the world.
    :raises InvalidValueError: the weight of the shape in ``options`` is negative, infinite or not a
        number.
    """
    states: list[State] = []
    last: State | None = None
    seen = False
    weight = options.schedule(cold=False)[-1].weights.shape
    for m, (R, t) in zip(measurements, cameras or [_AT_ORIGIN] * len(measurements), strict=True):
        start = None if last is None else _moved(last, R, t)
        fitted = fit_tree(tree, m, cold if start is None else start, priors, options)
        state = _moved(fitted.state, R.T, -R.T @ t)
        if fitted.status is Status.NO_MEASUREMENTS:
            states.append(states[-1] if seen else state)
            last = None
            continue
        if not seen:
            states = [state] * len(states)
            seen = True
        last = state
        priors = carry(priors, fitted, weight)
        states.append(last)
    return states


def _moved(state: State, R: Array, t: Array) -> State:
    """Return the state in other axes, in which a point p is at R p + t."""
    return replace(
        state, R_camera_root=R @ state.R_camera_root, t_camera_root=R @ state.t_camera_root + t
    )


def _with_focal(m: Measurements, scale: float) -> Measurements:
    """Return the measurements with a focal length that is `scale` times that of the intrinsics, and
    the weights that 2D keypoints have with these.

    The residuals' normalized coordinates are over the focal length; weights from `sigma_px` heed
    that already.
    """
    if m.intrinsics is None or scale == 1.0:
        return m
    K = np.array(m.intrinsics, dtype=float)
    K[0, :2] *= scale
    K[1, 1] *= scale
    seen = m.keypoints2d
    if seen is not None and seen.sigma_px is None:
        confidence = as_confidence(seen.confidence, np.size(seen.indices), "2D keypoints")
        seen = replace(seen, confidence=scale**2 * confidence)
    return replace(m, intrinsics=K, keypoints2d=seen)


def without_shape(priors: Priors) -> Priors:
    """Return the priors of a fit whose shape is known."""
    return replace(priors, shape_mean=None, shape_information=None)


@dataclass
class _Active:
    """A frame that takes part in the joint optimization, with its buffers."""

    terms: Terms
    pose: Pose
    trial: Pose
    blocks: Blocks
    work: Workspace
    cost: float = 0.0


class _Joint(SeveralFrames):
    """The poses of several frames and the global columns they share, optimized together."""

    def __init__(
        self,
        tree: Tree,
        terms: Sequence[Terms],
        states: Sequence[State],
        priors: Priors,
        options: Options,
        focal_weight: float | None,
    ) -> None:
        super().__init__()
        self.tree = tree
        self.report = options.report
        self.P = tree.shape_count
        self.shared = SharedPriors(*priors.packed_shape(tree.shape_count), focal_weight)
        self.settings = make_settings(options, options.schedule(cold=False))
        self.stages = self.settings.stages
        self.shape_weights = self.stages[:, 0, SHAPE_PRIOR].copy()
        self.stages[:, 0, SHAPE_PRIOR] = 0.0  # once for the clip, not in every frame
        self.beta = np.zeros(tree.S.shape[2])
        self.log_focal = 0.0
        self.status = Status.NO_MEASUREMENTS
        # the last frame's shape has seen most, when the frames were fitted in order
        first = as_array(states[-1].beta, (self.P,), "beta") if states else self.shared.shape_mean
        self.beta[: self.P] = first
        shared = make_workspace(tree)
        self.frames: list[_Active] = []
        for its, state in zip(terms, states, strict=True):
            work = make_workspace(tree)._replace(A=shared.A, scratch=shared.scratch)
            pose = replace(state, beta=self.beta[: self.P]).pose(tree)
            self.frames.append(_Active(its, pose, make_pose(tree), make_blocks(tree), work))

    def optimize(self) -> None:
        """Optimize through the stages."""
        if self.frames:
            self.status = Status(self.run())

    def _begin(self, s: int) -> float:
        return self._linearize(s, trial=False)

    def _try(self, s: int) -> float:
        return self._linearize(s, trial=True)

    def _conclude(self, s: int, cost: float, accepted: bool) -> None:
        if not accepted:
            # one set of blocks a frame: memory, not time, is what a clip lacks
            self._linearize(s, trial=False)
            return
        for frame in self.frames:
            frame.pose, frame.trial = frame.trial, frame.pose
        self.beta = self.frames[0].pose.beta.copy()
        self.log_focal = float(self.frames[0].pose.log_focal[0])

    def _linearize(self, s: int, trial: bool) -> float:
        """Linearize every frame at its pose or its trial pose and return the clip's cost."""
        total: float = 0.0
        for f in self.frames:
            pose = f.trial if trial else f.pose
            f.cost = linearize(
                self.tree,
                f.terms,
                self.stages[s],
                pose,
                f.blocks,
                f.work.scratch,
            )
            total += f.cost
        raise_failure()
        at = self.frames[0].trial if trial else self.frames[0].pose
        shared = self.shared.costs(self.shape_weights[s], at.beta, float(at.log_focal[0]))
        return total + sum(shared.values())

    def _reduced(self, s: int, damping: float) -> tuple[Array, Array, float]:
        """Eliminate every frame's pose; return the summed system of the global columns and the sum
        of |q~|^2.
        """
        squares = 0.0
        C = np.zeros_like(self.frames[0].work.C)
        c = np.zeros_like(self.beta)
        for f in self.frames:
            squares += eliminate(
                self.tree, f.pose, f.blocks, damping, self.settings.root_scale, f.work
            )
            C += f.work.C
            c += f.work.c
        self.shared.add(self.shape_weights[s], self.beta, self.log_focal, C, c)
        return C, c, squares

    def _step(self, s: int, damping: float) -> float:
        """Write every frame's trial pose and return the predicted decrease."""
        squares: float
        C, c, squares = self._reduced(s, damping)
        dbeta = np.zeros_like(self.beta)
        squares += solve_globals(self.tree, C, c, dbeta)
        for f in self.frames:
            f.work.dbeta[:] = dbeta
            squares += substitute(self.tree, f.pose, damping, self.settings.root_scale, f.work)
            retract(self.tree, f.pose, f.work, f.trial)
        return 0.5 * squares

    def fits(self) -> list[Fit]:
        """Return the frames' results."""
        out = []
        last = self.stages[-1]
        # of one kind of residual at a time: the frames' own blocks are those of `information`
        spare = make_blocks(self.tree)
        for f in self.frames:
            f.cost = linearize(self.tree, f.terms, last, f.pose, f.blocks, f.work.scratch)
            eliminate(self.tree, f.pose, f.blocks, MIN_DAMPING, self.settings.root_scale, f.work)
            shares = {}
            if self.report:
                shares = cost_by_term(self.tree, f.terms, last, f.pose, spare, f.work.scratch)
            seen, measurements = usable(f.terms)
            out.append(
                fit_at(
                    self.tree,
                    f.pose,
                    beta_information=f.work.C[: self.P, : self.P].copy(),
                    seen=seen,
                    measurements=measurements,
                    status=self.status,
                    cost=float(f.cost),
                    iterations=self.iterations,
                    rejected=self.rejected,
                    cost_by_term=shares,
                )
            )
        raise_failure()
        return out

    def cost_by_term(self, fits: Sequence[Fit]) -> dict[str, float]:
        """Return what the clip's cost is made of: the frames' sums, the shape prior once, the focal
        length's prior.

        :param fits: of `fits`, with a report.
        """
        total: dict[str, float] = {}
        for fitted in fits:
            for name, cost in fitted.cost_by_term.items():
                total[name] = total.get(name, 0.0) + cost
        return total | self.shared.costs(self.shape_weights[-1], self.beta, self.log_focal)

    def information(self) -> Array:
        """Return the information matrix of beta (P, P), prior included, poses and focal length
        eliminated.
        """
        P = self.P
        if not self.frames:
            prior: Array = self.shape_weights[-1] * self.shared.shape_information
            return prior
        C, _, _ = self._reduced(len(self.stages) - 1, MIN_DAMPING)
        return shape_information(C[: self.tree.global_count, : self.tree.global_count], P)


def shape_information(information: Array, P: int) -> Array:
    """Return the information (P, P) of the shape from that (G, G) of the global columns: the others
    are eliminated.
    """
    out = information[:P, :P].copy()
    if len(information) > P and information[P, P] > 0.0:
        out -= np.outer(information[:P, P], information[P, :P]) / information[P, P]
    return out
