# SPDX-License-Identifier: GPL-3.0-or-later
"""CMU motions as comma separated exponential maps: 39 x 3 values per frame.

The first triple is the root's position in CMU's length unit, the others are rotations of 38 joints
relative to their parents. They come from a conversion to .bvh of the .amc files that kept the rest
axes of the .asf skeletons, so the triples follow the bones of the .asf hierarchy, with an extra,
motionless one after each chain (tips) and one for each hip bone. The matrices are for row vectors:
for column vectors, as here, R = exp(−φ).

The archive has no skeletons and does not name the performers. The commonly used offset table omits
the length of each bone that branches, thorax (11.6 cm) and wrist (9.4 cm), because a .bvh joint has
a single offset. Here the bones are those of the .asf skeletons, scaled per file until the feet
stand on the floor at y = 0. Frame 0 of each file is the conversion's reference pose and is left
out. The rate, 120 fps, follows from the gait.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ....scope_addon.errors import MotionFileError
from ....solver.rotations import exp
from .asf_amc import Skeleton

FPS = 120.0
COLUMNS = 117
_LEG = ("hipjoint", "femur", "tibia", "foot", "toes", "")
_HAND = ("hand", "fingers", "", "thumb", "")
# Bone of each rotation triple; "" is a tip.
BONES = (
    "root",
    *(f"l{b}" if b else "" for b in _LEG),
    *(f"r{b}" if b else "" for b in _LEG),
    "lowerback", "upperback", "thorax", "lowerneck", "upperneck", "head", "",
    "lclavicle", "lhumerus", "lradius", "lwrist", *(f"l{b}" if b else "" for b in _HAND),
    "rclavicle", "rhumerus", "rradius", "rwrist", *(f"r{b}" if b else "" for b in _HAND),
)  # fmt: skip
# metres of the ball of the foot above the floor when standing; 02_01..10 have 0.02 to 0.045
STANCE_HEIGHT = 0.03
STANCE_QUANTILE = 0.1  # of the frames, ordered by height of the lower foot
SCALES = np.linspace(0.75, 1.25, 101)


def parse_expmap(
    text: str, name: str = "motion"
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Read a file.

    :return: φ (T, 38, 3) radians, exactly as in the file but without frame 0, and root (T, 3) in
        CMU's unit.
    :raises MotionFileError: when a line does not have 117 numbers, or there are fewer than 2 lines.
    """
    lines = text.split()
    if any(line.count(",") != COLUMNS - 1 for line in lines):
        raise MotionFileError(f"{name}: every line must have {COLUMNS} comma separated numbers")
    try:
        values = np.array(",".join(lines).split(","), dtype=float).reshape(-1, COLUMNS // 3, 3)
    except ValueError as error:
        raise MotionFileError(
            f"{name}: {error}; every line must have {COLUMNS} comma separated numbers"
        ) from error
    if len(values) < 2:
        raise MotionFileError(
            f"{name}: a reference pose and at least one frame are needed, but it has {len(values)}"
        )
    return values[1:, 1:], values[1:, 0]


def bone_rotations(phi: NDArray[np.float64], skeleton: Skeleton) -> NDArray[np.float64]:
    """Return rotations (T, B, 3, 3) of the skeleton's bones relative to their parents, from φ (T,
    38, 3).
    """
    M = np.broadcast_to(np.eye(3), (len(phi), len(skeleton.bones), 3, 3)).copy()
    for k, bone in enumerate(BONES):
        if bone:
            M[:, skeleton.bones.index(bone)] = exp(-phi[:, k])
    return M


def standing_scale(R: NDArray[np.float64], root: NDArray[np.float64], skeleton: Skeleton) -> float:
    """Return the skeleton's scale at which the lower foot of standing frames is ``STANCE_HEIGHT``
    above the floor.

    :param R: (T, B, 3, 3) bone to world; root (T, 3) metres.
    """
    legs = []
    for side in "lr":
        chain = [skeleton.bones.index(side + b) for b in ("hipjoint", "femur", "tibia", "foot")]
        legs.append(np.einsum("tbj,bj->t", R[:, chain, 1], skeleton.offsets[chain]))
    heights = np.minimum(
        root[:, 1] + SCALES[:, None] * legs[0], root[:, 1] + SCALES[:, None] * legs[1]
    )
    standing = np.quantile(heights, STANCE_QUANTILE, axis=1)
    return float(SCALES[np.argmin(np.abs(standing - STANCE_HEIGHT))])


def average_skeleton(skeletons: list[Skeleton]) -> Skeleton:
    """Return the skeleton with the mean of the bone offsets; left and right are made mirror
    images.
    """
    first = skeletons[0]
    offsets = np.mean([s.offsets for s in skeletons], axis=0)
    mirror = [first.bones.index({"l": "r", "r": "l"}[b[0]] + b[1:]) if _is_sided(b) else i
              for i, b in enumerate(first.bones)]  # fmt: skip
    offsets = 0.5 * (offsets + offsets[mirror] * [-1.0, 1.0, 1.0])
    return replace(first, offsets=offsets)


def _is_sided(bone: str) -> bool:
    return bone not in ("root", "lowerback", "lowerneck") and bone[0] in "lr"
