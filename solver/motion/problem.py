# SPDX-License-Identifier: Apache-2.0
"""A clip's objective: the terms of every frame, the acceleration between frames, and the shape's
prior once.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..gauss_newton.linearize import (
    clear_blocks,
    linearize,
    make_blocks,
    make_pose,
    make_scratch,
    place_parts,
)
from ..gauss_newton.optimizer import Settings, SharedPriors
from ..kernel import inlined_kernel, kernel
from ..part import GRADIENT, Array, Blocks, Pose
from ..residuals.external import raise_failure
from ..residuals.registry import SHAPE_PRIOR
from ..tree import Tree
from . import acceleration, standing
from .band import run_both
from .prior import MotionPrior, StandingPoints
from .system import ClipSystem, add_turned, make_system, pose_of, write_frame
from .views import PackedViews, place_in_camera, terms_of


class MotionTerms(NamedTuple):
    """What couples the frames, laid out for the kernels."""

    h: Array  # (T,) seconds since the frame before; the first is not used
    table: Array  # (K+2, 2) of `MotionPrior.packed`
    indices: Array  # (C,) standing points
    probability: Array  # (T, C) of standing since the frame before
    contact: float

    @classmethod
    def make(
        cls, tree: Tree, times: Array, prior: MotionPrior, stands: StandingPoints
    ) -> "MotionTerms":
        """Lay out the terms of frames at `times` (T,), seconds.

        :raises ShapeError: an array does not fit the body or the clip.
        :raises InvalidValueError: a value that no fit can use.
        """
        indices, probability = stands.packed(len(tree.point_part), len(times))
        table = prior.packed(len(tree.parents) - 1)
        return cls(
            np.diff(times, prepend=times[0] - 1.0),
            table,
            indices,
            probability,
            float(prior.contact),
        )

    def part(self, frames: slice) -> "MotionTerms":
        """Return the terms of consecutive frames alone."""
        probability = self.probability[frames].copy()
        probability[:1] = 0.0  # since a frame that is not among them
        return self._replace(h=self.h[frames], probability=probability)


# frames that are linearized and coupled before the next ones, while they are in the processor's
# cache
_CHUNK = 8


class _Memory(NamedTuple):
    """What one half of the clip is linearized in."""

    seen: Pose
    blocks: Blocks
    total: Blocks
    scratch: Array
    sums: Array
    accelerations: acceleration.Memory
    work: Array  # (3, 1+W)
    C: Array  # (W, W) and c (W,): of the frames of this half
    c: Array


def _make_memory(tree: Tree) -> _Memory:
    blocks = make_blocks(tree)
    total = make_blocks(tree)
    sums = np.zeros_like(blocks.A)
    W = len(blocks.c)
    return _Memory(
        make_pose(tree),
        blocks,
        total,
        make_scratch(tree),
        sums,
        acceleration.make_memory(tree),
        np.zeros((3, 1 + W)),
        np.zeros((W, W)),
        np.zeros(W),
    )


@inlined_kernel
def linearize_frames(  # type: ignore[no-untyped-def]
    tree, views, first, last, stage, poses, memory, joints, system
) -> float:
    """Write the blocks of frames first..last-1 and what `joints` has, add to C and c of `memory`;
    return the cost.
    """
    cost: float = 0.0
    blocks = memory.blocks
    total = memory.total
    for f in range(first, last):
        pose = pose_of(poses, f)
        v = views.of_frame[f]
        end = views.of_frame[f + 1]
        alone = end - v == 1 and views.own_axes[v]
        at = pose if alone else memory.seen
        own = blocks if alone else total
        if not alone:
            place_parts(tree, pose)
            clear_blocks(total)
            total.A[:] = 0.0
        while v < end:
            if not alone:
                place_in_camera(views.R[v], views.t[v], pose, memory.seen)
            cost += linearize(tree, terms_of(views, v), stage, at, blocks, memory.scratch)
            if not alone:
                add_turned(views.R[v], blocks, total)
            v += 1
        if own.cross[0]:
            joints.cross[0] = 1
        for i in range(1, tree.parents.shape[0]):
            for r in range(3):
                joints.H_u[f, i, r, GRADIENT] = own.H_u[i, r, GRADIENT]
                for k in range(3):
                    joints.H_uu[f, i, r, k] = own.H_uu[i, r, k]
        write_frame(tree, pose, own, memory.sums, system.D[f], system.N[f], memory.C, memory.c)
        system.B1[f] = 0.0
        system.B2[f] = 0.0
    return cost


@kernel
def couple_frames(  # type: ignore[no-untyped-def]
    tree, poses, motion, first, last, memory, system, costs
) -> None:
    """Add what couples each of the frames first..last-1 to the two before it; add to costs[1] and
    costs[2].
    """
    costs[1] += acceleration.accumulate(
        tree, poses, motion, first, last, memory.accelerations, system
    )
    costs[2] += standing.accumulate(tree, first, last, memory.work, system, memory.C, memory.c)


@kernel
def linearize_half(  # type: ignore[no-untyped-def]
    tree, views, motion, first, last, coupled, stage, poses, memory, joints, system, costs
) -> None:
    """Write the equations of frames first..last-1, those from `coupled` on with what couples them;
    costs (3,).
    """
    memory.C[:] = 0.0
    memory.c[:] = 0.0
    for a in range(first, last, _CHUNK):
        b = min(a + _CHUNK, last)
        costs[0] += linearize_frames(tree, views, a, b, stage, poses, memory, joints, system)
        standing.place_points(tree, poses, motion, a, b, system)
        couple_frames(tree, poses, motion, max(a, coupled), b, memory, system, costs)


@dataclass
class ClipProblem:
    """All terms of a clip, and how to linearize them.

    The clip is linearized in halves, whether two threads share them or one takes both, so that all
    sums are the same.
    """

    tree: Tree
    views: PackedViews
    motion: MotionTerms
    shared: SharedPriors
    settings: Settings  # without the shape's prior in the frames: it enters once
    pool: ThreadPoolExecutor | None = None
    # of what couples the frames, and of the shared unknowns
    costs: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Make the working memory."""
        self.shape_weights = self.settings.stages[:, 0, SHAPE_PRIOR].copy()
        self.settings = self.settings._replace(stages=self.settings.stages.copy())
        self.settings.stages[:, 0, SHAPE_PRIOR] = 0.0
        self._memories = _make_memory(self.tree), _make_memory(self.tree)
        parts = len(self.tree.parents)
        T = self.frames
        # of the joints alone, as last linearized, with a leading dimension of frames
        self.joints = self._memories[0].total._replace(
            H_u=np.zeros((T, parts, 3, GRADIENT + 1)),
            H_uu=np.zeros((T, parts, 3, 3)),
            cross=np.zeros(1, np.int64),
        )

    @property
    def frames(self) -> int:
        """T."""
        return len(self.views.of_frame) - 1

    def make_system(self) -> ClipSystem:
        """Return a system of zeros to linearize into."""
        return make_system(self.tree, self.frames, self.motion.indices)

    def linearize(self, s: int, poses: Pose, system: ClipSystem) -> float:
        """Write the normal equations at `poses` with the weights of stage s, and return the
        cost.
        """
        # by half, then of the frames that reach from one to the other
        T = self.frames
        costs = np.zeros((3, 3))
        system.C[:] = 0.0
        system.c[:] = 0.0
        self.joints.cross[0] = 0
        middle = T // 2
        # the first frame whose acceleration is that of the second half alone
        after = min(middle + 2, T)
        front = s, poses, system, (0, middle, 0), self._memories[0], costs[0]
        back = s, poses, system, (middle, T, after), self._memories[1], costs[1]
        run_both(self.pool, self._linearize_half, front, back)
        couple_frames(
            self.tree, poses, self.motion, middle, after, self._memories[0], system, costs[2]
        )
        for memory in self._memories:
            system.C[:] += memory.C
            system.c[:] += memory.c
        shared = self.shape_weights[s], poses.beta, float(poses.log_focal[0])
        self.shared.add(*shared, system.C, system.c)
        self.costs = {
            "acceleration": float(costs[:, 1].sum()),
            "contact": float(costs[:, 2].sum()),
            **self.shared.costs(*shared),
        }
        return float(costs[:, 0].sum()) + sum(self.costs.values())

    def _linearize_half(
        self,
        s: int,
        poses: Pose,
        system: ClipSystem,
        frames: tuple[int, int, int],
        memory: _Memory,
        costs: Array,
    ) -> None:
        linearize_half(
            self.tree,
            self.views,
            self.motion,
            *frames,
            self.settings.stages[s],
            poses,
            memory,
            self.joints,
            system,
            costs,
        )
        raise_failure()  # in the thread in which the residual failed
