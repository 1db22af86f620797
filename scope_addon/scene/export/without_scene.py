# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing the files that follow from motions alone. Free of bpy.

Track row column files (.trc) of Motion Analysis, which OpenSim and Pose2Sim read, hold markers over
time, in metres, with OpenSim's axes. Markers are joint centres of the body, and points on its
surface, under the names that Pose2Sim has for them. Files of the C3D format (.c3d) hold the same
markers in millimetres, z up, with the deviations of their joints as residuals.

Motion files (.mot) of OpenSim, and tables (.csv), hold joint angles over time, under the names of
the coordinates of OpenSim's full-body model (Rajagopal 2015). Each segment has axes that, where a
person stands with arms hanging and palms at the thighs, are x forward, y up, z to the right. With
the segments' rotations R_1 and R_2 in the world, the angles of the joint between them are those of

    R_1ᵀ R_2 = R_z(a) R_x(b) R_y(c),

so that a is flexion, b is adduction, and c is rotation.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...arrays import BoolArray, Float64Array
from ...atomic_write import write_result
from ...footage import display_text
from ...kinematics.axes import R_OPENSIM_MODEL, R_OPENSIM_WORLD, transposed
from ...motion import Motion
from ...output_paths import person_paths
from ...scene_gaps import usual_step_s
from ..budget import check_rows
from .bvh import euler_zyx_degrees
from .c3d import c3d_bytes
from .vrma import vrma_bytes

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
_SIDE_OF = {"r": "right", "l": "left"}
# The distance from a frame, in parts of the usual one between two, up to which a moment is that
# frame's; and the time between two frames after which frames are missing there.
_ON_FRAME = 0.01
_GAP_S = 0.25
_PALM_AT_THIGH_DEG = 90.0  # of pronation, of which a palm that faces forward has none


def write_without_scene(
    path: Path, motions: Sequence[Motion], bodies: Sequence[Body]
) -> list[Path]:
    """Write motions in a format of `WITHOUT_SCENE`, one file for each person.

    :param bodies: that the motions were fitted with.
    :return: the files written.
    :raises OutputError: when a file cannot be written.
    """
    targets = person_paths(path, len(motions))
    suffix = path.suffix.lower()
    # of the first of them, so that files that count from their beginning are in step
    start_s = min((float(motion.timestamps[0]) for motion in motions), default=0.0)
    if suffix != ".npz":
        for motion in motions:
            check_rows(motion)
    for target, motion, body in zip(targets, motions, bodies, strict=True):
        if suffix == ".trc":
            write_result(target, trc_text(target.name, motion, body))
        elif suffix == ".c3d":
            write_c3d(target, motion, body, start_s)
        elif suffix == ".vrma":
            write_result(target, vrma_bytes(motion, body, start_s))
        elif suffix in (".mot", ".csv"):
            write_angles(target, motion, body)
        else:
            motion.save(target)
    return targets


def at_one_rate(
    motion: Motion, columns: Sequence[Float64Array]
) -> tuple[Float64Array, Float64Array]:
    """Return times (S,) at the motion's rate, seconds, and the columns' values there, (S, N).

    Values of a motion with a variable rate are interpolated linearly.

    :param columns: N values (T,) over the motion's frames.
    """
    rate = motion.mocap_framerate
    start_s = float(motion.timestamps[0])
    count = 1 + round(float(motion.timestamps[-1] - start_s) * rate)
    times_s = start_s + np.arange(count) / rate
    rows = np.array([np.interp(times_s, motion.timestamps, column) for column in columns]).T
    return times_s, rows


def _is_seen(motion: Motion, times_s: Float64Array) -> BoolArray:
    """Return (S,) whether the person was seen at times, not between a frame with the person and one
    without, nor where frames are missing.
    """
    seen = np.interp(times_s, motion.timestamps, motion.valid.astype(float))
    return (seen > 1.0 - 1e-6) & ~_in_gap(motion, times_s)


def _in_gap(motion: Motion, times_s: Float64Array) -> BoolArray:
    """Return (S,) whether frames are missing at times: those around are far apart."""
    own_s = motion.timestamps
    if len(own_s) < 2:
        return np.zeros(len(times_s), bool)
    usual_s = max(usual_step_s(own_s), 1.0 / motion.mocap_framerate)
    after = np.clip(np.searchsorted(own_s, times_s), 1, len(own_s) - 1)
    before_s = times_s - own_s[after - 1]
    after_s = own_s[after] - times_s
    between = np.minimum(before_s, after_s) > _ON_FRAME * usual_s
    is_long: BoolArray = before_s + after_s > max(_GAP_S, 1.5 * usual_s)
    return is_long & between


def trc_text(name: str, motion: Motion, body: Body) -> str:
    """Return the content of a .trc file with the markers of a motion.

    :param name: of the file, which stands in it.
    :param body: that the motion was fitted with.
    """
    names, markers, _ = world_markers(motion, body)
    rate = motion.mocap_framerate
    columns = (markers @ R_OPENSIM_WORLD.T).reshape(len(motion), -1).T
    times_s, rows = at_one_rate(motion, list(columns))
    count = len(times_s)
    numbers = range(1, len(names) + 1)
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{display_text(name)}",
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


def write_c3d(path: Path, motion: Motion, body: Body, start_s: float) -> None:
    """Write the markers of a motion; they are missing where the person was not seen.

    :param body: that the motion was fitted with.
    :param start_s: timestamp of the file's frame 1, seconds.
    :raises OutputError: the file cannot be written.
    """
    names, markers, joints = world_markers(motion, body)
    deviations = motion.joint_sigma_m
    if deviations is None:
        deviations = np.full((len(motion), len(body.joint_names)), np.nan)
    columns = [*markers.reshape(len(motion), -1).T, *np.asarray(deviations, float)[:, joints].T]
    times_s, rows = at_one_rate(motion, columns)
    places, residuals = np.split(rows, [3 * len(names)], axis=1)
    residuals_mm = np.where(_is_seen(motion, times_s)[:, None], 1000.0 * residuals, -1.0)
    parts = [body.joint_names[joint].replace("_", " ") for joint in joints]
    points_mm = 1000.0 * places.reshape(len(rows), len(names), 3)
    rate = motion.mocap_framerate
    first = 1 + round(float(times_s[0] - start_s) * rate)
    write_result(path, c3d_bytes(names, parts, points_mm, residuals_mm, rate, first))


def world_markers(motion: Motion, body: Body) -> tuple[list[str], Float64Array, list[int]]:
    """Return the names of the M markers, where they are (T, M, 3), world, metres, and the joint
    that moves each.
    """
    R_parts, joints = motion.parts_in_world(body)
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
    on_surface = body.keypoints(R_parts, joints, motion.betas.astype(float), which)
    hips = [body.joint_names.index(f"{side}_hip") for side in _SIDES.values()]
    between = joints[:, hips].mean(axis=1, keepdims=True)
    neck = joints[:, [body.joint_names.index("neck")]]
    names = ["Hip", "Neck", *of_joints, *of_keypoints]
    moving = [hips[0], body.joint_names.index("neck"), *at, *body.keypoint_part[which].tolist()]
    markers: Float64Array = np.concatenate([between, neck, joints[:, at], on_surface], axis=1)
    return names, markers, moving


def write_angles(path: Path, motion: Motion, body: Body) -> None:
    """Write the joint angles of a motion, as a .csv file or, with another suffix, as a .mot file.

    A .csv file has blanks where the person was not seen; a .mot file cannot have any.

    :param body: that the motion was fitted with.
    :raises OutputError: the file cannot be written.
    """
    angles = joint_angles(motion, body)
    times_s, rows = at_one_rate(motion, list(angles.values()))
    names = ["time", *angles]
    is_table = path.suffix.lower() == ".csv"
    separator = "," if is_table else "\t"
    lines = [separator.join(names)]
    is_written = _is_seen(motion, times_s) | (not is_table)
    for time_s, row, written in zip(times_s, rows.tolist(), is_written, strict=True):
        cells = [f"{value:.6f}" if written else "" for value in row]
        lines.append(separator.join([f"{time_s:.6f}", *cells]))
    if not is_table:
        lines[:0] = [
            display_text(path.stem),
            "version=1",
            f"nRows={len(times_s)}",
            f"nColumns={len(names)}",
            "inDegrees=yes",
            "endheader",
        ]
    write_result(path, "\n".join(lines) + "\n")


def joint_angles(motion: Motion, body: Body) -> dict[str, Float64Array]:
    """Return the angles (T,) of each joint, degrees without jumps, and the place of the pelvis,
    metres, by OpenSim's names.
    """
    R_world_part, joints = motion.parts_in_world(body)
    R_opensim_part = R_OPENSIM_WORLD @ R_world_part @ R_OPENSIM_MODEL.T
    segments = {name: R_opensim_part[:, k] for k, name in enumerate(body.joint_names)}
    pelvis = segments["pelvis"]
    trunk = segments["spine3"]
    tilt, listing, heading = _angles(pelvis)
    place = joints[:, 0] @ R_OPENSIM_WORLD.T
    found = {"pelvis_tilt": tilt, "pelvis_list": listing, "pelvis_rotation": heading}
    found |= {f"pelvis_t{axis}": place[:, k] for k, axis in enumerate("xyz")}
    for short in _SIDE_OF:
        found |= _leg_angles(segments, short)
    extension, bending, turn = _between(pelvis, trunk)
    found |= {"lumbar_extension": extension, "lumbar_bending": bending, "lumbar_rotation": turn}
    for short in _SIDE_OF:
        found |= _arm_angles(segments, short)
    return found


def _leg_angles(segments: dict[str, Float64Array], short: str) -> dict[str, Float64Array]:
    """Return the angles of a leg; adduction, inversion and inward rotation are positive."""
    side = _SIDE_OF[short]
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


def _arm_angles(segments: dict[str, Float64Array], short: str) -> dict[str, Float64Array]:
    """Return the angles of an arm; adduction, inward rotation, pronation, flexion of the wrist and
    its deviation to the little finger are positive.
    """
    side = _SIDE_OF[short]
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
    R_first: Float64Array, R_second: Float64Array
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return the angles of the joint between two segments, see `_angles`."""
    return _angles(transposed(R_first) @ R_second)


def _angles(
    R: Float64Array,
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return a, b and c of R = R_z(a) R_x(b) R_y(c), (T, 3, 3), in degrees without jumps.

    With the axes x and y exchanged, which is a reflection, it is R_z(−a) R_y(−b) R_x(−c).
    """
    exchanged = R[:, [1, 0, 2]][:, :, [1, 0, 2]]
    about_z, about_x, about_y = -euler_zyx_degrees(exchanged[:, None])[:, 0].T
    return about_z, about_x, about_y
