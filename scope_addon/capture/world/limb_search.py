# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of the two poses of a limb that look alike in the image fits the clip better.

The fit of a clip ends in the nearest minimum. Where a limb points far towards the camera or away
from it, the mirrored limb (`kinematics.mirrored_limbs`) often has a minimum of its own, and the
pose that the frames were started from, which the lifting network could not tell from the other, may
be the worse one. For as long as a bone keeps to one side, it is therefore mirrored and fitted
again, first in some frames alone. If it stays on the other side and costs no more there, the frames
around are fitted together from both poses, and the cheaper one is kept.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver import Body, MotionFit, MotionPrior, State
from ...arrays import Float64Array
from ...kinematics.mirrored_limbs import LIMBS, bone_depths, mirrored_limb, runs_of_one_sign
from .clip_window import ClipWindow

# A bone is mirrored while it is deeper, if it gets so deep.
SHALLOW_M = 0.03
DEEP_M = 0.1
_MIN_CHANGE_M = 0.1  # by which a limb that has a minimum of its own differs
# The cost that the mirrored limb may add to frames alone, in the mean and to one.
_MAX_COST = 5.0
_MAX_COST_OF_ONE = 30.0
_MIN_GAIN = 10.0  # of cost, over the frames that are fitted together
_LONGEST_S = 2.0  # of a bone on one side; longer trials cost much, and none has found a better pose
_SAMPLES = 5  # further frames of a run that are tried alone
_MARGIN = 8  # frames before and after
_STEPS = 8  # of a trial, after which a better pose costs less already
# Whether the upper and the lower bone of a limb are mirrored.
_BONES = (True, False), (False, True), (True, True)


@dataclass(frozen=True)
class _Motion:
    """A motion: states, and rotations (n, K+1, 3, 3) and joints (n, K+1, 3) of the parts."""

    states: list[State]
    R: Float64Array
    joints: Float64Array


def search_limbs(
    body: Body, window: ClipWindow, found: MotionFit, prior: MotionPrior
) -> list[State] | None:
    """Return the states of a better motion to start from, or None if none was found.

    :param found: the fit of all frames of the window.
    :param prior: what couples the frames that are fitted again.
    """
    motion = given = _Motion(list(found.states), found.R_world_part, found.t_world_part)
    times = window.times
    for names in LIMBS:
        first, second, last = (body.joint_names.index(name) for name in names)
        limb = first, second, last
        for upper, lower in _BONES:
            start, end = (first, second) if upper else (second, last)
            depths = bone_depths(motion.joints[:, start], motion.joints[:, end], window.center)
            for rows in runs_of_one_sign(depths, SHALLOW_M, DEEP_M):
                if times[rows.stop - 1] - times[rows.start] > _LONGEST_S:
                    continue
                other = _mirrored(body, motion, window.center, rows, limb, upper, lower)
                if _may_be_better(window, motion.states, other, limb, _some_deep(depths, rows)):
                    motion = _better(window, motion, rows, other, prior)
    return None if motion is given else motion.states


def _mirrored(
    body: Body,
    motion: _Motion,
    center: Float64Array,
    rows: slice,
    limb: tuple[int, int, int],
    upper: bool,
    lower: bool,
) -> list[State]:
    """Return the states of all frames, with the limb mirrored in those of ``rows``."""
    turned = mirrored_limb(
        body.parents, motion.R[rows], motion.joints[rows], center[rows], limb, upper, lower
    )
    states = list(motion.states)
    for row, pair in zip(range(rows.start, rows.stop), turned, strict=True):
        Omega = np.array(states[row].Omega)
        Omega[[limb[0] - 1, limb[1] - 1]] = pair
        states[row] = replace(states[row], Omega=Omega)
    return states


def _some_deep(depths: Float64Array, rows: slice) -> list[int]:
    """Return some frames of a run in which the bone is deep, the deepest first."""
    deep = rows.start + np.flatnonzero(np.abs(depths[rows]) > DEEP_M)
    some = np.linspace(0, len(deep) - 1, _SAMPLES).astype(int)
    return [int(k) for k in (deep[np.abs(depths[deep]).argmax()], *deep[some])]


def _may_be_better(
    window: ClipWindow,
    states: list[State],
    other: list[State],
    limb: tuple[int, int, int],
    rows: list[int],
) -> bool:
    """Whether the first of some frames, alone, keeps to the mirrored limb, and all cost hardly more
    with it.
    """
    added: list[float] = []
    ends = list(limb[1:])
    for row in rows:
        now = window.fit_alone(row, states[row])
        then = window.fit_alone(row, other[row])
        change: NDArray[Any] = np.linalg.norm(
            then.t_camera_part[ends] - now.t_camera_part[ends], axis=1
        )
        added.append(float(then.cost - now.cost))
        if added[0] > _MAX_COST or not (len(added) > 1 or change.max() > _MIN_CHANGE_M):
            return False
    return float(np.mean(added)) < _MAX_COST and max(added) < _MAX_COST_OF_ONE


def _better(
    window: ClipWindow, motion: _Motion, rows: slice, other: list[State], prior: MotionPrior
) -> _Motion:
    """Return the motion with the mirrored limb of ``other`` if the frames around cost less with it,
    or as it is.
    """
    around = slice(max(rows.start - _MARGIN, 0), min(rows.stop + _MARGIN, len(other)))
    now = window.fit(around, motion.states[around], prior, steps=_STEPS)
    then = window.fit(around, other[around], prior, steps=_STEPS)
    if not now.cost - then.cost > _MIN_GAIN:
        return motion
    states = list(motion.states)
    R = motion.R.copy()
    joints = motion.joints.copy()
    states[around] = then.states
    R[around] = then.R_world_part
    joints[around] = then.t_world_part
    return _Motion(states, R, joints)
