# SPDX-License-Identifier: GPL-3.0-or-later
"""Joint angles over time, under the names of the coordinates of OpenSim's full-body model
(Rajagopal 2015): motion files (.mot) of OpenSim, and tables (.csv).

Each segment has axes that, where a person stands with arms hanging and palms at the thighs, are
x forward, y up, z to the right. With the segments' rotations R_1 and R_2 in the world, the angles
of the joint between them are those of

    R_1ᵀ R_2 = R_z(a) R_x(b) R_y(c),

so that a is flexion, b is adduction, and c is rotation. Free of bpy.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...atomic_write import write_result
from ...kinematics.axes import R_OPENSIM_MODEL, R_OPENSIM_WORLD
from ...motion import Motion
from .one_rate import at_one_rate

if TYPE_CHECKING:
    from ....solver.body import Body

_SIDES = {"r": "right", "l": "left"}
_PALM_AT_THIGH_DEG = 90.0  # of pronation, of which a palm that faces forward has none


def write_angles(path: Path, motion: Motion, body: Body) -> None:
    """Write the joint angles of a motion, as a .csv file or, with another suffix, as a .mot file.

    :param body: that the motion was fitted with.
    :raises OutputError: the file cannot be written.
    """
    angles = joint_angles(motion, body)
    times_s, rows = at_one_rate(motion, list(angles.values()))
    names = ["time", *angles]
    separator = "," if path.suffix.lower() == ".csv" else "\t"
    lines = [separator.join(names)]
    for time_s, row in zip(times_s, rows.tolist(), strict=True):
        lines.append(separator.join([f"{time_s:.6f}", *(f"{value:.6f}" for value in row)]))
    if separator == "\t":
        lines[:0] = [
            path.stem,
            "version=1",
            f"nRows={len(times_s)}",
            f"nColumns={len(names)}",
            "inDegrees=yes",
            "endheader",
        ]
    write_result(path, "\n".join(lines) + "\n")


def joint_angles(motion: Motion, body: Body) -> dict[str, NDArray[np.float64]]:
    """Return the angles (T,) of each joint, degrees without jumps by whole turns, and the place of
    the pelvis, metres, by OpenSim's names.
    """
    from ....solver import rotations  # Loads numba, and the command line starts without it.

    R_local = rotations.exp(np.asarray(motion.poses, float).reshape(len(motion), -1, 3))
    betas = np.asarray(motion.betas, float)
    R_world_part, joints = body.forward_kinematics(R_local, np.asarray(motion.trans, float), betas)
    R_opensim_part = R_OPENSIM_WORLD @ R_world_part @ R_OPENSIM_MODEL.T
    segments = {name: R_opensim_part[:, k] for k, name in enumerate(body.joint_names)}
    pelvis = segments["pelvis"]
    trunk = segments["spine3"]
    tilt, listing, heading = _angles(pelvis)
    place = joints[:, 0] @ R_OPENSIM_WORLD.T
    found = {"pelvis_tilt": tilt, "pelvis_list": listing, "pelvis_rotation": heading}
    found |= {f"pelvis_t{axis}": place[:, k] for k, axis in enumerate("xyz")}
    for short in _SIDES:
        found |= _leg_angles(segments, short)
    extension, bending, turn = _between(pelvis, trunk)
    found |= {"lumbar_extension": extension, "lumbar_bending": bending, "lumbar_rotation": turn}
    for short in _SIDES:
        found |= _arm_angles(segments, short)
    return found


def _leg_angles(
    segments: dict[str, NDArray[np.float64]], short: str
) -> dict[str, NDArray[np.float64]]:
    """Return the angles of a leg; adduction, inversion and inward rotation are positive."""
    side = _SIDES[short]
    inwards = 1.0 if short == "r" else -1.0
    thigh, shin, foot, toes = (
        segments[f"{side}_{part}"] for part in ("hip", "knee", "ankle", "foot")
    )
    flexion, adduction, rotation = _between(segments["pelvis"], thigh)
    dorsiflexion, inversion, _ = _between(shin, foot)
    return {
        f"hip_flexion_{short}": flexion,
        f"hip_adduction_{short}": inwards * adduction,
        f"hip_rotation_{short}": inwards * rotation,
        f"knee_angle_{short}": -_between(thigh, shin)[0],
        f"ankle_angle_{short}": dorsiflexion,
        f"subtalar_angle_{short}": inwards * inversion,
        f"mtp_angle_{short}": _between(foot, toes)[0],
    }


def _arm_angles(
    segments: dict[str, NDArray[np.float64]], short: str
) -> dict[str, NDArray[np.float64]]:
    """Return the angles of an arm; adduction, inward rotation, pronation, flexion of the wrist and
    its deviation to the little finger are positive.
    """
    side = _SIDES[short]
    inwards = 1.0 if short == "r" else -1.0
    # From the rest pose, in which arms are spread, to arms that hang.
    R_hanging_spread = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -inwards], [0.0, inwards, 0.0]])
    upper, forearm, hand = (
        segments[f"{side}_{part}"] @ R_hanging_spread.T for part in ("shoulder", "elbow", "wrist")
    )
    flexion, adduction, rotation = _between(segments["spine3"], upper)
    elbow, _, twist = _between(upper, forearm)
    backwards, wrist_flexion, twist_of_wrist = _between(forearm, hand)
    return {
        f"arm_flex_{short}": flexion,
        f"arm_add_{short}": inwards * adduction,
        f"arm_rot_{short}": inwards * rotation,
        f"elbow_flex_{short}": elbow,
        f"pro_sup_{short}": _PALM_AT_THIGH_DEG + inwards * (twist + twist_of_wrist),
        f"wrist_flex_{short}": inwards * wrist_flexion,
        f"wrist_dev_{short}": -backwards,
    }


def _between(
    R_first: NDArray[np.float64], R_second: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the angles of the joint between two segments, see `_angles`."""
    return _angles(np.swapaxes(R_first, -1, -2) @ R_second)


def _angles(
    R: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return a, b and c of R = R_z(a) R_x(b) R_y(c), (T, 3, 3), in degrees without jumps by whole
    turns.
    """
    about_z = np.arctan2(-R[:, 0, 1], R[:, 1, 1])
    about_x = np.arcsin(np.clip(R[:, 2, 1], -1.0, 1.0))
    about_y = np.arctan2(-R[:, 2, 0], R[:, 2, 2])
    return (
        np.degrees(np.unwrap(about_z)),
        np.degrees(about_x),
        np.degrees(np.unwrap(about_y)),
    )
