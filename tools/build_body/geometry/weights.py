# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin weights: MakeHuman's bones merged onto the joints, mirrored, diffused where they crease,
four per vertex.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..joints import FINGERS, Skeleton
from ..source import SourceMesh
from .diffusion import bump, diffuse, perineum
from .mesh import Mesh, edges

INFLUENCES = 4
# Where linear blend skinning lumps or creases: centre, radius in metres, and how often weights are
# averaged there.
DIFFUSION = (("perineum", 0.11, 40), ("left_shoulder", 0.11, 8), ("right_shoulder", 0.11, 8))
MIDDLE_BONES = {
    "root": "pelvis", "spine05": "pelvis", "spine04": "pelvis", "spine03": "spine1",
    "spine02": "spine2",
    "spine01": "spine3", "neck01": "neck", "neck02": "neck", "neck03": "neck",
}  # fmt: skip
SIDE_BONES = {  # bone without .L / .R -> joint without left_ / right_
    "upperleg01": "hip", "upperleg02": "hip", "lowerleg01": "knee", "lowerleg02": "knee",
    "foot": "ankle",
    "clavicle": "collar", "shoulder01": "collar", "upperarm01": "shoulder",
    "upperarm02": "shoulder",
    "lowerarm01": "elbow", "lowerarm02": "elbow", "wrist": "wrist", "metacarpal1": "wrist",
    "metacarpal2": "wrist",
    "metacarpal3": "wrist", "metacarpal4": "wrist",
}  # fmt: skip


def skin_weights(
    source: SourceMesh, mesh: Mesh, skeleton: Skeleton, mean_shape: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (V, K+1) weights, rows summing to one, at most four of them above zero, symmetric.

    :param mean_shape: (N, 3) all source vertices of the mean shape, in the source pose.
    """
    W = np.zeros((len(source.vertices), len(skeleton.joint_names)))
    for bone, (indices, weights) in source.bone_weights.items():
        np.add.at(W[:, skeleton.index(_joint_of_bone(bone, skeleton))], indices, weights)
    W = W[mesh.kept]
    W = 0.5 * (W + W[mesh.mirror][:, skeleton.mirror])
    W /= W.sum(axis=1, keepdims=True)
    joints = skeleton.regressor @ mean_shape
    links = edges(mesh.faces)
    vertices = mean_shape[mesh.kept]
    for place, radius, rounds in DIFFUSION:
        centre = (
            perineum(mesh.mirror, vertices)
            if place == "perineum"
            else joints[skeleton.index(place)]
        )
        W = diffuse(links, W, bump(vertices, centre, radius), rounds)
    return keep_strongest(W)


def keep_strongest(W: NDArray[np.float64]) -> NDArray[np.float64]:
    """Keep the four largest weights of each row, normalized, without those equal to the fifth, for
    symmetry.
    """
    fifth = np.sort(W, axis=1)[:, -INFLUENCES - 1][:, None]
    W = np.where(W > fifth + 1e-9, W, 0.0)
    W[W < 1e-3] = 0.0
    return W / W.sum(axis=1, keepdims=True)


def pack(W: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return (V, 4) joint indices and (V, 4) weights, the strongest first; unused slots are joint 0
    with weight 0.
    """
    joints = np.argsort(-W, axis=1, kind="stable")[:, :INFLUENCES]
    weights = np.take_along_axis(W, joints, axis=1)
    return np.where(weights > 0.0, joints, 0), weights


def _joint_of_bone(bone: str, skeleton: Skeleton) -> str:
    if bone in MIDDLE_BONES:
        return MIDDLE_BONES[bone]
    stem, _, letter = bone.rpartition(".")
    if stem in ("pelvis", "breast"):
        return {"pelvis": "pelvis", "breast": "spine2"}[stem]
    side = {"L": "left_", "R": "right_"}.get(letter, "")
    if stem.startswith("toe"):
        return side + "foot"
    if stem.startswith("finger"):
        number, segment = stem[len("finger") :].split("-")
        if "left_hand" in skeleton.joint_names:
            return side + ("wrist" if number == "1" else "hand")
        return side + next(name for name, k in FINGERS.items() if k == int(number)) + segment
    return side + SIDE_BONES[stem] if stem in SIDE_BONES else "head"
