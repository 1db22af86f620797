# SPDX-License-Identifier: GPL-3.0-or-later
"""How far pins put feet under the floor. The fit keeps them above it unless a pin asks for more."""

from __future__ import annotations

import numpy as np

from ....solver.body import Body
from ...kinematics.foot_skin import UNDER_FLOOR_M, foot_heights
from ...motion import Motion
from .corrected_motion import corrections_of, with_corrections
from .corrections import Contact, Pin

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
