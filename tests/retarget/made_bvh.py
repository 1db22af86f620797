# SPDX-License-Identifier: GPL-3.0-or-later
"""BVH files with the motion of a walk, by the definition of the format, in the ways of other tools;
and whether an imported motion is that walk.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL
from scope.scope_addon.motion import Motion
from scope.scope_addon.retarget.import_motions import Imported, import_motions
from scope.solver.rotations import exp

from ..edit.walking import BETAS, BODY, NAMES, walk

PARENTS = [int(parent) for parent in BODY.parents]
AT_REST = BODY.rest_joints(BETAS)  # y up, facing +z
FRAMES = 24
TOLERANCE_M = 1e-3
# In SMPL's order, None where a tool has no joint.
CMU = "Hips LeftUpLeg RightUpLeg LowerBack LeftLeg RightLeg Spine LeftFoot RightFoot Spine1"
CMU += " LeftToeBase RightToeBase Neck LeftShoulder RightShoulder Head LeftArm RightArm"
CMU += " LeftForeArm RightForeArm LeftHand RightHand LThumb RThumb"
MIXAMO = CMU.replace("Spine1", "Spine2").replace("Spine ", "Spine1 ").replace("LowerBack", "Spine")
XSENS = "Hips LeftHip RightHip Chest LeftKnee RightKnee Chest2 LeftAnkle RightAnkle Chest4 LeftToe"
XSENS += " RightToe Neck LeftCollar RightCollar Head LeftShoulder RightShoulder LeftElbow"
XSENS += " RightElbow LeftWrist RightWrist LeftFingerTip RightFingerTip"
PLAIN = "hips left_hip right_hip spine left_knee right_knee chest left_ankle right_ankle upperchest"
PLAIN += " left_toe right_toe neck left_clavicle right_clavicle head left_shoulder right_shoulder"
PLAIN += " left_elbow right_elbow left_wrist right_wrist left_finger right_finger"
TOOLS = {
    "cmu": CMU.split(),
    "mixamo": [f"mixamorig:{name}" for name in MIXAMO.split()],
    "mixamo without prefix": MIXAMO.split(),
    "neuron": [f"Robot_{name}" for name in MIXAMO.split()],
    "xsens": XSENS.split(),
    "mediapipe": PLAIN.split(),
    "with spaces": [name.replace("_", " ") for name in NAMES],
    "nameless": [f"joint{k}" for k in range(len(NAMES))],
}


def motion() -> tuple[np.ndarray, np.ndarray]:
    """World rotations D (T, K+1, 3, 3) from the T-pose, y up, and joints (T, K+1, 3), metres."""
    clip = walk(0.8, bent=0.1)
    lean = np.random.default_rng(0).normal(0.0, 0.2, (FRAMES, len(NAMES), 3))
    lean[0] = 0.0
    smooth = np.cumsum(lean, axis=0) / np.sqrt(np.arange(1, FRAMES + 1))[:, None, None]
    rotations = clip.rotations[:FRAMES] @ exp(smooth)
    rotations[0, 1:] = np.eye(3)
    root = clip.root[:FRAMES] - BODY.rest_joints(BETAS)[0]
    R, joints = BODY.forward_kinematics(rotations, root, BETAS)
    return R_WORLD_MODEL.T @ R, joints @ R_WORLD_MODEL


D, JOINTS = motion()


def euler(R: np.ndarray, order: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles of R = R_i(a) R_j(b) R_k(c), (T, 3, 3), about the axes of an order such as ZXY."""
    i, j, k = ("XYZ".index(axis) for axis in order)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    a = np.arctan2(-sign * R[:, j, k], R[:, k, k])
    b = np.arcsin(np.clip(sign * R[:, i, k], -1.0, 1.0))
    c = np.arctan2(-sign * R[:, i, j], R[:, i, i])
    return a, b, c


def bvh(
    names: list[str],
    rest: np.ndarray | None = None,
    *,
    order: str = "ZXY",
    R_file: np.ndarray | None = None,
    unit: float = 100.0,
) -> str:
    """The motion as a BVH file.

    :param rest: (K+1, 3, 3) rotations from the T-pose to the rest pose of the file.
    :param order: of the channels, whose rotations are multiplied in that order.
    :param R_file: to the file's axes from y up.
    :param unit: of the file in a metre.
    """
    R = np.eye(3) if R_file is None else R_file
    S = R @ (np.tile(np.eye(3), (len(NAMES), 1, 1)) if rest is None else rest)
    Q = R @ D @ np.swapaxes(S, -1, -2)
    places = unit * JOINTS @ R.T
    lines = ["HIERARCHY"]
    columns: list[np.ndarray] = []

    def add(joint: int) -> None:
        parent = PARENTS[joint]
        children = [k for k, above in enumerate(PARENTS) if above == joint]
        offset = unit * (AT_REST[joint] - AT_REST[parent])
        local = Q[:, joint]
        if parent >= 0:
            offset = S[parent] @ offset
            local = np.swapaxes(Q[:, parent], -1, -2) @ local
        else:
            offset = np.zeros(3)
        is_root = parent < 0
        lines.append(f"{'ROOT' if is_root else 'JOINT'} {names[joint]}")
        lines.append("{")
        lines.append("OFFSET " + " ".join(f"{value:.6f}" for value in offset))
        position = "Xposition Yposition Zposition " if is_root else ""
        rotation = " ".join(f"{axis}rotation" for axis in order)
        lines.append(f"CHANNELS {6 if is_root else 3} {position}{rotation}")
        columns.extend(places[:, 0].T if is_root else [])
        columns.extend(np.degrees(euler(local, order)))
        for child in children:
            add(child)
        if not children:
            end = S[joint] @ (unit * 0.4 * (AT_REST[joint] - AT_REST[parent]))
            lines.append(f"End Site\n{{\nOFFSET {end[0]:.6f} {end[1]:.6f} {end[2]:.6f}\n}}")
        lines.append("}")

    add(0)
    lines += ["MOTION", f"Frames: {FRAMES}", "Frame Time: 0.033333"]
    lines += [" ".join(f"{value:.5f}" for value in row) for row in np.array(columns).T]
    return "\n".join(lines) + "\n"


def imported(tmp_path: Path, text: str, **arguments: Any) -> Imported:
    path = tmp_path / "walk.bvh"
    path.write_text(text)
    (found,) = import_motions(path, **arguments)
    return found


def joints_of(found: Imported) -> np.ndarray:
    motion: Motion = found.motion
    rotations = exp(motion.poses.reshape(len(motion), -1, 3).astype(float))
    return found.body.forward_kinematics(rotations, motion.trans, motion.betas)[1]


def assert_is_the_motion(found: Imported) -> None:
    """Check the joints' places up to where the person begins and how they are turned at first."""
    shared = [name for name in NAMES if name in found.body.joint_names]
    joints = joints_of(found)[:, [found.body.joint_names.index(name) for name in shared]]
    wanted = JOINTS[:, [NAMES.index(name) for name in shared]] @ R_WORLD_MODEL.T
    # Files with another horizontal axis are turned about the vertical.
    across = [points[0, 1] - points[0, 2] for points in (joints, wanted)]
    angles = [np.arctan2(each[1], each[0]) for each in across]
    joints = joints @ exp(np.array([0.0, 0.0, angles[1] - angles[0]])).T
    difference = joints - wanted
    difference -= difference[0, 0]
    assert np.abs(difference).max() < TOLERANCE_M
    assert len(shared) >= 22
    assert found.motion.mocap_framerate == pytest.approx(30.0)
