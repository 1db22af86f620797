# SPDX-License-Identifier: GPL-3.0-or-later
"""What Gauss-Newton leaves out of the joints' Hessians, learned over a clip as gauss_newton/curvature.py does.

The same update of S and the same share of it, for all joints of all frames at once, in the parents' axes.
"""

import numpy as np

from ..compiled.part import Array, Pose
from ..compiled.tree import Tree
from ..gauss_newton.curvature import LEAST_COSINE, LEAST_SHARE, SHORTEST_STEP
from .system import ClipSystem


class ClipCurvature:
    """The estimate at the current poses of T frames of K joints."""

    def __init__(self, tree: Tree, frames: int, on: bool) -> None:
        """Begin with nothing; if it is not `on`, it stays at that."""
        self._on = on and len(tree.parents) > 1
        self._parents = np.asarray(tree.parents[1:], dtype=np.intp)
        K = len(self._parents)
        self.S = np.zeros((frames, K, 3, 3))
        self._H, self._g = np.zeros((frames, K, 3, 3)), np.zeros((frames, K, 3))
        self._added = np.zeros((frames, K, 3, 3))

    def set_current(self, poses: Pose, H_uu: Array, g_u: Array) -> None:
        """Take over the joints' own Hessians (T, K, 3, 3) and gradients (T, K, 3) at `poses`, in camera axes."""
        R = poses.R[:, self._parents]
        self._H, self._g = R.swapaxes(-1, -2) @ H_uu @ R, np.einsum("fkrc,fkr->fkc", R, g_u)
        self._added = np.zeros_like(self.S)

    def update(self, poses: Pose, d: Array, trial: Pose, H_uu: Array, g_u: Array, accepted: bool) -> None:
        """Update by the step d (T, n) from the current poses to `trial`, where H_uu (T, K, 3, 3), g_u (T, K, 3)."""
        if not self._on:
            return
        R, Q = poses.R[:, self._parents], trial.R[:, self._parents]
        K = len(self._parents)
        w = np.einsum("fkrc,fkr->fkc", R, d[:, 6 : 6 + 3 * K].reshape(-1, K, 3))
        H = Q.swapaxes(-1, -2) @ H_uu @ Q if accepted else self._H
        e = np.einsum("fkrc,fkr->fkc", Q, g_u) - self._g - np.einsum("fkrc,fkc->fkr", H + self.S, w)
        length, along = (w * w).sum(-1), (e * w).sum(-1)
        certain = along**2 > LEAST_COSINE**2 * length * (e * e).sum(-1)
        used = certain & (length > SHORTEST_STEP**2) & np.isfinite(along)
        self.S[used] += e[used][:, :, None] * e[used][:, None, :] / along[used][:, None, None]

    def apply(self, poses: Pose, system: ClipSystem, wanted: bool = True) -> None:
        """Add what may be added of S to the system of the current poses, or take away what was added."""
        if not self._on:
            return
        share = self._share() if wanted else np.zeros(self.S.shape[:2])
        R = poses.R[:, self._parents]
        added = R @ (share[..., None, None] * self.S) @ R.swapaxes(-1, -2)
        for k in range(len(self._parents)):
            at = slice(6 + 3 * k, 9 + 3 * k)
            system.D[:, at, at] += added[:, k] - self._added[:, k]
        self._added = added

    def _share(self) -> Array:
        """Return t (T, K) of 1, 1/2, 1/4, 1/8 and 0: the most of S that keeps H + t S above a share of H."""
        share, k = np.zeros(self.S.shape[:2]), 1.0 - LEAST_SHARE
        usable = np.isfinite(self.S).all(axis=(-1, -2))
        self.S[~usable] = 0.0
        for t in (0.125, 0.25, 0.5, 1.0):
            M = k * self._H + t * self.S
            minor = M[..., 0, 0] * M[..., 1, 1] - M[..., 0, 1] * M[..., 1, 0]
            positive = (M[..., 0, 0] > 0.0) & (minor > 0.0) & (np.linalg.det(M) > 0.0)
            share[positive] = t
        return share
