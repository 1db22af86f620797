# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations of each joint from build/mocap/motions.npz, without joints for which a source has
constants only.

Left and right are one joint: a right joint's state is mirrored, Omega -> S Omega S with S =
diag(-1, 1, 1), and counts as the left one's; joints of the trunk get every sample and its mirror
image.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.errors import MotionFileError
from ...scope_addon.untrusted.files import read_npz
from ...solver.rotations import exp

STEP = 3  # every third frame: 10 a second, neighbours are nearly the same
MIRROR = np.diag([-1.0, 1.0, 1.0])  # x points to the person's left
TRUNK = ("spine1", "spine2", "spine3", "neck", "head")
# left_ and right_
PAIRED = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist")
MODELS = TRUNK + PAIRED  # one flow for each
# for the knuckles, sources have no data or a fixed share of the wrist's angle
WITHOUT_DATA = ("hand",)
# DeepMimic's character has one joint each for trunk and neck, whose rotation the fit divides by
# fixed shares, and no collars, wrists or toes. The sets of joint positions are fitted in the same
# way. Where they have no orientations, a foot turns with its shank, so that its ankle only bends;
# the legs of reactidle were adjusted.
LIMBS = ("hip", "knee", "ankle", "shoulder", "elbow")
UNTURNED_FEET = ("hip", "knee", "shoulder", "elbow")
MEASURED = {
    "cmu_asf_amc": MODELS,
    "cmu_expmap": MODELS,
    "deepmimic": LIMBS,
    "rocketbox": LIMBS,
    "style100": LIMBS,
    "accad": UNTURNED_FEET,
    "cmu_more": UNTURNED_FEET,
    "markers": UNTURNED_FEET,
    "mesh2motion": UNTURNED_FEET,
    "reactidle": ("shoulder", "elbow"),
}


# Test performers, not used in training or in model selection.
TEST = ("cmu_02", "expmap_soccer")
# Kept from every training and from the prior's test: legs and joint centres are judged by them
# elsewhere.
RESERVED = ("markers", "reactidle_reserved", "cmu_08", "cmu_12")
# Left out in turn for model selection.
FOLDS = (
    ("cmu_01", "accad_female1"),
    ("cmu_03", "expmap_basketball", "cmu_05"),
    ("expmap_jumping", "cmu_09"),
    ("expmap_walking", "cmu_07"),
)
# Always in: few of the joints, or nobody else has legs as straight.
ALWAYS = ("deepmimic", "mesh2motion", "reactidle", "rocketbox_f", "rocketbox_m", "style100_mason")
RESERVED_OF_REACTIDLE = ("reactidle_010", "reactidle_011")
# CMU's numbers of performers whom the exponential-map archive has under activities.
CMU_ACTIVITIES = {"cmu_06": "basketball", "cmu_13": "jumping", "cmu_14": "jumping"}


@dataclass(frozen=True)
class Samples:
    """Samples of one model: rotations (n, 3, 3) and performers (n,) as named by ``group_of``."""

    rotations: NDArray[np.float64]
    group: NDArray[np.str_]

    @property
    def is_training(self) -> NDArray[np.bool_]:
        """Return (n,) bool: not by the performers kept from training."""
        return ~np.isin(self.group, TEST + RESERVED)

    @property
    def is_test(self) -> NDArray[np.bool_]:
        """Return (n,) bool: by the test performers."""
        return np.isin(self.group, TEST)


def group_of(source: str, subject: str) -> str:
    """Return the name of the group of performers of a take.

    The exponential-map archive does not name its performers, so takes of one activity stay
    together: walking and running overlap, and so may jumping, washing windows and directing
    traffic. Performers of ``cmu_more`` whom that archive has too are in the group of their
    activity. Sets of many performers with little of each are one group.
    """
    if source == "markers":
        return "markers"
    if source == "reactidle":
        return "reactidle_reserved" if subject in RESERVED_OF_REACTIDLE else "reactidle"
    if source != "cmu_expmap":
        return f"expmap_{CMU_ACTIVITIES[subject]}" if subject in CMU_ACTIVITIES else subject
    activity = subject.removeprefix("expmap_").split("_", 1)[1].rstrip("0123456789").strip("_")
    together = {"basketball_signal": "basketball", "running": "walking", "washwindow": "jumping"}
    return "expmap_" + together.get(
        activity, "jumping" if activity == "directing_traffic" else activity
    )


def mirrored(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the joint states (n, 3, 3) of the mirror image."""
    return MIRROR @ rotations @ MIRROR


def load_samples(path: Path, joint_names: tuple[str, ...]) -> dict[str, Samples]:
    """Return the samples of every model.

    :param path: motions.npz of tools/mocap/fit_body.py, whose poses follow ``joint_names`` (K+1,).
    :raises MotionFileError: when the file is missing, or has takes of an unknown performer.
    """
    motions = read_npz(path, MotionFileError, "motion library")
    groups = [
        group_of(*pair)
        for pair in zip(motions["take_source"], motions["take_subject"], strict=True)
    ]
    unknown = sorted(set(groups) - {*ALWAYS, *TEST, *RESERVED, *itertools.chain(*FOLDS)})
    if unknown:
        raise MotionFileError(
            f"{path}: {', '.join(unknown)} belong to no split; add them to TEST, RESERVED, FOLDS "
            "or ALWAYS"
        )
    lengths = np.diff(motions["take_start"])
    group = np.repeat(groups, lengths)
    source = np.repeat(motions["take_source"], lengths)
    within = np.concatenate([np.arange(n) for n in lengths])
    chosen = motions["valid"] & (within % STEP == 0)
    phi = motions["poses"].reshape(len(group), -1, 3).astype(np.float64)
    out = {}
    for model in MODELS:
        keep = chosen & np.isin(
            source, [name for name, models in MEASURED.items() if model in models]
        )
        joints = [model] if model in TRUNK else [f"left_{model}", f"right_{model}"]
        first = exp(phi[keep, joint_names.index(joints[0])])
        second = exp(phi[keep, joint_names.index(joints[-1])])
        rotations = np.concatenate([first, mirrored(second)])
        out[model] = Samples(rotations, np.tile(group[keep], 2))
    return out
