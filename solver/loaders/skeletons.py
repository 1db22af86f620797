# SPDX-License-Identifier: GPL-3.0-or-later
"""Joint names, trees and well-known vertex numbers of the SMPL family: facts of the formats, no
model data.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..names import BODY_JOINTS, BODY_PARENTS

HAND_ORDER = ("index", "middle", "pinky", "ring", "thumb")  # as SMPL+H and SMPL-X store them
FACE_JOINTS = ("jaw", "left_eye_smplhf", "right_eye_smplhf")
_HEAD = BODY_JOINTS.index("head")
_WRISTS = (BODY_JOINTS.index("left_wrist"), BODY_JOINTS.index("right_wrist"))


@dataclass(frozen=True)
class Skeleton:
    """One published skeleton: its name, joint names and parents."""

    name: str
    joint_names: tuple[str, ...]
    parents: tuple[int, ...]


def _with_fingers(names: list[str], parents: list[int]) -> None:
    for side, wrist in zip(("left", "right"), _WRISTS, strict=True):
        for finger in HAND_ORDER:
            for i in (1, 2, 3):
                parents.append(wrist if i == 1 else len(names) - 1)
                names.append(f"{side}_{finger}{i}")


def _skeletons() -> dict[int, Skeleton]:
    smplh = list(BODY_JOINTS)
    smplh_parents = list(BODY_PARENTS)
    _with_fingers(smplh, smplh_parents)
    smplx = [*BODY_JOINTS, *FACE_JOINTS]
    smplx_parents = [*BODY_PARENTS, _HEAD, _HEAD, _HEAD]
    _with_fingers(smplx, smplx_parents)
    every = (
        Skeleton("smpl", (*BODY_JOINTS, "left_hand", "right_hand"), (*BODY_PARENTS, *_WRISTS)),
        Skeleton("smplh", tuple(smplh), tuple(smplh_parents)),
        Skeleton("smplx", tuple(smplx), tuple(smplx_parents)),
    )
    return {len(skeleton.joint_names): skeleton for skeleton in every}


SKELETONS = _skeletons()


def recognise_skeleton(parents: NDArray[np.integer[Any]]) -> Skeleton | None:
    """Return the published skeleton with exactly these parents (K+1,), or None."""
    skeleton = SKELETONS.get(len(parents))
    return (
        skeleton
        if skeleton is not None and skeleton.parents == tuple(int(p) for p in parents)
        else None
    )


# Vertices on the published templates: 6890 of SMPL, SMPL+H and STAR, 10475 of SMPL-X.
LANDMARK_VERTICES: dict[int, dict[str, int]] = {
    6890: {
        "nose": 332, "left_eye": 2800, "right_eye": 6260, "left_ear": 583, "right_ear": 4071,
        "left_big_toe": 3216, "left_small_toe": 3226, "left_heel": 3387,
        "right_big_toe": 6617, "right_small_toe": 6624, "right_heel": 6787,
        "left_thumb_tip": 2746, "left_index_tip": 2319, "left_middle_tip": 2445,
        "left_ring_tip": 2556,
        "left_pinky_tip": 2673, "right_thumb_tip": 6191, "right_index_tip": 5782,
        "right_middle_tip": 5905,
        "right_ring_tip": 6016, "right_pinky_tip": 6133,
    },
    10475: {
        "nose": 9120, "left_eye": 9448, "right_eye": 9929, "left_ear": 6, "right_ear": 616,
        "left_big_toe": 5770, "left_small_toe": 5780, "left_heel": 8846,
        "right_big_toe": 8463, "right_small_toe": 8474, "right_heel": 8635,
        "left_thumb_tip": 5361, "left_index_tip": 4933, "left_middle_tip": 5058,
        "left_ring_tip": 5169,
        "left_pinky_tip": 5286, "right_thumb_tip": 8079, "right_index_tip": 7669,
        "right_middle_tip": 7794,
        "right_ring_tip": 7905, "right_pinky_tip": 8022,
    },
}  # fmt: skip
