# SPDX-License-Identifier: GPL-3.0-or-later
"""A clip's objective: the terms of every frame, the acceleration between frames, and the shape's prior once."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from ..compiled.part import GRADIENT, Array, Blocks, Pose
from ..compiled.tree import Tree
from ..custom_residuals.external import raise_failure
from ..gauss_newton.linearize import clear_blocks, linearize, make_blocks, make_pose, make_scratch, place_parts
from ..gauss_newton.optimizer import Settings
from ..measurements import Measurements
from ..residuals.registry import SHAPE_PRIOR
from . import acceleration, standing
from .prior import MotionPrior, StandingPoints
from .system import ClipSystem, add_turned, pose_of, write_frame
from .views import PackedView, View, place_in_camera

Frame = Measurements | Sequence[View]


@dataclass
class Globals:
    """What all frames share: the prior of the shape, and of the logarithm of the focal length."""

    shape_mean: Array  # (P,)
    shape_information: Array  # (P, P), over the shape's weight
    focal_weight: float


@dataclass
class MotionTerms:
    """What couples the frames, laid out for the kernels."""

    h: Array  # (T,) seconds since the frame before; the first is not used
    table: Array  # (K+2, 2) of `MotionPrior.packed`
    indices: Array  # (C,) standing points
    probability: Array  # (T, C) of standing since the frame before
    contact: float

    @classmethod
    def make(cls, tree: Tree, times: Array, prior: MotionPrior, stands: StandingPoints) -> "MotionTerms":
        """Lay out the terms of frames at `times` (T,), seconds.

        :raises ShapeError: an array does not fit the body or the clip.
        :raises InvalidValueError: a value that no fit can use.
        """
        indices, probability = stands.packed(len(tree.point_part), len(times))
        table = prior.packed(len(tree.parents) - 1)
        return cls(np.diff(times, prepend=times[0] - 1.0), table, indices, probability, float(prior.contact))

    def part(self, frames: slice) -> "MotionTerms":
        """Return the terms of consecutive frames alone."""
        return MotionTerms(self.h[frames], self.table, self.indices, self.probability[frames], self.contact)


@dataclass
class _Memory:
    """What one thread linearizes in."""

    seen: Pose
    blocks: Blocks
    total: Blocks
    scratch: Array
    sums: Array

    @classmethod
    def make(cls, tree: Tree) -> "_Memory":
        blocks = make_blocks(tree)
        return cls(make_pose(tree), blocks, make_blocks(tree), make_scratch(tree), np.zeros_like(blocks.A))


@dataclass
class ClipProblem:
    """All terms of a clip, and how to linearize them."""

    tree: Tree
    frames: list[list[PackedView]]
    motion: MotionTerms
    shared: Globals
    settings: Settings  # without the shape's prior in the frames: it enters once
    pool: ThreadPoolExecutor | None = None
    costs: dict[str, float] = field(default_factory=dict)  # of what couples the frames, and of the shared unknowns

    def __post_init__(self) -> None:
        """Make the working memory."""
        self.shape_weights = self.settings.stages[:, 0, SHAPE_PRIOR].copy()
        self.settings = self.settings._replace(stages=self.settings.stages.copy())
        self.settings.stages[:, 0, SHAPE_PRIOR] = 0.0
        self._memories = [_Memory.make(self.tree) for _ in range(2 if self.pool is not None else 1)]
        K, W = len(self.tree.parents) - 1, self.tree.S.shape[2]
        T = len(self.frames)
        self.H_uu, self.g_u = np.zeros((T, K, 3, 3)), np.zeros((T, K, 3))  # of the joints alone, as last linearized
        self.coupled = False  # whether a residual couples a joint's state with its part's pose
        self._triple = np.zeros((6, 3, 3))
        self._rows, self._columns = np.zeros((3, 3, 6 + 3 * K + W)), np.zeros(6 + 3 * K, np.int64)

    def linearize(self, s: int, poses: Pose, system: ClipSystem) -> float:
        """Write the normal equations at `poses` with the weights of stage s, and return the cost."""
        T = len(self.frames)
        system.C[:] = 0.0
        system.c[:] = 0.0
        halves = [range(T)] if len(self._memories) == 1 else [range(T // 2), range(T // 2, T)]
        sums = [(np.zeros_like(system.C), np.zeros_like(system.c)) for _ in halves]
        if self.pool is None:
            costs = [self._linearize_frames(s, halves[0], poses, system, self._memories[0], *sums[0])]
        else:
            jobs = zip(halves, self._memories, sums, strict=True)
            waiting = [self.pool.submit(self._linearize_frames, s, r, poses, system, m, *Cc) for r, m, Cc in jobs]
            costs = [job.result() for job in waiting]
        raise_failure()
        for C, c in sums:
            system.C[:] += C
            system.c[:] += c
        system.B1[:] = 0.0
        system.B2[:] = 0.0
        m = self.motion
        self.costs = {
            "acceleration": acceleration.accumulate(self.tree, poses, m.h, m.table, self._triple, system),
            "contact": standing.accumulate(
                self.tree, poses, m.h, m.indices, m.probability, m.contact, self._rows, self._columns, system
            ),
            "shape_prior": self._add_shape_prior(s, poses, system),
        }
        if self.tree.globals > self.tree.shape:
            self.costs["focal_prior"] = self._add_focal_prior(poses, system)
        cost: float = sum(costs) + sum(self.costs.values())
        return cost

    def _linearize_frames(
        self, s: int, frames: range, poses: Pose, system: ClipSystem, memory: _Memory, C: Array, c: Array
    ) -> float:
        """Write the blocks of some frames, add to C and c, and return their cost."""
        tree, stage, triggs = self.tree, self.settings.stages[s], self.settings.triggs
        blocks, total, cost = memory.blocks, memory.total, 0.0
        for f in frames:
            pose, views = pose_of(poses, f), self.frames[f]
            alone = len(views) == 1 and views[0].own_axes
            if not alone:
                place_parts(tree, pose)
                clear_blocks(total)
                total.A[:] = 0.0
            for view in views:
                if not alone:
                    place_in_camera(view, pose, memory.seen)
                at = pose if alone else memory.seen
                cost += linearize(tree, view.terms, stage, triggs, at, blocks, memory.scratch)
                if not alone:
                    add_turned(view.R, blocks, total)
            own = blocks if alone else total
            self.coupled = self.coupled or bool(own.cross[0])
            self.H_uu[f], self.g_u[f] = own.H_uu[1:], own.H_u[1:, :, GRADIENT]
            write_frame(tree, pose, own, memory.sums, system.D[f], system.N[f], C, c)
        return cost

    def _add_shape_prior(self, s: int, poses: Pose, system: ClipSystem) -> float:
        P, weight, information = self.tree.shape, self.shape_weights[s], self.shared.shape_information
        offset = poses.beta[:P] - self.shared.shape_mean
        system.C[:P, :P] += weight * information
        system.c[:P] += weight * (information @ offset)
        return float(0.5 * weight * (offset @ information @ offset))

    def _add_focal_prior(self, poses: Pose, system: ClipSystem) -> float:
        P, weight, log_focal = self.tree.shape, self.shared.focal_weight, float(poses.log_focal[0])
        system.C[P, P] += weight
        system.c[P] += weight * log_focal
        return 0.5 * weight * log_focal**2
