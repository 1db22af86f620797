# SPDX-License-Identifier: GPL-3.0-or-later
"""Biovision hierarchies (.bvh): joint positions.

Channels of a joint apply in the order in which they are listed, each about the axes that the ones
before it have turned: R = R_1 R_2 R_3. A position of the root replaces its offset.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....scope_addon.errors import MotionFileError
from ....solver.rotations import exp

AXES = {"X": 0, "Y": 1, "Z": 2}


@dataclass(frozen=True)
class _Joint:
    name: str
    parent: int  # -1 for the root
    offset: NDArray[np.float64]  # (3,)
    channels: tuple[str, ...]


def joint_positions(
    text: str, name: str = "motion"
) -> tuple[dict[str, NDArray[np.float64]], float]:
    """Return the positions (T, 3) of all joints by their names, in the file's unit, and frames per
    second.

    The end of the last bone below a joint is named after that joint, with ``_end``.

    :raises MotionFileError: when the file is malformed.
    """
    try:
        head, motion = text.split("MOTION", 1)
        joints = _hierarchy(head)
        words = motion.split()
        count = int(words[1])
        seconds = float(words[4])
        values = np.array(words[5:], float).reshape(
            -1, sum(len(joint.channels) for joint in joints)
        )
        if not 0 < count <= len(values):  # some programs write a frame more than they say
            raise ValueError(f"{len(values)} of {count} frames")
        if not 1e-4 <= seconds <= 1.0:
            raise ValueError(f"frames of {seconds} s")
        return _positions(joints, values[:count]), 1.0 / seconds
    except (ValueError, IndexError, KeyError, ZeroDivisionError) as error:
        raise MotionFileError(f"{name}: malformed .bvh file ({error})") from error


def _hierarchy(head: str) -> list[_Joint]:
    """Return the joints, each after its parent."""
    joints: list[_Joint] = []
    above: list[int] = []
    pattern = (
        r"(ROOT|JOINT|End)\s+(\S+)\s*\{\s*OFFSET((?:\s+\S+){3})"
        r"(?:\s+CHANNELS\s+\d+((?:\s+[XYZ]\w+)+))?|(\})"
    )
    for kind, name, offset, channels, closed in re.findall(pattern, head):
        if closed:
            above.pop()
            continue
        parent = above[-1] if above else -1
        name = f"{joints[parent].name}_end" if kind == "End" else name
        above.append(len(joints))
        joints.append(
            _Joint(name, parent, np.array(offset.split(), float), tuple(channels.split()))
        )
    if above or head.count("{") != len(joints):
        raise ValueError("the hierarchy has an unexpected word, or brackets that do not match")
    return joints


def _positions(joints: list[_Joint], values: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    column = 0
    # R (T, 3, 3), position (T, 3)
    poses: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
    for joint in joints:
        offset = np.tile(joint.offset, (len(values), 1))
        turned = np.broadcast_to(np.eye(3), (len(values), 3, 3))
        for channel in joint.channels:
            axis = AXES[channel[0]]
            value = values[:, column]
            column += 1
            if channel.endswith("position"):
                offset[:, axis] = value
            else:
                turned = turned @ exp(np.radians(value)[:, None] * np.eye(3)[axis])
        if joint.parent < 0:
            poses.append((turned, offset))
        else:
            R, position = poses[joint.parent]
            poses.append((R @ turned, position + np.einsum("tij,tj->ti", R, offset)))
    return {joint.name: position for joint, (_, position) in zip(joints, poses, strict=True)}
