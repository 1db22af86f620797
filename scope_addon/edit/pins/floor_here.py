# SPDX-License-Identifier: GPL-3.0-or-later
"""The height of the floor, from a foot that the user says rests on it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver.body import Body
from ...errors import UsageError
from ...kinematics.axes import UP
from ...kinematics.foot_skin import FootSkin
from ..clip import Clip, sample

LOWER = "lower"
_PARTS = {LOWER: slice(0, 4), "left": slice(0, 2), "right": slice(2, 4)}


def foot_height(
    clip: Clip, body: Body, betas: NDArray[np.floating[Any]], time: float, foot: str
) -> float:
    """Return the height in metres of the lowest skin of a foot at a time.

    :param betas: (P,) shape coefficients.
    :param time: seconds, on the clip's clock.
    :param foot: "left", "right" or "lower", which is the lower one of the two.
    :raises UsageError: the foot is none of these.
    """
    if foot not in _PARTS:
        raise UsageError(f"the foot must be left, right or lower, not {foot!r}")
    betas = np.asarray(betas, float)
    at = sample(clip, np.array([time]))
    poses = body.forward_kinematics(at.rotations, at.root - body.rest_joints(betas)[0], betas)
    heights = FootSkin(body, betas).heights(*poses, UP)[0]
    return float(heights[_PARTS[foot]].min())
