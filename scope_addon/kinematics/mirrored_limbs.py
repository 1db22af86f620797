# SPDX-License-Identifier: GPL-3.0-or-later
"""Limbs mirrored in depth: the other pose that looks almost the same in the image.

A bone b from one joint to the next, seen along the line of sight v through its end, keeps its
length and nearly its image if its depth changes sign:

    b' = b - 2 (b · v) v,   v = (p_end - c) / |p_end - c|,   c the camera's center
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...solver.rotations import shortest_turn
from ..arrays import Float64Array, FloatArray, IndexArray, unit_vectors
from .sequences import runs

LIMBS = (
    ("left_shoulder", "left_elbow", "left_wrist"),
    ("right_shoulder", "right_elbow", "right_wrist"),
    ("left_hip", "left_knee", "left_ankle"),
    ("right_hip", "right_knee", "right_ankle"),
)
OTHER_SIDE = {"left": "right", "right": "left"}


def other_side(name: str) -> str:
    """Return the name of the same joint or part of the other side; the name itself without side."""
    side, joined, kind = name.partition("_")
    return f"{OTHER_SIDE.get(side, side)}{joined}{kind}"


def bone_depths(
    starts: FloatArray,
    ends: FloatArray,
    center: FloatArray,
) -> Float64Array:
    """Calculate b · v (T,), positive where a bone points away from the camera; metres.

    :param starts: (T, 3) one joint, in any axes, metres.
    :param ends: (T, 3) the next one.
    :param center: (T, 3) the camera.
    """
    return ((ends - starts) * unit_vectors(ends - center)).sum(axis=1)


def runs_of_one_sign(depths: FloatArray, shallow: float, deep: float) -> list[slice]:
    """Return the runs of frames in which |depth| (T,) exceeds ``shallow`` on one side, and
    somewhere ``deep``.
    """
    found = (slice(*run) for run in sorted(runs(depths > shallow) + runs(depths < -shallow)))
    return [run for run in found if np.abs(depths[run]).max() > deep]


def mirrored_limb(
    parents: Sequence[int] | IndexArray,
    R_part: FloatArray,
    joints: FloatArray,
    center: FloatArray,
    limb: tuple[int, int, int],
    upper: bool,
    lower: bool,
) -> Float64Array:
    """Mirror one or both bones of a limb, each by the shortest turn; a bone that is not mirrored
    keeps its direction.

    :param parents: (K+1,) the body's tree.
    :param R_part: (T, K+1, 3, 3) rotations of the parts, in any axes.
    :param joints: (T, K+1, 3) the joints, in the same axes, metres.
    :param center: (T, 3) the camera, in the same axes, metres.
    :param limb: the joints at the start of both bones and at the limb's end.
    :param upper: whether to mirror the first bone.
    :param lower: whether to mirror the second one.
    :return: (T, 2, 3, 3) Ω of the parts of both bones.
    """
    first, second, end = limb
    R_first = R_part[:, first]
    R_second = R_part[:, second]
    if upper:
        R_first = _mirrored(R_first, joints[:, first], joints[:, second], center)
    if lower:
        R_second = _mirrored(R_second, joints[:, second], joints[:, end], center)
    R_parent = R_part[:, parents[first]]
    return np.stack(
        [np.swapaxes(R_parent, 1, 2) @ R_first, np.swapaxes(R_first, 1, 2) @ R_second], axis=1
    )


def _mirrored(
    R: FloatArray,
    starts: FloatArray,
    ends: FloatArray,
    center: FloatArray,
) -> FloatArray:
    bone = ends - starts
    sight = unit_vectors(ends - center)
    other = bone - 2.0 * (bone * sight).sum(axis=1, keepdims=True) * sight
    return shortest_turn(bone, other) @ R
