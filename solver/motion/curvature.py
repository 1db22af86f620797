# SPDX-License-Identifier: GPL-3.0-or-later
"""What Gauss-Newton leaves out of the joints' Hessians, learned over a clip as
gauss_newton/curvature.py does.
"""

import numpy as np
from numba.extending import register_jitable

from ..compiled.kernel import kernel
from ..compiled.part import Array, Blocks, Pose
from ..compiled.tree import Tree
from ..gauss_newton.curvature import Curvature, allowed_share, set_current, turned, update, upper
from .system import ClipSystem, pose_of


@register_jitable
def _blocks_of(joints: Blocks, f: int) -> Blocks:
    return Blocks(joints.A, joints.H_u[f], joints.H_uu[f], joints.C, joints.c, joints.cross)


@register_jitable
def _curvature_of(curvature: Curvature, f: int) -> Curvature:
    return Curvature(curvature.S[f], curvature.H[f], curvature.g[f])


@kernel
def _set_current(tree, poses, joints, curvature, added) -> None:  # type: ignore[no-untyped-def]
    for f in range(added.shape[0]):
        set_current(tree, pose_of(poses, f), _blocks_of(joints, f), _curvature_of(curvature, f))
        for i in range(added.shape[1]):
            for k in range(6):
                added[f, i, k] = 0.0


@kernel
def _update(tree, poses, d, trial, joints, accepted, curvature) -> None:  # type: ignore[no-untyped-def]
    parts = tree.parents.shape[0]
    for f in range(d.shape[0]):
        u = d[f, 3 : 3 + 3 * parts].reshape(parts, 3)  # row 0 is the root's position
        blocks = _blocks_of(joints, f)
        update(
            tree,
            pose_of(poses, f),
            u,
            pose_of(trial, f),
            blocks,
            accepted,
            _curvature_of(curvature, f),
        )


@kernel
def _apply(tree, poses, curvature, share, added, system) -> None:  # type: ignore[no-untyped-def]
    """Add share times what may be added of S to the diagonal blocks, instead of `added` (T, K+1,
    6), their triangle.
    """
    for f in range(added.shape[0]):
        D = system.D[f]
        for i in range(1, added.shape[1]):
            S = upper(curvature.S[f, i])
            t = share * allowed_share(curvature.H[f, i], curvature.S[f, i]) if share > 0.0 else 0.0
            if t > 0.0:  # False if S has overflowed
                S = turned(poses.R[f, tree.parents[i]], S, True)
            else:
                t = 0.0
                S = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            at = 3 + 3 * i
            k = 0
            for r in range(3):
                for c in range(r, 3):
                    D[at + r, at + c] += t * S[k] - added[f, i, k]
                    added[f, i, k] = t * S[k]
                    k += 1


class ClipCurvature:
    """The estimate at the current poses of T frames."""

    def __init__(self, tree: Tree, frames: int, on: bool) -> None:
        """Begin with nothing; if it is not `on`, it stays at that."""
        self._tree = tree
        self._on = on
        parts = len(tree.parents)
        S, H = np.zeros((2, frames, parts, 3, 3))
        self._curvature = Curvature(S, H, np.zeros((frames, parts, 3)))
        self._added = np.zeros((frames, parts, 6))

    def set_current(self, poses: Pose, joints: Blocks) -> None:
        """Take over the joints' own Hessians and gradients at `poses`: blocks with a leading
        dimension of frames.
        """
        if self._on:
            _set_current(self._tree, poses, joints, self._curvature, self._added)

    def update(self, poses: Pose, d: Array, trial: Pose, joints: Blocks, accepted: bool) -> None:
        """Update by the step d (T, n) from the current poses to `trial`, which `joints` belong
        to.
        """
        if self._on:
            _update(self._tree, poses, d, trial, joints, accepted, self._curvature)

    def apply(self, poses: Pose, system: ClipSystem, wanted: bool = True) -> None:
        """Add what may be added of S to the system of the current poses, or take away what was
        added.
        """
        if self._on:
            _apply(self._tree, poses, self._curvature, float(wanted), self._added, system)
