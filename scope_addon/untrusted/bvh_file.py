# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion in Biovision hierarchy files (.bvh), which may come from anyone.

A joint's axes are those of the file while all its angles are zero. Its rotation is the product of
those about its channels' axes, in the order of the channels, and its position channels replace its
offset. The format states neither the unit of lengths nor which axis points up.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...solver.errors import InputError
from ...solver.rotations import exp
from .files import check_regular

LARGEST_BYTES = 256 << 20  # an hour of 60 joints at 60 frames per second takes twice this
MOST_JOINTS = 4096
MOST_FRAMES = 500_000  # more than two hours at 60 frames per second
_SHORTEST_S = 1e-4  # between frames
_LONGEST_S = 100.0
_LARGEST = 1e9  # of a number in the file
_AXES = {"X": np.array([1.0, 0, 0]), "Y": np.array([0, 1.0, 0]), "Z": np.array([0, 0, 1.0])}
_CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")
_WHOLE_RATES = [24.0, 25.0, 30.0, 50.0, 60.0, 90.0, 100.0, 120.0, 125.0, 240.0, 250.0]
_NTSC_RATES = [rate * 1000 / 1001 for rate in (24, 30, 60, 120)]
_BELOW_ONE = 1.0 - 1e-9  # of a last digit that is cut off, never a whole one
_LONGEST_NAME = 200  # characters
_MOTION = re.compile(
    r"^[ \t]*MOTION\s+Frames\s*:\s*(\S+)\s+Frame\s+Time\s*:\s*(\S+)", re.MULTILINE | re.IGNORECASE
)


@dataclass(frozen=True)
class BvhMotion:
    """T frames of N joints, parents before children, in the axes and the unit of the file."""

    names: list[str]
    parents: NDArray[np.intp]  # (N,), -1 for roots
    offsets: NDArray[np.float64]  # (N, 3) from the parent, while all angles are zero
    ends: NDArray[np.float64]  # (N, 3) from the joint to where its chain ends; 0 if it goes on
    channels: list[list[str]]  # of each joint, such as Xposition and Zrotation
    values: NDArray[np.float64]  # (T, C) of all channels; degrees
    rate: float  # frames per second

    def by_root(self) -> list[BvhMotion]:
        """Return the motion of each root and of the joints below it."""
        root_of: list[int] = []
        for joint, parent in enumerate(self.parents.tolist()):
            root_of.append(root_of[parent] if parent >= 0 else joint)
        channel_roots = np.repeat(root_of, [len(channels) for channels in self.channels])
        found = []
        for root in sorted(set(root_of)):
            # The joints of a root follow each other.
            joints = slice(root, root + root_of.count(root))
            found.append(
                BvhMotion(
                    self.names[joints],
                    np.maximum(self.parents[joints] - root, -1),
                    self.offsets[joints],
                    self.ends[joints],
                    self.channels[joints],
                    self.values[:, channel_roots == root],
                    self.rate,
                )
            )
        return found

    def at_rest(self) -> NDArray[np.float64]:
        """Return the joints (N, 3) while all angles are zero."""
        points = self.offsets.copy()
        for joint, parent in enumerate(self.parents.tolist()):
            if parent >= 0:
                points[joint] += points[parent]
        return points

    def posed(
        self, values: NDArray[np.float64], joints: list[int]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return rotations (t, J, 3, 3) and positions (t, J, 3) of some of the joints.

        :param values: (t, C) of the channels.
        """
        columns = np.cumsum([0, *map(len, self.channels)])
        rotations: dict[int, NDArray[np.float64]] = {}
        positions: dict[int, NDArray[np.float64]] = {}
        needed = set(joints)
        for joint in reversed(range(len(self.names))):
            if joint in needed:
                needed.add(int(self.parents[joint]))
        for joint in sorted(needed - {-1}):
            R_parent_joint = np.tile(np.eye(3), (len(values), 1, 1))
            place = np.tile(self.offsets[joint], (len(values), 1))
            for column, channel in enumerate(self.channels[joint], int(columns[joint])):
                axis = _AXES[channel[0]]
                if channel.endswith("position"):
                    place[:, axis > 0] = values[:, [column]]
                else:
                    R_parent_joint = R_parent_joint @ exp(np.radians(values[:, [column]]) * axis)
            parent = int(self.parents[joint])
            if parent >= 0:
                place = positions[parent] + (rotations[parent] @ place[..., None])[..., 0]
                R_parent_joint = rotations[parent] @ R_parent_joint
            rotations[joint] = R_parent_joint
            positions[joint] = place
        return (
            np.stack([rotations[joint] for joint in joints], axis=1),
            np.stack([positions[joint] for joint in joints], axis=1),
        )


def read_bvh(path: Path, error: type[InputError]) -> BvhMotion:
    """Read a file.

    :param error: class of what is raised.
    :raises InputError: as ``error``, when the file cannot be read, is too large, or contradicts
        itself.
    """
    check_regular(path, error, "BVH file", LARGEST_BYTES)
    try:
        text = path.read_text("utf-8-sig", errors="replace")
    except FileNotFoundError as cause:
        raise error(f"{path} does not exist; choose an existing motion file") from cause
    except OSError as cause:
        raise error(f"{path} cannot be read ({cause.strerror}); choose another file") from cause
    motion = _MOTION.search(text)
    try:
        if not motion:
            raise _DamageError("it has no MOTION with Frames and Frame Time")
        names, parents, offsets, ends, channels = _hierarchy(text[: motion.start()])
        rate = _rate(motion[2])
        values = _frames(motion[1], text[motion.end() :], sum(map(len, channels)))
    except _DamageError as damage:
        raise error(f"{path} is not a readable BVH file: {damage}; choose another file") from None
    return BvhMotion(
        names,
        np.array(parents, np.intp),
        np.array(offsets),
        np.array(ends),
        channels,
        values,
        rate,
    )


class _DamageError(Exception):
    """What is wrong with a file, in words."""


def _hierarchy(
    text: str,
) -> tuple[list[str], list[int], list[list[float]], list[list[float]], list[list[str]]]:
    """Return the names, parents, offsets, ends and channels of the joints."""
    words = iter(text.replace("{", " { ").replace("}", " } ").split())
    names: list[str] = []
    repetitions: dict[str, int] = {}
    parents: list[int] = []
    offsets: list[list[float]] = []
    ends: list[list[float]] = []
    channels: list[list[str]] = []
    open_joints: list[int] = []
    is_in_end = False
    if next(words, "") != "HIERARCHY":
        raise _DamageError("it does not begin with HIERARCHY")
    for word in words:
        if word in ("ROOT", "JOINT") and not is_in_end:
            if (word == "ROOT") == bool(open_joints) or len(names) == MOST_JOINTS:
                raise _DamageError(f"{word} follows where there is no place for it")
            names.append(_other_name(_text_until_brace(words), repetitions))
            parents.append(open_joints[-1] if open_joints else -1)
            open_joints.append(len(names) - 1)
            offsets.append([0.0, 0.0, 0.0])
            ends.append([0.0, 0.0, 0.0])
            channels.append([])
        elif word == "End" and open_joints and not is_in_end:
            _text_until_brace(words)
            is_in_end = True
        elif word == "OFFSET" and open_joints:
            (ends if is_in_end else offsets)[open_joints[-1]] = [_number(words) for _ in "xyz"]
        elif word == "CHANNELS" and open_joints and not is_in_end:
            count = _number(words)
            if count not in range(len(_CHANNELS) + 1):
                raise _DamageError(f"{names[-1]} has {count:g} channels")
            listed = [next(words, "").capitalize() for _ in range(int(count))]
            unknown = [channel for channel in listed if channel not in _CHANNELS]
            if unknown:
                raise _DamageError(f"'{unknown[0][:_LONGEST_NAME]}' is no channel")
            channels[open_joints[-1]] = listed
        elif word == "}" and is_in_end:
            is_in_end = False
        elif word == "}" and open_joints:
            open_joints.pop()
        else:
            raise _DamageError(f"'{word[:_LONGEST_NAME]}' is not expected in its hierarchy")
    if open_joints or is_in_end or not names:
        raise _DamageError("its hierarchy does not end")
    return names, parents, offsets, ends, channels


def _other_name(name: str, repetitions: dict[str, int]) -> str:
    """Return the name, with a number if it was returned before.

    :param repetitions: of every name so far, how often it came again.
    """
    other = name
    while other in repetitions:
        repetitions[name] += 1
        other = f"{name}.{repetitions[name]}"
    repetitions[other] = 0
    return other


def _text_until_brace(words: Iterator[str]) -> str:
    """Return the words before the next brace; names of other tools may have spaces."""
    name: list[str] = []
    for word in words:
        if word == "{":
            return " ".join(name)[:_LONGEST_NAME]
        name.append(word)
    raise _DamageError("its hierarchy does not end")


def _number(words: Iterator[str]) -> float:
    word = next(words, "")
    try:
        number = float(word)
    except ValueError:
        number = np.nan
    if not abs(number) <= _LARGEST:
        raise _DamageError(f"'{word[:_LONGEST_NAME]}' stands where a number is needed")
    return number


def _frames(count_text: str, text: str, channels: int) -> NDArray[np.float64]:
    """Return the values (T, C) of the channels.

    :param count_text: the stated number of frames.
    :param text: of the values.
    """
    count = _number(iter([count_text]))
    if count not in range(1, MOST_FRAMES + 1):
        raise _DamageError(f"it has {count:g} frames, but must have 1 to {MOST_FRAMES}")
    with warnings.catch_warnings():
        # Numpy warns of what is no number, and returns what was before it.
        warnings.simplefilter("ignore", DeprecationWarning)
        try:
            values = np.fromstring(text, sep=" ")
        except ValueError:
            values = np.zeros(0)
    if len(values) != count * channels or not channels:
        raise _DamageError(
            f"it should have {count:g} frames of {channels} numbers, but {len(values)} numbers "
            "can be read"
        )
    if not (np.abs(values) <= _LARGEST).all():
        raise _DamageError("it contains NaN, infinity or numbers beyond all measure")
    return values.reshape(int(count), channels)


def _rate(text: str) -> float:
    """Return the frames per second; of a frame time such as 0.033333, which is rounded, the usual
    rate that it stands for.
    """
    step_s = _number(iter([text]))
    if not _SHORTEST_S <= step_s <= _LONGEST_S:
        raise _DamageError(f"its frame time is {step_s:g} s")
    digit_s = 10.0 ** int(Decimal(text).as_tuple().exponent)
    # a time is rounded to its last digit, or cut off after it
    for least_s, most_s in ((-0.5 * digit_s, 0.5 * digit_s), (0.0, _BELOW_ONE * digit_s)):
        for rates in (_WHOLE_RATES, _NTSC_RATES):
            usual = [rate for rate in rates if least_s <= 1.0 / rate - step_s <= most_s]
            if usual:
                return min(usual, key=lambda rate: abs(1.0 / rate - step_s))
    whole = float(max(round(1.0 / step_s), 1))
    is_whole = -0.5 * digit_s <= 1.0 / whole - step_s <= _BELOW_ONE * digit_s
    return whole if is_whole else 1.0 / step_s
