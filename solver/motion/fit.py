# SPDX-License-Identifier: Apache-2.0
"""`fit_motion`: a whole clip as one problem, or as windows that overlap."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import as_array
from ..body import numbers_of
from ..errors import InvalidValueError, ShapeError
from ..fitting.clip import shape_information, without_shape
from ..fitting.frame_solver import fit_tree
from ..fitting.misfit import some_of, warn_of_mirroring, warn_of_unlikely_shape
from ..gauss_newton.optimizer import SharedPriors, make_settings, optimize
from ..gauss_newton.terms import pack_priors
from ..kernel import announce_compilation
from ..measurements import Measurements
from ..options import Options, Priors, given_priors
from ..part import Array, Pose
from ..points import has_names, with_numbers
from ..residuals.registry import column_of
from ..rotations import nearest_rotation
from ..state import State, Status, given_states
from ..tree import BodyArrays, Tree, make_tree, with_fixed_shape
from ..validation import (
    as_finite,
    as_number,
    check_switch,
    check_type,
    check_weight,
    warn_of_frame_numbers,
)
from .covariance import joint_covariances
from .initial import first_view, initial_states, warn_of_cameras
from .levenberg_marquardt import Optimizer
from .prior import MotionPrior, StandingPoints
from .problem import ClipProblem, MotionTerms, linearize_half
from .system import make_poses
from .views import View, pack_frames, view_frames_of

_FRAMES_FOR_TWO_THREADS = 16


@dataclass
class MotionFit:
    """Result of a clip of T frames, in the axes of the world: the camera's, where no view says
    otherwise.

    states (T); R_world_part (T, K+1, 3, 3) and t_world_part (T, K+1, 3), the joints, metres.
    beta (P,); beta_information (P, P): shape prior included; zeros for a shape that was given.
    focal_scale: estimated focal length over that of the intrinsics; 1 if it was not estimated.
    measurements (T,): of each frame, over its views, what `Fit.measurements` counts. status,
    iterations, rejected: as of `Fit`. cost: with windows, their sum: frames in two of them count
    twice; cost_by_term: what couples the frames, and the shared priors. joint_covariance and
    covariance_from_root (T, K+1, 3, 3): of the joints' positions, and of these relative to the
    root, metres^2; with `covariance` only. Millions and more where nothing fixes a joint's pose or
    the shape; NaN where the cost is not finite.
    """

    states: list[State] = field(repr=False)
    R_world_part: Array = field(repr=False)
    t_world_part: Array = field(repr=False)
    beta: Array = field(repr=False)
    beta_information: Array = field(repr=False)
    focal_scale: float
    measurements: Array = field(repr=False)
    status: Status
    cost: float
    iterations: int
    rejected: int = field(repr=False)
    joint_covariance: Array | None = field(default=None, repr=False)
    covariance_from_root: Array | None = field(default=None, repr=False)
    cost_by_term: dict[str, float] = field(default_factory=dict)


def fit_motion(
    body: BodyArrays,
    frames: Sequence[Measurements | Sequence[View]] | Measurements | Sequence[View],
    times: ArrayLike,
    *,
    init: Sequence[State] | Literal["multi"] | None = None,
    priors: Priors | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
    motion: MotionPrior = MotionPrior(),  # noqa: B008 - frozen
    stands: StandingPoints | None = None,
    shape: ArrayLike | None = None,
    focal: bool = False,
    focal_weight: float = 1.0,
    covariance: bool = False,
    window: float = 10.0,
    overlap: float = 2.0,
) -> MotionFit:
    """Fit all poses of a clip and one shape at once.

    minimize, over the poses of all frames, beta and with `focal` one focal length, the sum of every
    frame's terms, as `fit` has them, and of 1/2 integral of w rho(|acceleration|^2) dt over joints
    and root, and of w p |v|^2 dt over standing points. Frames before and after thus help where one
    has little to say, and a frame without measurements is filled in.

    :param frames: of each frame its measurements, or one `View` for each camera that saw something.
        Or arrays with an axis for the frames, as of `frames_of`: the measurements of the clip, or a
        list of one `View` for each camera, which stands still.
    :param times: (T,) seconds, increasing; they need not be evenly spaced. Whole numbers are
        probably frame numbers, and give a `UnitsWarning`.
    :param init: each frame's state in the world's axes; without it, the frames are first fitted in
        order, with "multi" as `fit` does where the person appears, several cameras by points
        triangulated from their 2D keypoints, or by one of them where their rays are too parallel.
    :param priors: `default_priors(body)` unless given.
    :param options: the stages are those of a fit that starts from a state; `report` has no effect.
    :param motion: weights of acceleration and of standing points; how long a pose is remembered.
    :param stands: points that may stand still, with the probability that they do.
    :param shape: (P,) where it is known; it is then kept.
    :param focal: whether to estimate one focal length for all cameras, as a scale of that of their
        intrinsics; `focal_weight` is a prior on the scale's squared logarithm.
    :param covariance: whether to return the covariance of every joint's position; it is that of the
        weights, and conditional on the other windows' frames and, with several windows, on the
        shape.
    :param window, overlap: seconds. A longer clip is optimized in windows that overlap, each kept
        up to the middle of its overlaps, with the shape that all of them together determine: memory
        does not grow with the clip.
    :return: the poses and how they were reached.
    :raises ShapeError: there is no frame, or an array does not fit the body or the clip.
    :raises InvalidValueError: a value that no fit can use.
    """
    views = view_frames_of(body, frames)
    clock = _checked_times(times, len(views))
    states, cold = given_states(init, len(views))
    _check_windows(window, overlap)
    check_type(motion, MotionPrior, "motion")
    # weights of their own are given by those who know how far apart their frames are
    if _weighs_by_default(motion):
        warn_of_frame_numbers(clock)
    check_type(stands, (StandingPoints, type(None)), "stands")
    check_weight(focal_weight, "focal_weight")
    check_switch(focal, "focal")
    check_switch(covariance, "covariance")
    by_default = priors is None and states is None
    priors = given_priors(body, priors, options)
    announce_compilation(linearize_half, optimize)
    tree = make_tree(body)
    has_wrong_cameras = warn_of_cameras(views, len(tree.point_part))
    if stands is not None and has_names(stands.indices):
        stands = replace(
            stands,
            indices=with_numbers(numbers_of(body), stands.indices, "Indices of standing points"),
        )
    shape = _checked_shape(shape, tree, focal)
    if states is None:
        states = _first_states(tree, views, shape, priors, options, cold)
    many = len(views) >= _FRAMES_FOR_TWO_THREADS and (os.cpu_count() or 1) > 1
    with ThreadPoolExecutor(2) if many else nullcontext() as pool:
        terms = MotionTerms.make(
            tree, clock, motion, StandingPoints() if stands is None else stands
        )
        share = motion.pose_share(clock)
        clip = _Clip(
            tree, views, terms, states, priors, options, share, focal_weight, covariance, pool
        )
        found = clip.solve(make_tree(body, focal), shape, overlapping(clock, window, overlap))
    if by_default and not has_wrong_cameras:
        is_told = _warn_of_mirrored_motion(tree, views, found, priors, options)
        if not is_told and shape is None:
            warn_of_unlikely_shape([found.beta], priors)
    return found


def _warn_of_mirrored_motion(
    tree: Tree,
    views: Sequence[Sequence[View]],
    found: MotionFit,
    priors: Priors,
    options: Options,
) -> bool:
    """Warn as `warn_of_mirroring` does, of some frames of a clip; return whether there was
    something to tell.
    """
    chosen = some_of(views)
    seen = [first_view(views[k], len(tree.point_part)) for k in chosen]
    return warn_of_mirroring(
        [view.measurements for view in seen],
        [
            np.asarray(view.R_camera_world) @ found.states[k].R_camera_root
            for k, view in zip(chosen, seen, strict=True)
        ],
        found.cost,
        found.measurements.sum(),
        priors,
        lambda m: fit_tree(tree, m, None, priors, options),
    )


def _weighs_by_default(motion: MotionPrior) -> bool:
    """Return whether the weights of the root's acceleration are the default ones, which count in
    seconds.
    """
    default = MotionPrior.root_rotation, MotionPrior.root_position
    return (motion.root_rotation, motion.root_position) == default


def _check_windows(window: float, overlap: float) -> None:
    if not as_number(window, "window") > 0.0:
        raise InvalidValueError(
            f"window must be a positive number of seconds, or infinite for one, but is {window}."
        )
    if not 0.0 <= as_number(overlap, "overlap") < window:
        raise InvalidValueError(
            f"The overlap of windows must lie in 0..{window} s, but is {overlap} s."
        )


def _checked_times(times: ArrayLike, frames: int) -> Array:
    if frames == 0:
        raise ShapeError("A motion needs at least one frame of measurements, but got none.")
    clock = as_array(times, (frames,), "times")
    if not np.isfinite(clock).all() or (np.diff(clock) <= 0.0).any():
        raise InvalidValueError(
            "The times of a motion's frames must be finite and increase from frame to frame."
        )
    return clock


def _checked_shape(shape: ArrayLike | None, tree: Tree, focal: bool) -> Array | None:
    if shape is None:
        return None
    if focal:
        raise InvalidValueError(
            "The focal length can only be estimated together with the shape; leave `shape` out."
        )
    return as_finite(shape, (tree.shape_count,), "shape")


def _first_states(
    tree: Tree,
    frames: Sequence[Sequence[View]],
    shape: Array | None,
    priors: Priors,
    options: Options,
    cold: Literal["multi"] | None,
) -> Sequence[State]:
    """Return where a clip starts that was given no states."""
    if shape is None:
        return initial_states(tree, frames, priors, options, cold)
    states = initial_states(
        with_fixed_shape(tree, shape), frames, without_shape(priors), options, cold
    )
    return [replace(state, beta=shape) for state in states]


@dataclass
class _Clip:
    """A clip on its way to its motion."""

    tree: Tree
    frames: Sequence[Sequence[View]]
    motion: MotionTerms
    init: Sequence[State]
    priors: Priors
    options: Options
    pose_share: float  # of the joints' priors, in each frame
    focal_weight: float
    covariance: bool
    pool: ThreadPoolExecutor | None

    def __post_init__(self) -> None:
        """Take over the states."""
        T = len(self.frames)
        K = len(self.tree.parents) - 1
        P = self.tree.shape_count
        self.R = np.empty((T, K + 1, 3, 3))
        self.t = np.empty((T, K + 1, 3))
        self.Omega = np.empty((T, K, 3, 3))
        for f, state in enumerate(self.init):
            self.R[f, 0], self.t[f, 0], self.Omega[f], beta = state.arrays(self.tree)
        self.R[:, 0] = nearest_rotation(self.R[:, 0])
        self.Omega = nearest_rotation(self.Omega)
        self.beta = beta.copy()
        self.log_focal = 0.0
        self.information = np.zeros((P, P))
        self.covariances = np.empty((2, T, K + 1, 3, 3)) if self.covariance else None
        self.counts = np.zeros(T, np.int64)
        self.status = Status.NO_MEASUREMENTS
        self.cost = 0.0
        self.iterations = 0
        self.rejected = 0
        self.costs: dict[str, float] = {}

    def solve(self, free: Tree, shape: Array | None, windows: list[FitWindow]) -> MotionFit:
        """Optimize the clip and return the result.

        `free` has the global columns that are unknown unless the shape is given.
        """
        if shape is None and len(windows) == 1:
            self._keep(free, self._optimize(free, windows[0]), windows[0])
        else:
            if shape is None:
                self._find_shared(free, [FitWindow(w.kept, w.kept) for w in windows])
            else:
                self.beta = shape.copy()
            fixed = with_fixed_shape(self.tree, self.beta)
            for window in windows:
                self._keep(fixed, self._optimize(fixed, window), window)
        return self._result()

    def _optimize(self, tree: Tree, window: FitWindow) -> Optimizer:
        """Optimize the frames of a window with the global columns of `tree`."""
        P = tree.shape_count
        priors = self.priors if P else without_shape(self.priors)
        frames = self.frames[window.frames]
        views, self.counts[window.frames] = pack_frames(tree, frames, pack_priors(tree, priors))
        poses = make_poses(tree, len(frames))
        poses.R[:, 0] = self.R[window.frames, 0]
        poses.t[:, 0] = self.t[window.frames, 0]
        poses.Omega[:, 1:] = self.Omega[window.frames]
        poses.beta[:P] = self.beta[:P]
        poses.log_focal[:] = self.log_focal
        focal_weight = self.focal_weight if tree.global_count > P else None
        shared = SharedPriors(*priors.packed_shape(P), focal_weight)
        settings = make_settings(self.options, self.options.schedule(cold=False))
        for name in ("joint_prior", "joint_flow"):
            settings.stages[:, 0, column_of(name)] *= self.pose_share
        motion = self.motion.part(window.frames)
        problem = ClipProblem(tree, views, motion, shared, settings, self.pool)
        optimizer = Optimizer(problem, poses, self.pool)
        if self.counts[window.frames].any():
            status = Status(optimizer.run())
            # the worst of the windows'
            if (
                self.status in (Status.NO_MEASUREMENTS, Status.CONVERGED)
                or status is Status.NON_FINITE
            ):
                self.status = status
        else:
            optimizer.cost = problem.linearize(-1, optimizer.poses, optimizer.system)
        self.iterations += optimizer.iterations
        self.rejected += optimizer.rejected
        return optimizer

    def _find_shared(self, tree: Tree, parts: list[FitWindow]) -> None:
        """Set the shape, and the focal length, to what parts of the clip say together; keep the
        parts' poses.
        """
        estimates = []
        informations = []
        P = tree.shape_count
        G = tree.global_count
        for part in parts:
            optimizer = self._optimize(tree, part)
            self._keep_poses(optimizer.poses, part)
            if not np.isfinite(optimizer.cost):
                continue  # it says nothing
            estimates.append(np.append(optimizer.poses.beta[:P], optimizer.poses.log_focal)[:G])
            informations.append(optimizer.information())
        prior = np.zeros((G, G))
        mean = np.zeros(G)
        mean[:P], information = self.priors.packed_shape(P)
        prior[:P, :P] = optimizer.problem.shape_weights[-1] * information
        if G > P:
            prior[P, P] = self.focal_weight
        self.information = sum(informations) - (len(informations) - 1) * prior
        shared = combined(estimates, informations, mean, prior)
        self.beta = shared[:P]
        self.log_focal = float(shared[P]) if G > P else 0.0
        self.information = shape_information(self.information, P)

    def _keep_poses(self, poses: Pose, window: FitWindow) -> None:
        inner = window.inner
        self.R[window.kept] = poses.R[inner]
        self.t[window.kept] = poses.t[inner]
        self.Omega[window.kept] = poses.Omega[inner, 1:]

    def _keep(self, tree: Tree, optimizer: Optimizer, window: FitWindow) -> None:
        """Take over what a window is kept for."""
        poses = optimizer.poses
        self._keep_poses(poses, window)
        self.cost += optimizer.cost
        for name, cost in optimizer.costs.items():
            self.costs[name] = self.costs.get(name, 0.0) + cost
        if tree.shape_count:
            self.beta = poses.beta[: tree.shape_count].copy()
            self.log_focal = float(poses.log_focal[0])
            self.information = shape_information(optimizer.information(), tree.shape_count)
        if self.covariances is None:
            return
        inner = window.inner
        if np.isfinite(optimizer.cost):
            root_scale = optimizer.problem.settings.root_scale
            found = joint_covariances(
                tree, optimizer.system, poses, root_scale, optimizer.factor, self.pool
            )
            self.covariances[:, window.kept] = found.joints[inner], found.from_root[inner]
        else:
            self.covariances[:, window.kept] = np.nan

    def _result(self) -> MotionFit:
        states = [
            State(self.R[f, 0], self.t[f, 0], self.Omega[f], self.beta)
            for f in range(len(self.frames))
        ]
        joints, from_root = (None, None) if self.covariances is None else self.covariances
        return MotionFit(
            states,
            self.R,
            self.t,
            self.beta,
            self.information,
            float(np.exp(self.log_focal)),
            self.counts,
            self.status,
            float(self.cost),
            self.iterations,
            self.rejected,
            joints,
            from_root,
            self.costs,
        )


class FitWindow(NamedTuple):
    """Consecutive frames that are optimized together, and those of them whose result is kept."""

    frames: slice
    kept: slice

    @property
    def inner(self) -> slice:
        """The frames that are kept, counted from the window's first one."""
        first = self.frames.start
        return slice(self.kept.start - first, self.kept.stop - first)


def overlapping(times: Array, length: float, overlap: float) -> list[FitWindow]:
    """Return windows of `length` seconds that overlap, each kept up to the middle of its overlaps;
    one if that does.

    :param times: (T,) seconds, increasing.
    """
    T = len(times)
    span = float(times[-1] - times[0])
    if span <= length:
        return [FitWindow(slice(0, T), slice(0, T))]
    count = int(np.ceil((span - overlap) / (length - overlap)))
    starts = times[0] + np.arange(count) * (span - length) / (count - 1)
    first = np.searchsorted(times, starts)
    last = np.searchsorted(times, starts + length, side="right")
    last[-1] = T
    # without overlap, rounding may leave a frame between two windows
    first[1:] = np.minimum(first[1:], last[:-1])
    middle = [0, *((a + b) // 2 for a, b in zip(first[1:], last[:-1], strict=True)), T]
    return [
        FitWindow(slice(int(first[k]), int(last[k])), slice(int(middle[k]), int(middle[k + 1])))
        for k in range(count)
        if middle[k] < middle[k + 1]  # a longer gap between frames leaves windows empty
    ]


def combined(
    estimates: Sequence[Array], informations: Sequence[Array], mean: Array, prior: Array
) -> Array:
    """Return the minimum (G,) of the sum of quadratics, each with the same prior, which shall count
    once; of several, that of the least norm, where nothing fixes some direction.

    :param estimates: (G,) the minimum of each. :param informations: (G, G) its curvature, prior
        included.
    :param mean: (G,) and prior (G, G): the prior's mean and information.
    """
    total = prior + sum(I - prior for I in informations)
    right = prior @ mean + sum(
        I @ x - prior @ mean for I, x in zip(informations, estimates, strict=True)
    )
    out: Array = np.linalg.pinv(total, hermitian=True) @ right
    return out
