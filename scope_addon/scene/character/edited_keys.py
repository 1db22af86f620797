# SPDX-License-Identifier: GPL-3.0-or-later
"""The edits that a motion keeps, applied to keys, which may differ from the motion.

Who interpolates frames or puts feet on the floor means what is displayed. So the keys are edited
themselves, and so is the clip that they are compared with; then the change of the motion, as by
pins, is applied to them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ....solver.body import Body
from ...edit.clip import Clip
from ...edit.corrected_motion import corrections_of
from ...edit.corrections import Correction, FeetOnFloor, Interpolation, feet_on_floor
from ...edit.edits import edited, floor_above, interpolated, on_floor
from ...edit.root_motion import relative_to_trajectory, with_trajectory
from ...edit.solve_pins import Shot
from ...motion import Motion
from .keys import read_clip, write_keys
from .root_object import removed_root_motion

_SAME_M = 0.0005


@dataclass(frozen=True)
class KeyEdits:
    """The corrections of a motion, the last one among them, and the keys that are to be edited."""

    corrections: tuple[Correction, ...]
    betas: NDArray[np.floating[Any]]  # (P,) shape coefficients
    shot: Shot  # on the clock of the keys
    new: Correction | None  # which is applied to all keys
    # (T,) keys that begin without corrections, to which all edits are applied
    rows: NDArray[np.bool_]

    def any(self) -> bool:
        """Return whether there is an edit among the corrections."""
        return any(isinstance(c, Interpolation | FeetOnFloor) for c in self.corrections)


def begin_with_edits(
    armature: bpy.types.Object,
    body: Body,
    clips: tuple[Clip, Clip],
    frames: NDArray[np.float64],
    edits: KeyEdits,
) -> tuple[Clip, Clip]:
    """Edit keys, and the clip that they are compared with.

    :param clips: the keys, in the world that the corrections have moved; and the other one, in the
        captured world.
    :param frames: (T,) scene frames of the keys.
    :return: both, edited in the rows that an edit is applied to.
    :raises UsageError: a new interpolation has no keys, or none on one side.
    """
    keys, old = clips
    for each in (c for c in edits.corrections if isinstance(c, Interpolation)):
        new = each == edits.new
        rows = np.ones(len(frames), bool) if new else edits.rows
        keys = _replaced(keys, rows, interpolated(keys, [each], edits.shot, strict=new).rows(rows))
        old = _replaced(old, rows, interpolated(old, [each], edits.shot).rows(rows))
    feet = feet_on_floor(edits.corrections)
    # The floor of a few keys would not be that of all; others have the change of the motion.
    enough = (
        edits.rows.all()
        if isinstance(edits.new, FeetOnFloor)
        else 2 * edits.rows.sum() > len(frames)
    )
    if feet is None or not enough:
        return keys, old
    height = floor_above(edits.corrections, feet)
    placed = floored(
        armature, body, edits.betas, (keys.rows(edits.rows), frames[edits.rows]), feet, height
    )
    others = tuple(c for c in edits.corrections if not isinstance(c, Interpolation))
    compared = edited(old.rows(edits.rows), body, edits.betas, others, edits.shot)
    return _replaced(keys, edits.rows, placed), _replaced(old, edits.rows, compared)


def meet_floor(
    armature: bpy.types.Object, body: Body, rate: float, motion: Motion, edits: KeyEdits
) -> None:
    """Put feet on the floor whose keys were edited, if they are not there although those of the
    motion are.

    :param rate: scene frames per second.
    """
    feet = feet_on_floor(corrections_of(motion))
    if feet is None:
        return
    clip, frames = read_clip(armature, body, rate)
    height = floor_above(edits.corrections, feet)
    placed = floored(armature, body, edits.betas, (clip, frames), feet, height)
    if np.abs(placed.root - clip.root).max() > _SAME_M:
        write_keys(armature, body, placed, frames, np.ones(len(frames), bool))


def floored(
    armature: bpy.types.Object,
    body: Body,
    betas: NDArray[np.floating[Any]],
    keys: tuple[Clip, NDArray[np.float64]],
    feet: FeetOnFloor,
    height: float = 0.0,
) -> Clip:
    """Put the feet of keys on the floor: those in contact are at rest only with their root motion.

    :param betas: (P,) shape coefficients.
    :param keys: the keys, and their scene frames (T,).
    :param height: z of the floor, metres, in the armature's space.
    """
    clip, frames = keys
    positions, angles = removed_root_motion(armature, frames)
    path = positions * [1.0, 1.0, 0.0], angles
    placed = on_floor(with_trajectory(clip, *path), body, betas, feet, height)
    return relative_to_trajectory(placed, *path)


def _replaced(clip: Clip, rows: NDArray[np.bool_], part: Clip) -> Clip:
    """Return a clip with other values in some rows."""
    out = clip.copy()
    out.rotations[rows] = part.rotations
    out.root[rows] = part.root
    return out
