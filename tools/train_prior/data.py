# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations of each joint from build/mocap/motions.npz, without joints for which a source has constants only.

Left and right are one joint: a right joint's state is mirrored, Omega -> S Omega S with S = diag(-1, 1, 1), and counts
as the left one's; joints of the trunk get every sample and its mirror image.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.errors import MotionFileError
from ...solver.loaders.npz import read_npz
from ...solver.rotations import exp

STEP = 3  # every third frame: 10 a second, neighbours are nearly the same
MIRROR = np.diag([-1.0, 1.0, 1.0])  # x points to the person's left
TRUNK = ("spine1", "spine2", "spine3", "neck", "head")
PAIRED = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist")  # left_ and right_
MODELS = TRUNK + PAIRED  # one flow for each
WITHOUT_DATA = ("hand",)  # for the knuckles, sources have no data or a fixed share of the wrist's angle
# DeepMimic's character has one joint each for trunk and neck, whose rotation the fit divides by fixed shares, and no
# collars, wrists or toes.
DEEPMIMIC = ("hip", "knee", "ankle", "shoulder", "elbow")


# Test performers, not used in training or in model selection.
TEST = ("cmu_02", "expmap_soccer")
# Left out in turn for model selection. DeepMimic, with few of the joints, always stays in.
FOLDS = (("cmu_01",), ("cmu_03", "expmap_basketball"), ("expmap_jumping",), ("expmap_walking",))


@dataclass(frozen=True)
class Samples:
    """Samples of one model: rotations (n, 3, 3) and performers (n,) as named by ``group_of``."""

    rotations: NDArray[np.float64]
    group: NDArray[np.str_]

    @property
    def is_training(self) -> NDArray[np.bool_]:
        """Return (n,) bool: not by the test performers."""
        return ~np.isin(self.group, TEST)


def group_of(source: str, subject: str) -> str:
    """Return the name of the group of performers of a take.

    The exponential-map archive does not name its performers, so takes of one activity stay together: walking and
    running overlap, and so may jumping, washing windows and directing traffic.
    """
    if source != "cmu_expmap":
        return subject
    activity = subject.removeprefix("expmap_").split("_", 1)[1].rstrip("0123456789").strip("_")
    together = {"basketball_signal": "basketball", "running": "walking", "washwindow": "jumping"}
    return "expmap_" + together.get(activity, "jumping" if activity == "directing_traffic" else activity)


def mirrored(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the joint states (n, 3, 3) of the mirror image."""
    return MIRROR @ rotations @ MIRROR


def load_samples(path: Path, joint_names: tuple[str, ...]) -> dict[str, Samples]:
    """Return the samples of every model.

    :param path: motions.npz of tools/mocap/fit_body.py, whose poses follow ``joint_names`` (K+1,).
    :raises MotionFileError: when the file is missing, or has takes of an unknown performer.
    """
    motions = read_npz(path, MotionFileError, "motion library")
    groups = [group_of(*pair) for pair in zip(motions["take_source"], motions["take_subject"], strict=True)]
    unknown = sorted(set(groups) - {"deepmimic", *TEST, *itertools.chain(*FOLDS)})
    if unknown:
        raise MotionFileError(f"{path}: {', '.join(unknown)} belong to no split; add them to TEST or FOLDS")
    lengths = np.diff(motions["take_start"])
    group, source = np.repeat(groups, lengths), np.repeat(motions["take_source"], lengths)
    within = np.concatenate([np.arange(n) for n in lengths])
    chosen = motions["valid"] & (within % STEP == 0)
    phi = motions["poses"].reshape(len(group), -1, 3).astype(np.float64)
    out = {}
    for model in MODELS:
        keep = chosen if model in DEEPMIMIC else chosen & (source != "deepmimic")
        joints = [model] if model in TRUNK else [f"left_{model}", f"right_{model}"]
        first, second = exp(phi[keep, joint_names.index(joints[0])]), exp(phi[keep, joint_names.index(joints[-1])])
        rotations = np.concatenate([first, mirrored(second)])
        out[model] = Samples(rotations, np.tile(group[keep], 2))
    return out
