# SPDX-License-Identifier: GPL-3.0-or-later
"""Warnings about feet that are not on the floor: other floors, steps, and whatever is still under it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ....solver.body import Body
from ...counts import counted
from ...kinematics.foot_skin import UNDER_FLOOR_M, foot_heights, lower_floors, steps, upper_floors
from ...motion import Motion
from .clock import at_times

_ESTIMATED = "somebody is taller or smaller than estimated: give everybody's height"
_GIVEN = "the heights are given in another order than the people, the most prominent first"


def floor_warnings(name: str, body: Body, motions: list[Motion], heights_given: int = 0) -> list[str]:
    """List in sentences where people stand on other floors or on steps, and where feet are under the floor.

    There are none on uneven ground, which has no floor.

    :param name: the footage's.
    :param body: that of the motions.
    :param heights_given: of how many people the height was known.
    """
    warnings = []
    for number, motion in enumerate(motions, 1):
        if motion.uneven_ground:
            continue
        who = "the person" if len(motions) == 1 else f"person {number}"
        heights = foot_heights(motion, body)
        scale = "" if len(motions) == 1 else _GIVEN if heights_given >= len(motions) else _ESTIMATED
        about = [
            *_other_floors(who, heights, motion, scale),
            *_steps(who, body, motion),
            *_under_floor(who, heights, motion),
        ]
        warnings += [f"{name}: {text}" for text in about]
    return warnings


def _other_floors(who: str, heights: NDArray[np.float64], motion: Motion, scale: str) -> list[str]:
    """List the other floors of a person.

    :param scale: what else puts a person off the floor of another from the first frame on; empty for one person. With a
        size that is wrong by a quarter, a person is a quarter too near or too far, and so above or below the others.
    """
    texts = []
    for side, find in (("below", lower_floors), ("above", upper_floors)):
        spans = find(heights, motion.foot_contact, motion.timestamps)
        if spans:
            most = max(float(np.abs(heights[slice(*span)].min(axis=1)).max()) for span in spans)
            when = at_times([float(motion.timestamps[first]) for first, _ in spans])
            whole = "capture the part that matters, with a start and end time, or with uneven ground"
            if scale and spans[0][0] <= motion.valid.argmax():
                cause = f", so either {scale}; or the clip has more than one floor: {whole}"
            else:
                cause = f", so the clip has more than one floor: {whole}"
            texts.append(f"{who} stands up to {most:.1f} m {side} the floor {when}{cause}")
    return texts


def _steps(who: str, body: Body, motion: Motion) -> list[str]:
    if np.array_equal(motion.poses, motion.poses_raw):
        return []
    rests = steps(foot_heights(motion, body, raw=True), motion.foot_contact, motion.timestamps)
    if not rests:
        return []
    first, height = max(rests, key=lambda rest: abs(rest[1]))
    side, when = "above" if height > 0 else "below", at_times([float(motion.timestamps[first])])
    return [
        f"the feet of {who} rest {100 * abs(height):.0f} cm {side} the floor {when}, as on a step; they were put on "
        "it. For stairs and slopes, capture with uneven ground"
    ]


def _under_floor(who: str, heights: NDArray[np.float64], motion: Motion) -> list[str]:
    lowest = heights.min(axis=1)
    for span in lower_floors(heights, motion.foot_contact, motion.timestamps):
        lowest[slice(*span)] = 0.0
    count = int((lowest < -UNDER_FLOOR_M).sum())
    if not count:
        return []
    deepest = -100 * float(lowest.min())
    return [f"a foot of {who} is up to {deepest:.0f} cm under the floor in {count} of {counted(len(motion), 'frame')}"]
