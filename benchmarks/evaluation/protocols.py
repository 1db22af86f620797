# SPDX-License-Identifier: GPL-3.0-or-later
"""Protocols: which joints are compared, to which point they are relative, and which measures are
taken.
"""

from __future__ import annotations

from dataclasses import dataclass

from .joint_sets import LIMBS, LSP14, PCK_3DHP, SMPL22, SMPL24, TEST_3DHP

HIPS = ("left_hip", "right_hip")
PELVIS = ("pelvis",)

# Key of a figure -> heading, with the unit.
MEASURES = {
    "mpjpe": "MPJPE mm",
    "pa_mpjpe": "PA-MPJPE mm",
    "mpvpe": "MPVPE mm",
    "pck": "PCK@150 %",
    "auc": "AUC %",
    "pa_pck": "PCK@150 aligned %",
    "pa_auc": "AUC aligned %",
    "pck_50": "PCK@50 %",
    "auc_200": "AUC to 199 mm %",
    "acceleration": "acceleration error m/s²",
    "wa_mpjpe": "WA-MPJPE mm",
    "w_mpjpe": "W-MPJPE mm",
    "rte": "RTE %",
    "jitter": "jitter 10 m/s³",
    "foot_slide": "foot sliding mm",
}
IN_CAMERA = ("mpjpe", "pa_mpjpe", "mpvpe", "acceleration")
IN_WORLD = ("wa_mpjpe", "w_mpjpe", "rte", "jitter", "foot_slide")


@dataclass(frozen=True)
class Protocol:
    """One protocol: ``joints`` that are compared, ``root`` to whose mean they are relative,
    ``measures`` by key.

    ``pck_joints`` are those of PCK and AUC; ``follows`` names whose evaluation it repeats.
    """

    title: str
    joints: tuple[str, ...]
    root: tuple[str, ...]
    measures: tuple[str, ...]
    follows: str
    pck_joints: tuple[str, ...] = ()


PROTOCOLS = {
    "h36m-p1": Protocol(
        "Human3.6M, protocol 1: S9 and S11, four cameras, every fifth frame",
        LSP14,
        PELVIS,
        ("mpjpe", "pa_mpjpe"),
        "HMR and SPIN (eval.py, h36m-p1): 14 joints relative to the pelvis",
    ),
    "h36m-p2": Protocol(
        "Human3.6M, protocol 2: S9 and S11, the frontal camera 60457274, every fifth frame",
        LSP14,
        PELVIS,
        ("mpjpe", "pa_mpjpe"),
        "HMR and SPIN (eval.py, h36m-p2): as protocol 1; PA-MPJPE is its figure",
    ),
    "3dhp": Protocol(
        "MPI-INF-3DHP, test set: TS1 to TS6, valid frames",
        TEST_3DHP,
        PELVIS,
        ("pck", "auc", "mpjpe", "pa_pck", "pa_auc", "pa_mpjpe"),
        "the data set's mpii_evaluate_errors.m: 17 joints relative to the pelvis, PCK and AUC of "
        "the first 14; aligned: after the best similarity of the 17",
        PCK_3DHP,
    ),
    "3dpw-mesh": Protocol(
        "3DPW, test split: 14 joints regressed from SMPL's mesh",
        LSP14,
        HIPS,
        IN_CAMERA,
        "WHAM and GVHMR: relative to the middle between the hips",
    ),
    "3dpw": Protocol(
        "3DPW, test split: the 24 joints of SMPL's skeleton",
        SMPL24,
        PELVIS,
        ("mpjpe", "pa_mpjpe", "pck_50", "auc_200", "acceleration"),
        "3DPW's own challenge, which adds the other splits: relative to the pelvis, PCK and AUC of "
        "the 12 limb joints, "
        "frames with a 2D pose; the joints of most publications need --smpl and --regressor",
        LIMBS,
    ),
    "emdb1": Protocol(
        "EMDB 1, in the camera: 24 joints",
        SMPL24,
        HIPS,
        IN_CAMERA,
        "WHAM and GVHMR: relative to the middle of the hips",
    ),
    "emdb2": Protocol(
        "EMDB 2, in the world: 24 joints",
        SMPL24,
        HIPS,
        IN_WORLD,
        "WHAM and GVHMR: segments of 100 frames",
    ),
    "rich": Protocol(
        "RICH, test split, one person: 22 joints",
        SMPL22,
        HIPS,
        (*IN_CAMERA, *IN_WORLD),
        "WHAM and GVHMR, but for the two hand joints that SMPL-X lacks, and without conversion to "
        "SMPL's mesh",
    ),
    "bedlam": Protocol(
        "BEDLAM, validation split: 22 joints",
        SMPL22,
        PELVIS,
        ("mpjpe", "pa_mpjpe", "mpvpe", "acceleration"),
        "no publication: the usual measures on the split that BEDLAM calls validation",
    ),
}
