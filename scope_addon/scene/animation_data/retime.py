# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving keys and NLA strips in time, for a scene that gets another frame rate."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from .actions import fcurves_of

_WHOLE = 1e-3  # keys this close to a whole frame are put on it


@dataclass(frozen=True)
class Retiming:
    """Moves scene frames: ``origin`` stays, and the distance from it is multiplied by
    ``factor``.
    """

    origin: float
    factor: float

    def frame(self, frame: float) -> float:
        """Return where a frame is moved to."""
        return self.origin + self.factor * (frame - self.origin)

    def frames(self, frames: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
        """Return where keys (T,) are moved to; those within their precision of a whole frame are
        put on it.
        """
        moved = self.origin + self.factor * (frames.astype(float) - self.origin)
        whole = np.round(moved)
        near = np.abs(moved - whole) < np.maximum(
            _WHOLE, 4 * self.factor * np.spacing(np.abs(frames))
        )
        return np.where(near, whole, moved)

    def span(self, first: int, last: int) -> tuple[int, int]:
        """Return the whole frames that contain a span of frames after it is moved."""
        return math.floor(self.frame(first) + _WHOLE), math.ceil(self.frame(last) - _WHOLE)


def retime_keys(action: bpy.types.Action, retiming: Retiming) -> None:
    """Move every key of an action, with its handles."""
    for curve in fcurves_of(action):
        keys = curve.keyframe_points
        for name in ("co", "handle_left", "handle_right"):
            values = np.empty(2 * len(keys), np.float32)
            keys.foreach_get(name, values)
            values[::2] = retiming.frames(values[::2])
            keys.foreach_set(name, values)
        curve.update()


def action_strips(animation: bpy.types.AnimData) -> list[bpy.types.NlaStrip]:
    """Return the NLA strips of a datablock that play an action."""
    return [
        s for track in animation.nla_tracks for s in track.strips if s.type == "CLIP" and s.action
    ]


def retime_strip(strip: bpy.types.NlaStrip, retiming: Retiming) -> None:
    """Move an NLA strip, with the part of its action that it plays; the action's keys are not
    moved.
    """
    ends = strip.frame_start, strip.frame_end, strip.action_frame_start, strip.action_frame_end
    start, end, first, last = (retiming.frame(frame) for frame in ends)
    # Blender keeps the end after the start
    strip.action_frame_end = max(last, strip.action_frame_start + 1.0)
    strip.action_frame_start = first
    strip.action_frame_end = last
    strip.frame_start_raw = start
    strip.frame_end_raw = end
