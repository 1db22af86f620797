# SPDX-License-Identifier: GPL-3.0-or-later
"""The recordings that move the body in training, and how often each of their frames is drawn. Needs
no PyTorch.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.perception.lifter import ends_of_runs
from ...scope_addon.errors import MotionFileError
from ...scope_addon.untrusted.files import read_npz
from ...solver.rotations import exp
from ..train_prior.data import group_of

CLUSTERS = 256
# Share of all draws by kind of motion, as ``tools.mocap.kinds`` names them. Footage shows people
# who stand or walk most of the time, and a network that seldom sees straight legs bends those that
# it cannot see well.
KIND_SHARES = {
    "stand": 0.30,
    "walk": 0.25,
    "run": 0.08,
    "jump": 0.05,
    "sit": 0.12,
    "floor": 0.05,
    "other": 0.15,
}
# How often a second of each set is drawn, relative to the other sets that show the same kind of
# motion. Knees are those of people in style100, the shortest set; nearly so in accad and rocketbox,
# whose walks are 5 to 7 degrees too bent; and CMU's, straightened, are still 6 to 9 degrees too
# bent at mid-stance. The legs of reactidle were adjusted to nearly straight ones, so they are no
# evidence, and the set is as long as all else of people who stand: it adds arms and swaying.
REPEATED = {
    "style100": 15.0,
    "accad": 3.0,
    "mesh2motion": 3.0,
    "rocketbox": 2.0,
    "deepmimic": 2.0,
    "cmu_more": 1.0,
    "cmu_expmap": 0.7,
    "cmu_asf_amc": 0.7,
    "markers": 1.0,
    "reactidle": 0.2,
}
# Kinds whose common poses are what they look like: their frames are drawn equally often. In the
# others, rare poses are drawn more often than their number says.
EVEN_KINDS = ("stand", "walk", "run")


@dataclass(frozen=True)
class Motions:
    """Frames of all takes.

    ``Omega`` (F, 24, 3, 3) f32, row 0 the root into a world with y up; (F,) ``take``, ``fps``,
    ``performers`` as named by ``train_prior.data.group_of``, ``kinds`` of motion as named by
    ``tools.mocap.kinds``, and ``sets``, the archive or set of each frame.
    """

    Omega: NDArray[np.float32]
    take: NDArray[np.intp]
    fps: NDArray[np.float64]
    performers: NDArray[np.str_]
    kinds: NDArray[np.str_]
    sets: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.Omega)

    def select(self, frames: NDArray[Any]) -> Motions:
        """Return only these frames (mask or indices)."""
        return Motions(**{name: values[frames] for name, values in self._arrays().items()})

    def _arrays(self) -> dict[str, NDArray[Any]]:
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @cached_property
    def ends(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return (F,) the first and (F,) the last frame of each frame's take."""
        return ends_of_runs(self.take)

    @cached_property
    def share(self) -> NDArray[np.float64]:
        """Return (F,) the probability of drawing a frame.

        `KIND_SHARES` divides the draws among the kinds of motion that there are. Within a kind,
        each set has a share proportional to its length times `REPEATED`. Within the set, frames are
        drawn equally often in time, but those of kinds not in `EVEN_KINDS` in proportion to
        1/√(frames of the kind in the same cluster of joint states), so that common poses do not
        dominate.
        """
        share = 1 / self.fps
        for kind in np.unique(self.kinds):
            of_kind = np.flatnonzero(self.kinds == kind)
            if kind not in EVEN_KINDS:
                rarity = 1 / np.sqrt(_cluster_sizes(self.Omega[of_kind, 1:]))
                for name in np.unique(self.sets[of_kind]):
                    of_set = self.sets[of_kind] == name
                    rows = of_kind[of_set]
                    share[rows] = share[rows].sum() * rarity[of_set] / rarity[of_set].sum()
            share[of_kind] *= [REPEATED[name] for name in self.sets[of_kind]]
            share[of_kind] *= KIND_SHARES[kind] / share[of_kind].sum()
        return share / share.sum()


def _cluster_sizes(states: NDArray[np.float32]) -> NDArray[np.intp]:
    """Return (n,) how many joint states (n, 23, 3, 3) are in the same cluster as each, by k-means
    on Ω.
    """
    x = states.reshape(len(states), -1)
    rng = np.random.default_rng(0)
    centers = x[rng.choice(len(x), min(CLUSTERS, len(x)), replace=False)]
    for _ in range(5):
        label = np.argmin(np.square(centers).sum(1) - 2 * x @ centers.T, axis=1)
        count = np.bincount(label, minlength=len(centers))
        total = np.stack(
            [np.bincount(label, x[:, d], len(centers)) for d in range(x.shape[1])], axis=1
        )
        centers = np.where(
            count[:, None] > 0, total / np.maximum(count, 1)[:, None], centers
        ).astype(x.dtype)
    return count[label]


def load_motions(path: Path) -> Motions:
    """Read the valid frames of a file written by ``tools.mocap.fit_body``.

    :raises MotionFileError: the file is missing, or has no kinds of motion, or kinds or sets with
        no share.
    """
    data = read_npz(path, MotionFileError, "motion library")
    if "take_kind" not in data:
        raise MotionFileError(
            f"{path}: has no kinds of motion; python -m scope.tools.mocap.fit_body makes a new file"
        )
    poses = data["poses"]
    valid = data["valid"]
    start = data["take_start"]
    take = np.repeat(np.arange(len(start) - 1), np.diff(start))[valid]
    performers = np.array(
        [group_of(*names) for names in zip(data["take_source"], data["take_subject"], strict=True)]
    )
    kinds = data["take_kind"]
    sets = data["take_set"]
    unknown = sorted({*kinds} - {*KIND_SHARES} | {*sets} - {*REPEATED})
    if unknown:
        raise MotionFileError(
            f"{path}: no share for {', '.join(unknown)}; add them to KIND_SHARES or REPEATED"
        )
    Omega = exp(poses[valid].reshape(len(take), -1, 3).astype(float)).astype(np.float32)
    return Motions(Omega, take, data["take_fps"][take], performers[take], kinds[take], sets[take])
