# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether bones can be the body parts that they were taken for, by where they lie at rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_SIDES = ("left", "right")
# Both segments of a limb are about equally long: the longer one at most this many times.
_MAX_SEGMENT_RATIO = 4.0
# The same segment of both sides.
_MAX_SIDE_RATIO = 1.5
# Of the line from the hips to the head, from the vertical.
_MAX_LEAN = np.radians(50)


@dataclass(frozen=True)
class Fault:
    """Body parts whose bones cannot be right, and why."""

    parts: tuple[str, ...]
    reason: str  # a key of the phrases of ``notices.py``


def rest_faults(heads: Mapping[str, NDArray[np.float64]]) -> list[Fault]:
    """Return what is impossible about a map, by the heads (3,) of the parts at rest, z up."""
    faults: list[Fault] = []
    lengths: dict[tuple[str, str, str], float] = {}
    for side in _SIDES:
        for limb in (("hip", "knee", "ankle"), ("shoulder", "elbow", "wrist")):
            parts = tuple(f"{side}_{part}" for part in limb)
            if not all(part in heads for part in parts):
                continue
            upper, lower = (
                float(np.linalg.norm(heads[b] - heads[a]))
                for a, b in zip(parts, parts[1:], strict=False)
            )
            lengths[side, limb[0], limb[1]] = upper
            lengths[side, limb[1], limb[2]] = lower
            if max(upper, lower) > _MAX_SEGMENT_RATIO * min(upper, lower):
                faults.append(Fault(parts, "segments"))
            elif limb[0] == "hip" and heads[parts[2]][2] > heads[parts[0]][2]:
                faults.append(Fault(parts, "upwards"))
    for (side, first, second), length in lengths.items():
        other = lengths.get(("right", first, second))
        if side == "left" and other is not None:
            longer, shorter = max(length, other), min(length, other)
            if longer > _MAX_SIDE_RATIO * shorter:
                parts = tuple(f"{each}_{part}" for part in (first, second) for each in _SIDES)
                faults.append(Fault(parts, "sides"))
    hips = [heads[f"{side}_hip"] for side in _SIDES if f"{side}_hip" in heads]
    if len(hips) == 2 and "head" in heads:
        up = heads["head"] - (hips[0] + hips[1]) / 2
        if up[2] < np.cos(_MAX_LEAN) * np.linalg.norm(up):
            faults.append(Fault(("head", "left_hip", "right_hip"), "lying"))
    return faults


def faces_backwards(heads: Mapping[str, NDArray[np.float64]]) -> bool | None:
    """Return whether the toes of both feet point to where the back should be: then the sides are
    confused. None without toes.

    :param heads: (3,) of each part at rest, z up.
    """
    needed = [f"{side}_{part}" for side in _SIDES for part in ("hip", "ankle", "foot")]
    if not all(part in heads for part in needed):
        return None
    left = heads["left_hip"] - heads["right_hip"]
    forward = np.cross(left, [0.0, 0.0, 1.0])
    toes = [heads[f"{side}_foot"] - heads[f"{side}_ankle"] for side in _SIDES]
    return all(toe @ forward < -0.3 * np.linalg.norm(toe) * np.linalg.norm(forward) for toe in toes)
