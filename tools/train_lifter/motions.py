# SPDX-License-Identifier: GPL-3.0-or-later
"""The recordings that move the body in training, and how often each of their frames is drawn. Needs no PyTorch."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.perception.lifter import ends_of_runs
from ...scope_addon.errors import MotionFileError
from ...solver.loaders.npz import read_npz
from ...solver.rotations import exp
from ..train_prior.data import group_of

CLUSTERS = 256


@dataclass(frozen=True)
class Motions:
    """Frames of all takes.

    ``Omega`` (F, 24, 3, 3) f32, row 0 the root into a world with y up; (F,) ``take``, ``fps`` and ``performers``, the
    latter as named by ``train_prior.data.group_of``.
    """

    Omega: NDArray[np.float32]
    take: NDArray[np.intp]
    fps: NDArray[np.float64]
    performers: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.Omega)

    def select(self, frames: NDArray[Any]) -> Motions:
        """Return only these frames (mask or indices)."""
        return Motions(self.Omega[frames], self.take[frames], self.fps[frames], self.performers[frames])

    @cached_property
    def ends(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return (F,) the first and (F,) the last frame of each frame's take."""
        return ends_of_runs(self.take)

    @cached_property
    def share(self) -> NDArray[np.float64]:
        """Return (F,) the probability of drawing a frame, so that common poses, such as walking, do not dominate.

        Proportional to 1/√(frames in the same cluster of joint states), clusters by k-means on Ω.
        """
        x = self.Omega[:, 1:].reshape(len(self), -1)
        rng = np.random.default_rng(0)
        centers = x[rng.choice(len(x), min(CLUSTERS, len(x)), replace=False)]
        for _ in range(5):
            label = np.argmin(np.square(centers).sum(1) - 2 * x @ centers.T, axis=1)
            count = np.bincount(label, minlength=len(centers))
            total = np.stack([np.bincount(label, x[:, d], len(centers)) for d in range(x.shape[1])], axis=1)
            centers = np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], centers).astype(x.dtype)
        share = 1 / np.sqrt(count[label])
        return share / share.sum()


def load_motions(path: Path) -> Motions:
    """Read the valid frames of a file written by ``tools.mocap.fit_body``.

    :raises MotionFileError: the file is missing or no such file.
    """
    data = read_npz(path, MotionFileError, "motion library")
    poses, valid, start = data["poses"], data["valid"], data["take_start"]
    take = np.repeat(np.arange(len(start) - 1), np.diff(start))[valid]
    performers = np.array([group_of(*names) for names in zip(data["take_source"], data["take_subject"], strict=True)])
    Omega = exp(poses[valid].reshape(len(take), -1, 3).astype(float)).astype(np.float32)
    return Motions(Omega, take, data["take_fps"][take], performers[take])
