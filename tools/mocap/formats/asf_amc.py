# SPDX-License-Identifier: GPL-3.0-or-later
"""Acclaim motion capture: .asf skeletons and .amc motions, as CMU publishes them.

A bone b with rest direction d, length l, axis rotation C (Euler angles of ``axis``) and joint
rotation M (Euler angles of its ``dof`` values, missing ones zero) under its parent p, all in the
skeleton's axes:

    R_b = R_p C M Cᵀ        end_b = end_p + l R_b d        root: R = C M Cᵀ, end = position + T

Euler angles "XYZ" turn about fixed axes, x first: R = Rz Ry Rx. Lengths are stored in inches times
the file's ``length`` unit, so metres = value / unit · 0.0254; CMU's 0.45 makes 1 unit 5.64 cm.
Source: the Acclaim file format as described by J. Lander, "Working with motion capture file
formats" (1998).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....scope_addon.errors import MotionFileError
from ....solver.rotations import exp

INCH = 0.0254
AXES = {"x": 0, "y": 1, "z": 2}

# CMU's bones by the joint about which they rotate. A bone that cannot rotate (hip joint) only moves
# its children.
_SIDE = {
    "hip": "femur", "knee": "tibia", "ankle": "foot", "foot": "toes", "collar": "clavicle",
    "shoulder": "humerus",
    "elbow": "radius", "forearm": "wrist", "wrist": "hand", "knuckle": "fingers", "thumb": "thumb",
}  # fmt: skip
SEGMENT_OF_JOINT = {
    "pelvis": "root",
    "spine1": "lowerback",
    "spine2": "upperback",
    "spine3": "thorax",
    "neck": "lowerneck",
    "neck2": "upperneck",
    "head": "head",
    **{
        f"{side}_{joint}": side[0] + bone
        for side in ("left", "right")
        for joint, bone in _SIDE.items()
    },
}
TIPS = {
    "head_end": "head",
    **{f"{side}_foot_end": side[0] + "toes" for side in ("left", "right")},
    **{f"{side}_finger_end": side[0] + "fingers" for side in ("left", "right")},
    **{f"{side}_thumb_end": side[0] + "thumb" for side in ("left", "right")},
}
JOINT_NAMES = (*SEGMENT_OF_JOINT, *TIPS)


@dataclass(frozen=True)
class Skeleton:
    """Bones in an order in which each follows its parent; bone 0 is ``root``. Lengths in metres."""

    bones: tuple[str, ...]
    parents: NDArray[np.intp]  # (B,) −1 for the root
    # (B, 3) start to end of the bone at zero pose; the root's is its rest position
    offsets: NDArray[np.float64]
    axes: NDArray[np.float64]  # (B, 3, 3) C_b
    # per bone, order of its values: rx, ry, rz and for the root tx, ty, tz
    dofs: tuple[tuple[str, ...], ...]
    metres_per_unit: float
    degrees: bool

    def forward_kinematics(
        self, M: NDArray[np.float64], root: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Compute the global pose of every bone.

        :param M: (T, B, 3, 3) rotations of the bones in skeleton axes relative to their parents,
            that is C M Cᵀ above.
        :param root: (T, 3) metres, position of the root.
        :return: R (T, B, 3, 3) bone to world and ends (T, B, 3) metres; ends[:, 0] is the root.
        """
        R = np.empty_like(M)
        ends = np.empty(M.shape[:-1])
        R[:, 0] = M[:, 0]
        ends[:, 0] = root
        for b in range(1, len(self.bones)):
            p = self.parents[b]
            R[:, b] = R[:, p] @ M[:, b]
            ends[:, b] = ends[:, p] + R[:, b] @ self.offsets[b]
        return R, ends

    def scaled(self, scale: float) -> Skeleton:
        """Return the skeleton with every bone ``scale`` times as long."""
        return replace(self, offsets=self.offsets * scale)

    def named_joints(
        self, R: NDArray[np.float64], ends: NDArray[np.float64]
    ) -> tuple[tuple[str, ...], NDArray[np.float64], NDArray[np.float64]]:
        """Return bone poses in the form of ``Take``: names, positions (T, J, 3), orientations (T,
        J, 3, 3).

        :raises MotionFileError: when a bone of CMU's skeleton is missing.
        """
        names = (*SEGMENT_OF_JOINT.values(), *TIPS.values())
        missing = [n for n in names if n not in self.bones]
        if missing:
            raise MotionFileError(
                f"the skeleton lacks {', '.join(missing)}: it is not CMU's 31-bone skeleton"
            )
        bone = np.array([self.bones.index(n) for n in names])
        at = bone.copy()
        n_joints = len(SEGMENT_OF_JOINT)
        # a joint is where its bone begins, that is its parent's end
        at[1:n_joints] = self.parents[bone[1:n_joints]]
        return JOINT_NAMES, ends[:, at], R[:, bone]


def _euler(angles: NDArray[np.float64], order: str) -> NDArray[np.float64]:
    """Return rotations (..., 3, 3) of Euler angles (..., n) radians about fixed axes, ``order``
    first to last.
    """
    R = np.broadcast_to(np.eye(3), (*angles.shape[:-1], 3, 3))
    for k, axis in enumerate(order):
        R = exp(angles[..., k, None] * np.eye(3)[AXES[axis]]) @ R
    return R


def parse_asf(text: str, name: str = "skeleton") -> Skeleton:
    """Read an .asf file.

    :param text: the file's text; ``name``: its name in messages.
    :raises MotionFileError: when a section or value is missing or malformed.
    """
    sections: dict[str, list[list[str]]] = {}
    current: list[list[str]] = []
    for line in text.splitlines():
        words = line.split("#")[0].split()
        if words and words[0].startswith(":"):
            current = sections.setdefault(words[0][1:].lower(), [])
            words = words[1:]
        if words:
            current.append(words)
    missing = [s for s in ("units", "root", "bonedata", "hierarchy") if s not in sections]
    if missing:
        raise MotionFileError(
            f"{name}: no section :{missing[0]}; it is not a complete .asf skeleton"
        )
    try:
        return _skeleton(sections)
    except (KeyError, ValueError, IndexError) as error:
        raise MotionFileError(f"{name}: malformed .asf skeleton ({error})") from error


def _skeleton(sections: Mapping[str, list[list[str]]]) -> Skeleton:
    units = {words[0]: words[1] for words in sections["units"]}
    metres = INCH / float(units.get("length", "1"))
    to_radians = np.pi / 180 if units.get("angle", "deg").startswith("deg") else 1.0

    def rotation(angles: list[str], order: str) -> NDArray[np.float64]:
        return _euler(np.array(angles, float) * to_radians, order.lower())

    root = {words[0]: words[1:] for words in sections["root"]}
    offset = {"root": np.array(root["position"], float) * metres}
    axis = {"root": rotation(root["orientation"], root["axis"][0])}
    dof = {"root": tuple(word.lower() for word in root["order"])}
    for bone in _blocks(sections["bonedata"]):
        value = {words[0]: words[1:] for words in bone}
        name = value["name"][0]
        direction = np.array(value["direction"][:3], float)
        offset[name] = direction / np.linalg.norm(direction) * float(value["length"][0]) * metres
        axis[name] = rotation(value["axis"][:3], value["axis"][3])
        dof[name] = tuple(word.lower() for word in value.get("dof", ()))
    parent: dict[str, str] = {}
    order = ["root"]
    for words in next(iter(_blocks(sections["hierarchy"]))):
        for child in words[1:]:
            parent[child] = words[0]
            order.append(child)
    if len(order) != len(offset) or any(order.index(parent[n]) > order.index(n) for n in order[1:]):
        raise ValueError("the hierarchy must name every bone once, after its parent")
    return Skeleton(
        bones=tuple(order),
        parents=np.array([-1] + [order.index(parent[n]) for n in order[1:]]),
        offsets=np.array([offset[n] for n in order]),
        axes=np.array([axis[n] for n in order]),
        dofs=tuple(dof[n] for n in order),
        metres_per_unit=metres,
        degrees=to_radians != 1.0,
    )


def _blocks(lines: list[list[str]]) -> list[list[list[str]]]:
    """Split lines into the blocks between ``begin`` and ``end``."""
    blocks: list[list[list[str]]] = []
    for words in lines:
        if words[0] == "begin":
            blocks.append([])
        elif words[0] != "end":
            blocks[-1].append(words)
    return blocks


def parse_amc(
    text: str, skeleton: Skeleton, name: str = "motion"
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Read an .amc file.

    :return: M (T, B, 3, 3), rotations relative to the parents in skeleton axes, and root (T, 3)
        metres, as ``Skeleton.forward_kinematics`` takes them.
    :raises MotionFileError: when bones or values do not match the skeleton, or frames are missing
        or incomplete.
    """
    words = [w for line in text.splitlines() if line and line[0] not in "#:" for w in line.split()]
    if not words:
        raise MotionFileError(f"{name}: the .amc file has no frames")
    # Every frame lists the same bones in the same order, so a frame is a fixed number of words.
    width = 1
    while width < len(words) and words[width] in skeleton.bones:
        width += 1 + len(skeleton.dofs[skeleton.bones.index(words[width])])
    if len(words) % width or words[::width] != [
        str(int(words[0]) + t) for t in range(len(words) // width)
    ]:
        raise MotionFileError(
            f"{name}: the frames of the .amc file are not all complete and numbered in order"
        )
    table = np.array(words, dtype=object).reshape(-1, width)
    T = len(table)
    M = np.broadcast_to(np.eye(3), (T, len(skeleton.bones), 3, 3)).copy()
    root = np.broadcast_to(skeleton.offsets[0], (T, 3)).copy()
    column = 1
    while column < width:
        bone = table[0, column]
        if bone not in skeleton.bones or (table[:, column] != bone).any():
            raise MotionFileError(f"{name}: '{bone}' is not a bone of the skeleton in every frame")
        b = skeleton.bones.index(bone)
        dof = skeleton.dofs[b]
        try:
            values = table[:, column + 1 : column + 1 + len(dof)].astype(float)
        except ValueError as error:
            raise MotionFileError(
                f"{name}: the values of bone '{bone}' do not match its dof {dof}"
            ) from error
        turn = [k for k, d in enumerate(dof) if d[0] == "r"]
        angles = values[:, turn] * (np.pi / 180 if skeleton.degrees else 1.0)
        C = skeleton.axes[b]
        M[:, b] = C @ _euler(angles, "".join(dof[k][1] for k in turn)) @ C.T
        for k, d in enumerate(dof):
            if d[0] == "t":
                root[:, AXES[d[1]]] += values[:, k] * skeleton.metres_per_unit
        column += 1 + len(dof)
    return M, root
