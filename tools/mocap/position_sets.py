# SPDX-License-Identifier: GPL-3.0-or-later
"""Sets of joint positions (.npz): motion of people who stand and walk with straighter legs than
CMU's.

A file holds all takes of a set on end: ``joint_names`` (J,), ``positions`` (F, J, 3) metres, y up,
NaN where a joint was not recorded, and for each take ``take_name``, ``subject``, ``fps`` and the
frames ``start[i]:start[i + 1]``. Sets that measured segments have ``orientation_names`` (S,) and
``orientations`` (F, S, 4), quaternions w x y z from segment to world, whose axes are x left, y up,
z ahead when the person stands with hanging arms.

The sets place the joints of the spine differently: some 7 cm behind the hips. So the directions
that are up in pelvis and rib cage are turned about the line of the hips by one angle for each
performer, such that both agree with the line from hips to neck in the median upright frame.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.errors import MotionFileError
from ...scope_addon.untrusted.files import read_npz
from ...solver.rotations import exp, matrix_from_quaternion
from .joint_centres import SIDES, Points, take_from_joints
from .straight_legs import with_knees_back
from .take import Take


@dataclass(frozen=True)
class Layout:
    """Joints of a set that stand for those of `take_from_joints`."""

    chest: str  # lower end of the rib cage
    lower_spine: str  # fixed in the pelvis, above the hips
    head_end: str = "head_end"
    collar: str = "collar"
    foot_end: str = "foot"
    heel: str = ""
    rib_cage: str = ""  # its segment, of sets with orientations


LAYOUTS = {
    "accad": Layout(chest="spine2", lower_spine="spine1"),
    "cmu_more": Layout(chest="spine2", lower_spine="spine1", head_end="head", foot_end="foot_end"),
    "markers": Layout(
        chest="chest", lower_spine="chest", collar="shoulder", foot_end="foot_end", heel="heel"
    ),
    "mesh2motion": Layout(chest="spine2", lower_spine="spine1"),
    "reactidle": Layout(
        chest="spine2", lower_spine="spine2", collar="shoulder", foot_end="foot_end"
    ),
    "rocketbox": Layout(chest="spine2", lower_spine="spine1", rib_cage="spine3"),
    "style100": Layout(chest="spine3", lower_spine="spine1", rib_cage="chest"),
}
# Rocketbox's walks are 5 to 7 degrees more bent than people's, and so is whatever its male skeleton
# does; the female one stands on a straight leg. Knees of the others move back as those of CMU's
# takes do.
BENT_ROCKETBOX = re.compile(r"^m_|_walk|_run|_turn_")
ROCKETBOX_BACK_M = 0.016
# of the leg's length: hips that are higher above the lower ankle are those of an upright person
UPRIGHT = 0.96
FEW = 30  # upright frames; with fewer, a performer's directions stay as they are
SHORTEST_S = 0.5
LIMBS = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")


def load_sets(folder: str | Path, without: tuple[str, ...] = ()) -> list[Take]:
    """Return the takes of all sets in a folder, 30 frames/s, ordered by set, performer and name.

    Of a take with joints that were not recorded, the longest section with all joints is kept, if
    there is one of half a second.

    :param folder: the folder of the .npz files, of which each that `LAYOUTS` names is read.
    :param without: names of sets to leave out.
    :raises MotionFileError: when the folder has none of them, or a file is malformed.
    """
    folder = Path(folder)
    found = [
        name
        for name in sorted(LAYOUTS)
        if name not in without and (folder / f"{name}.npz").is_file()
    ]
    if not found:
        raise MotionFileError(f"{folder} has none of the sets {', '.join(sorted(LAYOUTS))}")
    return [take for name in found for take in load_set(folder / f"{name}.npz")]


def load_set(path: Path, wanted: Collection[str] | None = None) -> list[Take]:
    """Return the takes of one file, which has the name of its set, as `load_sets`.

    :param wanted: names of the only takes to return; all recordings of a performer level them.
    :raises MotionFileError: when the set is unknown, or the file lacks arrays or joints.
    """
    layout = LAYOUTS.get(path.stem)
    if layout is None:
        raise MotionFileError(f"{path}: unknown set; known are {', '.join(sorted(LAYOUTS))}")
    data = read_npz(path, MotionFileError, "motion set")
    try:
        recordings = _recordings(data, layout)
    except (KeyError, ValueError, IndexError) as error:
        raise MotionFileError(f"{path}: malformed motion set ({error!r})") from error
    if path.stem == "rocketbox":
        _straighten_rocketbox(recordings)
    takes = []
    for performer in sorted({recording.performer for recording in recordings}):
        own = sorted((r for r in recordings if r.performer == performer), key=lambda r: r.name)
        _level(own)
        takes += [
            _take(recording, path.stem)
            for recording in own
            if wanted is None or recording.name in wanted
        ]
    return takes


@dataclass
class _Recording:
    """A take as recorded: joints (T, 3) as `take_from_joints` takes them, and directions (T, 3) to
    the left.
    """

    name: str
    performer: str
    fps: float
    joints: dict[str, Points]
    lefts: dict[str, Points]


def _recordings(data: Mapping[str, NDArray[Any]], layout: Layout) -> list[_Recording]:
    names = [str(name) for name in data["joint_names"]]
    source_of = {
        "chest": layout.chest,
        "neck": "neck",
        "head_end": layout.head_end,
        "spine": layout.lower_spine,
    }
    ours = {"collar": layout.collar, "foot_end": layout.foot_end} | {limb: limb for limb in LIMBS}
    if layout.heel:
        ours["heel"] = layout.heel
    for side in SIDES:
        source_of |= {f"{side}_{joint}": f"{side}_{theirs}" for joint, theirs in ours.items()}
    columns = [names.index(theirs) for theirs in source_of.values()]
    segments = [str(name) for name in data.get("orientation_names", ())]
    found = []
    for k, name in enumerate(data["take_name"]):
        rows = slice(int(data["start"][k]), int(data["start"][k + 1]))
        positions = data["positions"][rows][:, columns].astype(float)
        kept = _longest(np.isfinite(positions).all(axis=(1, 2)))
        fps = float(data["fps"][k])
        if kept.stop - kept.start < SHORTEST_S * fps:
            continue
        joints = {joint: positions[kept, column] for column, joint in enumerate(source_of)}
        lefts = {}
        if segments:
            R = matrix_from_quaternion(data["orientations"][rows][kept].astype(float))
            joints["pelvis_up"] = R[:, segments.index("pelvis"), :, 1]
            joints["chest_up"] = R[:, segments.index(layout.rib_cage), :, 1]
            turning = (
                "head",
                *(f"{side}_{joint}" for side in SIDES for joint in ("hip", "ankle", "shoulder")),
            )
            lefts = {segment: R[:, segments.index(segment), :, 0] for segment in turning}
        found.append(_Recording(str(name), str(data["subject"][k]), fps, joints, lefts))
    return found


def _straighten_rocketbox(recordings: list[_Recording]) -> None:
    for recording in recordings:
        if BENT_ROCKETBOX.search(recording.name):
            left = _unit(recording.joints["left_hip"] - recording.joints["right_hip"])
            recording.joints = with_knees_back(recording.joints, left, ROCKETBOX_BACK_M)


def _longest(complete: NDArray[np.bool_]) -> slice:
    """Return the longest run of true values (T,)."""
    ends = np.flatnonzero(np.diff(np.concatenate([[False], complete, [False]]).astype(int)))
    if len(ends) == 0:
        return slice(0, 0)
    longest = int(np.argmax(ends[1::2] - ends[::2]))
    return slice(int(ends[2 * longest]), int(ends[2 * longest + 1]))


def _level(recordings: list[_Recording]) -> None:
    """Set what is up in pelvis and rib cage, and the pelvis's position, of one performer's
    recordings.
    """
    angles: dict[str, list[NDArray[np.float64]]] = {"pelvis_up": [], "chest_up": []}
    for recording in recordings:
        j = recording.joints
        j["pelvis"] = 0.5 * (j["left_hip"] + j["right_hip"])
        j.setdefault("pelvis_up", j["spine"] - j["pelvis"])
        j.setdefault("chest_up", j["neck"] - j["chest"])
        left = _unit(j["left_hip"] - j["right_hip"])
        for key, found in angles.items():
            found.append(_pitch(j["neck"] - j["pelvis"], j[key], left)[_is_upright(j)])
    for key, found in angles.items():
        pitches = np.concatenate(found)
        if len(pitches) < FEW:
            continue
        pitch = float(np.median(pitches))
        for recording in recordings:
            j = recording.joints
            left = _unit(j["left_hip"] - j["right_hip"])
            j[key] = np.einsum("tij,tj->ti", exp(-pitch * left), j[key])


def _is_upright(joints: Mapping[str, Points]) -> NDArray[np.bool_]:
    """Return (T,) bool: whether the hips are high above the lower ankle."""
    leg = sum(
        np.median(np.linalg.norm(joints[f"left_{a}"] - joints[f"left_{b}"], axis=1))
        for a, b in (("hip", "knee"), ("knee", "ankle"))
    )
    low = np.minimum(joints["left_ankle"][:, 1], joints["right_ankle"][:, 1])
    upright: NDArray[np.bool_] = joints["pelvis"][:, 1] - low > UPRIGHT * leg
    return upright


def _pitch(a: Points, b: Points, left: Points) -> NDArray[np.float64]:
    """Return the angle (T,) radians about ``left`` from a to b: positive when b leans further
    ahead.
    """
    ahead = np.cross(left, a)
    a = np.cross(ahead, left)
    return np.arctan2(
        (b * ahead).sum(1) * np.linalg.norm(a, axis=1),
        (b * a).sum(1) * np.linalg.norm(ahead, axis=1),
    )


def _take(recording: _Recording, source: str) -> Take:
    joints = recording.joints
    lefts = recording.lefts
    head = lefts.get("head")
    return take_from_joints(
        recording.name,
        recording.performer,
        source,
        recording.fps,
        joints,
        head,
        lefts or _by_feet(joints),
    )


def _by_feet(joints: Mapping[str, Points]) -> dict[str, Points]:
    """Return the direction to the left of straight legs: halfway between the hips' and that across
    the foot.

    The turn of a straight leg about itself does not show in its joints, but where its toes point
    does.
    """
    across = _unit(joints["left_hip"] - joints["right_hip"])
    found = {}
    for side in SIDES:
        forward = joints[f"{side}_foot_end"] - joints.get(f"{side}_heel", joints[f"{side}_ankle"])
        shank = joints[f"{side}_knee"] - joints[f"{side}_ankle"]
        found[f"{side}_hip"] = across + _unit(np.cross(shank, forward))
    return found


def _unit(v: Points) -> Points:
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-12))
