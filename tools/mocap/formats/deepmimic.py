# SPDX-License-Identifier: GPL-3.0-or-later
"""DeepMimic's humanoid: a character file with joints and bodies, and motions of 44 numbers per
frame.

A frame is its duration (s), the root's position (m) and quaternion (w, x, y, z), followed, in the
order of the character's joints, by a quaternion for a spherical joint, an angle about z for a
revolute joint and nothing for a fixed one. R_j = R_parent · R_state, t_j = t_parent + R_parent ·
attach. Axes: x forward, y up, z right; zero pose standing with hanging arms. Feet and head have no
joint beyond them; their tips come from the bodies' shapes.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....scope_addon.errors import MotionFileError
from ....solver.rotations import exp, matrix_from_quaternion
from ..take import Take

# x forward, y up, z right -> x left, y up, z forward
R_SHARED_DEEPMIMIC = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
NAMES = {"root": "pelvis", "chest": "chest", "neck": "neck"}  # the others have the names used here
VALUES = {"none": 4, "spherical": 4, "revolute": 1, "fixed": 0}


@dataclass(frozen=True)
class Character:
    """Joints in file order (parents first). Metres, DeepMimic's axes."""

    names: tuple[str, ...]
    types: tuple[str, ...]
    parents: tuple[int, ...]
    attach: NDArray[np.float64]  # (J, 3) in the parent's frame
    # tip -> joint that carries it, position in the joint's frame
    tips: dict[str, tuple[int, NDArray[np.float64]]]

    @property
    def width(self) -> int:
        """Return the count of numbers in a frame."""
        return 4 + sum(VALUES[t] for t in self.types)


def parse_character(text: str, name: str = "character") -> Character:
    """Read a character file.

    :raises MotionFileError: when it is not JSON, or lacks joints or bodies.
    """
    try:
        data = json.loads(text)
        joints = data["Skeleton"]["Joints"]
        bodies = {b["Name"]: b for b in data["BodyDefs"]}
        names = tuple(j["Name"] for j in joints)
        tips = {}
        for tip, joint, half in (
            ("head_end", "neck", (0, 0.5, 0)),
            ("left_foot_end", "left_ankle", (0.5, 0, 0)),
            ("right_foot_end", "right_ankle", (0.5, 0, 0)),
        ):
            b = bodies[joint]
            size = np.array([b[f"Param{k}"] for k in range(3)])
            tips[tip] = (names.index(joint), _attach(b) + size * half)
        return Character(
            names=tuple(NAMES.get(n, n) for n in names),
            types=tuple(j["Type"] for j in joints),
            parents=tuple(int(j["Parent"]) for j in joints),
            attach=np.array([_attach(j) for j in joints]),
            tips=tips,
        )
    except (KeyError, ValueError, TypeError) as error:
        raise MotionFileError(f"{name}: not a DeepMimic humanoid character ({error!r})") from error


def _attach(item: dict[str, Any]) -> NDArray[np.float64]:
    return np.array([item["AttachX"], item["AttachY"], item["AttachZ"]], float)


def parse_motion(text: str, character: Character, name: str = "motion") -> NDArray[np.float64]:
    """Read the frames of a motion file, (T, 44).

    :raises MotionFileError: when it is not JSON or its frames do not fit the character.
    """
    try:
        frames = np.array(json.loads(text)["Frames"], dtype=float)
    except (KeyError, ValueError, TypeError) as error:
        raise MotionFileError(f"{name}: not a DeepMimic motion ({error!r})") from error
    if frames.ndim != 2 or frames.shape[1] != character.width or len(frames) < 2:
        raise MotionFileError(
            f"{name}: frames must be (T >= 2, {character.width}), but got {frames.shape}"
        )
    return frames


def forward_kinematics(
    frames: NDArray[np.float64], character: Character
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return R (T, J, 3, 3) and t (T, J, 3), joint to world, DeepMimic's axes, of frames (T,
    44).
    """
    T = len(frames)
    J = len(character.names)
    R = np.empty((T, J, 3, 3))
    t = np.empty((T, J, 3))
    column = 4
    for j, (kind, parent) in enumerate(zip(character.types, character.parents, strict=True)):
        value = frames[:, column : column + VALUES[kind]]
        column += VALUES[kind]
        if kind == "revolute":
            state = exp(value * [0.0, 0.0, 1.0])
        else:
            state = matrix_from_quaternion(value) if kind != "fixed" else np.eye(3)
        R[:, j] = state if parent < 0 else R[:, parent] @ state
        t[:, j] = (
            frames[:, 1:4] if parent < 0 else t[:, parent] + R[:, parent] @ character.attach[j]
        )
    return R, t


def read_take(text: str, character: Character, name: str) -> Take:
    """Read a motion file as a take. Frames are assumed to be evenly spaced, as in every file of the
    archive.
    """
    frames = parse_motion(text, character, name)
    R, t = forward_kinematics(frames, character)
    tips = [t[:, j] + R[:, j] @ at for j, at in character.tips.values()]
    t = np.concatenate([t, np.stack(tips, axis=1)], axis=1)
    R = np.concatenate([R, R[:, [j for j, _ in character.tips.values()]]], axis=1)
    turn = R_SHARED_DEEPMIMIC
    return Take(
        name=name,
        subject="deepmimic",
        fps=1.0 / float(np.median(frames[:-1, 0])),
        joint_names=(*character.names, *character.tips),
        positions=t @ turn.T,
        source="deepmimic",
        mirrored="_mirror" in name,
        orientations=turn @ R @ turn.T,
    )
