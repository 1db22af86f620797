# SPDX-License-Identifier: GPL-3.0-or-later
"""The joints that protocols compare, by name, and where each of them is on a body.

A body has SMPL's joints. Two points that motion-capture skeletons have besides are placed on it:
``head_top``, the highest vertex at rest, rigid on the head; and ``spine``, SMPL's spine2, which
lies midway between pelvis and neck. ``head`` of MPI-INF-3DHP, a third of the way from its neck to
its top of the head, is compared with SMPL's head joint.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ...solver.smpl_family import SKELETONS

SMPL24 = SKELETONS[24].joint_names
SMPL22 = SMPL24[:22]  # those that SMPL-X has as well
LIMBS = tuple(
    f"{side}_{part}" for side in ("right", "left") for part in ("shoulder", "elbow", "wrist")
)
LIMBS += tuple(f"{side}_{part}" for side in ("right", "left") for part in ("hip", "knee", "ankle"))

# The 14 joints of Leeds Sports Pose, in the order of HMR's and SPIN's evaluation.
LSP14 = (
    *("right_ankle", "right_knee", "right_hip", "left_hip", "left_knee", "left_ankle"),
    *("right_wrist", "right_elbow", "right_shoulder", "left_shoulder", "left_elbow", "left_wrist"),
    *("neck", "head_top"),
)
# The rows of J_regressor_h36m.npy, which HMR and its successors use for SMPL's mesh.
REGRESSED17 = (
    *("pelvis", "left_hip", "left_knee", "left_ankle", "right_hip", "right_knee", "right_ankle"),
    *("spine", "neck", "head", "head_top"),
    *("left_shoulder", "left_elbow", "left_wrist", "right_shoulder", "right_elbow", "right_wrist"),
)
# Human3.6M's 32 joints: those that are used; 24 is a copy of 13, the joint between the shoulders.
H36M32 = {
    **{
        "pelvis": 11,
        "right_hip": 1,
        "right_knee": 2,
        "right_ankle": 3,
        "left_hip": 6,
        "left_knee": 7,
        "left_ankle": 8,
    },
    **{
        "spine": 12,
        "neck": 24,
        "head": 14,
        "head_top": 15,
        "left_shoulder": 17,
        "left_elbow": 18,
        "left_wrist": 19,
    },
    **{"right_shoulder": 25, "right_elbow": 26, "right_wrist": 27},
}
# The 17 joints of MPI-INF-3DHP's test set; the first 14 are those of its PCK.
TEST_3DHP = (
    *("head_top", "neck", "right_shoulder", "right_elbow", "right_wrist"),
    *("left_shoulder", "left_elbow", "left_wrist", "right_hip", "right_knee", "right_ankle"),
    *("left_hip", "left_knee", "left_ankle", "pelvis", "spine", "head"),
)
PCK_3DHP = TEST_3DHP[:14]

_OTHER_NAMES = {"spine": "spine2"}
_HEAD = "head"


def on_body(
    body: Body, names: tuple[str, ...], betas: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return where joints are on a body: part (J,) and position (J, 3) relative to the part's joint
    at rest, metres.

    :param betas: (P,) shape of the body.
    :raises KeyError: the body has no such joint.
    """
    rest = body.rest_joints(betas)
    at = {name: k for k, name in enumerate(body.joint_names)}
    parts = np.zeros(len(names), np.intp)
    offsets = np.zeros((len(names), 3))
    for i, name in enumerate(names):
        if name == "head_top":
            vertices = body.rest_vertices(betas)
            parts[i] = at[_HEAD]
            offsets[i] = vertices[vertices[:, 1].argmax()] - rest[at[_HEAD]]
        else:
            parts[i] = at[_OTHER_NAMES.get(name, name)]
    return parts, offsets
