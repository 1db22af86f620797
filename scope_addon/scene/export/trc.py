# SPDX-License-Identifier: GPL-3.0-or-later
"""Track row column files (.trc) of Motion Analysis, which OpenSim and Pose2Sim read: markers over
time, in metres, with OpenSim's axes.

Markers are joint centres of the body, and points on its surface, under the names that Pose2Sim has
for them. Free of bpy.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...atomic_write import write_result
from ...kinematics.axes import R_OPENSIM_WORLD
from ...motion import Motion
from .one_rate import at_one_rate

if TYPE_CHECKING:
    from ....solver.body import Body

# Pose2Sim's names of joints, without their side, and ours.
_JOINTS = {
    "Hip": "hip",
    "Knee": "knee",
    "Ankle": "ankle",
    "Shoulder": "shoulder",
    "Elbow": "elbow",
    "Wrist": "wrist",
}
# Likewise of keypoints on the surface.
_KEYPOINTS = {"BigToe": "foot_index", "Heel": "heel", "Eye": "eye", "Ear": "ear"}
_SIDES = {"R": "right", "L": "left"}


def write_trc(path: Path, motion: Motion, body: Body) -> None:
    """Write the markers of a motion.

    :param body: that the motion was fitted with.
    :raises OutputError: the file cannot be written.
    """
    write_result(path, trc_text(path.name, motion, body))


def trc_text(name: str, motion: Motion, body: Body) -> str:
    """Return the content of the file.

    :param name: of the file, which stands in it.
    """
    names, markers = world_markers(motion, body)
    rate = motion.mocap_framerate
    columns = (markers @ R_OPENSIM_WORLD.T).reshape(len(motion), -1).T
    times_s, rows = at_one_rate(motion, list(columns))
    count = len(times_s)
    numbers = range(1, len(names) + 1)
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\t"
        "OrigNumFrames",
        f"{rate:g}\t{rate:g}\t{count}\t{len(names)}\tm\t{rate:g}\t1\t{count}",
        "Frame#\tTime\t" + "".join(f"{each}\t\t\t" for each in names).rstrip("\t"),
        "\t\t" + "\t".join(f"X{k}\tY{k}\tZ{k}" for k in numbers),
        "",
    ]
    for number, (time_s, row) in enumerate(zip(times_s, rows.tolist(), strict=True), 1):
        lines.append(f"{number}\t{time_s:.6f}\t" + "\t".join(f"{value:.6f}" for value in row))
    return "\n".join(lines) + "\n"


def world_markers(motion: Motion, body: Body) -> tuple[list[str], NDArray[np.float64]]:
    """Return the names of the M markers, and where they are (T, M, 3), world, metres."""
    from ....solver import rotations  # Loads numba, and the command line starts without it.

    betas = np.asarray(motion.betas, float)
    R = rotations.exp(np.asarray(motion.poses, float).reshape(len(motion), -1, 3))
    R_parts, joints = body.forward_kinematics(R, np.asarray(motion.trans, float), betas)
    keypoints = body.keypoint_set("blazepose")
    of_joints = {
        f"{short}{ours}": f"{side}_{name}"
        for short, side in _SIDES.items()
        for ours, name in _JOINTS.items()
    }
    of_keypoints = {
        f"{short}{ours}": f"{side}_{name}"
        for short, side in _SIDES.items()
        for ours, name in _KEYPOINTS.items()
    }
    of_keypoints["Nose"] = "nose"
    at = [body.joint_names.index(name) for name in of_joints.values()]
    which = [keypoints[name] for name in of_keypoints.values()]
    on_surface = body.keypoints(R_parts, joints, betas, which)
    hips = [body.joint_names.index(f"{side}_hip") for side in _SIDES.values()]
    between = joints[:, hips].mean(axis=1, keepdims=True)
    neck = joints[:, [body.joint_names.index("neck")]]
    names = ["Hip", "Neck", *of_joints, *of_keypoints]
    markers: NDArray[np.float64] = np.concatenate(
        [between, neck, joints[:, at], on_surface], axis=1
    )
    return names, markers
