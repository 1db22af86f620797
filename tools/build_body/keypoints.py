# SPDX-License-Identifier: GPL-3.0-or-later
"""The keypoints of the 2D detectors, as points rigidly attached to body parts (Assumption 1 of the
paper).

Three sets: BlazePose-33, COCO-17 with six feet points, and 21 points per hand in MediaPipe's order.
A keypoint is a joint, the mean of some surface vertices, or a joint cube inside the mesh; its place
is linear in the shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...solver.names import BLAZEPOSE, COCO
from .joints import Skeleton, cube_row, other_side
from .source import SourceMesh

# MakeHuman's fingers 1 to 5
HAND_FINGERS = ("thumb", "index_finger", "middle_finger", "ring_finger", "pinky")
THUMB_POINTS = ("cmc", "mcp", "ip", "tip")
FINGER_POINTS = ("mcp", "pip", "dip", "tip")

BIG_TOE = (11551, 12756, 11560, 11569)
FOOT_INDEX_MORE = (13133, 11628, 11624, 13084)
# The left side of the surface keypoints: base mesh vertices and the part they lie on. The right
# side is the mirror.
SURFACE: dict[str, tuple[tuple[int, ...], str]] = {
    "nose": ((5054,), "head"),
    "left_eye_inner": ((11511,), "head"),
    "left_eye_outer": ((6937,), "head"),
    "left_eye": ((14607, 14598, 14616, 14661, 14625, 14652, 14634, 14643, 14608), "head"),
    "left_ear": ((12318, 12199, 12169), "head"),
    "mouth_left": ((11941, 11942), "head"),
    "left_heel": ((12442, 12912, 12815, 12911), "left_ankle"),
    "left_big_toe": (BIG_TOE, "left_foot"),
    "left_small_toe": ((13280, 13285, 13178, 13177), "left_foot"),
    "left_foot_index": (BIG_TOE + FOOT_INDEX_MORE, "left_foot"),
}
CUBE_POINTS = {"left_index": "finger-2-1", "left_pinky": "finger-5-1", "left_thumb": "finger-1-3"}


@dataclass(frozen=True)
class Keypoint:
    """One keypoint: the regressor (N,) of its position in the source pose, and the part to which it
    belongs.
    """

    name: str
    regressor: NDArray[np.float64]
    part: int


def make_keypoints(source: SourceMesh, skeleton: Skeleton) -> list[Keypoint]:
    """Return all keypoints of the three sets, in file order, names with the set's prefix."""
    named = [(f"blazepose/{name}", *_body_point(source, skeleton, name)) for name in BLAZEPOSE]
    named += [(f"coco/{name}", *_body_point(source, skeleton, name)) for name in COCO]
    for side in ("left", "right"):
        named += [(f"hand/{name}", row, part) for name, row, part in _hand(source, skeleton, side)]
    return [Keypoint(*each) for each in named]


def pose_keypoints(
    keypoints: list[Keypoint],
    R: NDArray[np.float64],
    J: NDArray[np.float64],
    posed_J: NDArray[np.float64],
    basis: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return T-posed keypoints (B, M, 3), k' = R_i (k − J_i) + J'_i, of source vertex sets
    ``basis`` (B, N, 3).
    """
    part = np.array([keypoint.part for keypoint in keypoints])
    points = np.stack([keypoint.regressor for keypoint in keypoints]) @ basis
    return np.einsum("mxy,bmy->bmx", R[part], points - J[:, part]) + posed_J[:, part]


def _body_point(
    source: SourceMesh, skeleton: Skeleton, name: str
) -> tuple[NDArray[np.float64], int]:
    # shoulder, elbow, wrist, hip, knee and ankle are the joints themselves
    if name in skeleton.joint_names:
        index = skeleton.index(name)
        return skeleton.regressor[index], index
    left = other_side(name) if "right" in name else name
    mirrored = left != name
    if left in CUBE_POINTS:
        wrist = skeleton.index("right_wrist" if mirrored else "left_wrist")
        return cube_row(source, ("r-" if mirrored else "l-") + CUBE_POINTS[left]), wrist
    vertices, part = SURFACE[left]
    indices = np.array(vertices)
    if mirrored:
        indices = source.mirror[indices]
        part = other_side(part)
    row = np.zeros(len(source.vertices))
    row[indices] = 1.0 / len(indices)
    if left == "nose":
        row = 0.5 * (row + row[source.mirror])  # on the midline exactly
    return row, skeleton.index(part)


def _hand(
    source: SourceMesh, skeleton: Skeleton, side: str
) -> list[tuple[str, NDArray[np.float64], int]]:
    wrist = skeleton.index(f"{side}_wrist")
    points = [(f"{side}_wrist", skeleton.regressor[wrist], wrist)]
    for k, finger in enumerate(HAND_FINGERS, start=1):
        for i, label in enumerate(THUMB_POINTS if k == 1 else FINGER_POINTS, start=1):
            if f"{side}_hand" in skeleton.joint_names:
                part = f"{side}_wrist" if k == 1 else f"{side}_hand"
            else:
                part = f"{side}_{finger.removesuffix('_finger')}{min(i, 3)}"
            row = cube_row(source, f"{side[0]}-finger-{k}-{i}")
            points.append((f"{side}_{finger}_{label}", row, skeleton.index(part)))
    return points
