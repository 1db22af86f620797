# SPDX-License-Identifier: GPL-3.0-or-later
"""How far pins put feet under the floor, and how far from it parts stay that shall rest there. The
fit keeps feet above it unless a pin asks for more.
"""

from __future__ import annotations

import numpy as np

from ....solver.body import Body
from ...kinematics.foot_skin import UNDER_FLOOR_M, foot_heights
from ...motion import Motion
from ..clip import clip_from_motion
from .corrected_motion import corrections_of, with_corrections
from .corrections import Contact, Pin
from .solve_pins import lowest_skin, resting_joints

_NOTICED_M = 0.002


def feet_under_floor(motion: Motion, body: Body) -> tuple[float, int]:
    """Return how far a foot is under the floor because of what was measured, metres, and in how
    many frames.

    :param body: the motion's body.
    :return: the largest depth and the number of frames, of feet that are more than
        `UNDER_FLOOR_M` under the floor and lower than without pins; 0 and 0 if there are none,
        and on uneven ground.
    :raises MotionFileError: the motion's corrections are damaged.
    """
    if motion.uneven_ground:
        return 0.0, 0
    free = with_corrections(
        motion, body, tuple(c for c in corrections_of(motion) if not isinstance(c, Contact | Pin))
    )
    lowest, before = (foot_heights(m, body).min(axis=1) for m in (motion, free))
    under = (lowest < -UNDER_FLOOR_M) & (lowest < before - _NOTICED_M)
    return (-float(lowest[under].min()), int(np.count_nonzero(under))) if under.any() else (0.0, 0)


def distance_from_floor(motion: Motion, body: Body, contact: Contact) -> float:
    """Return how far from the floor a part stays at most that rests there, metres; 0 on uneven
    ground, whose height is unknown.

    :param body: the motion's body.
    :param contact: of a part other than a foot.
    """
    rows = np.flatnonzero((motion.frames >= contact.first) & (motion.frames <= contact.last))
    if motion.uneven_ground or not len(rows):
        return 0.0
    clip = clip_from_motion(body, motion, raw=False).rows(rows)
    heights = [
        lowest_skin(clip, body, motion.betas, joint) for joint in resting_joints(contact.part)
    ]
    return float(np.abs(heights).max())
