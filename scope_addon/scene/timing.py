# SPDX-License-Identifier: GPL-3.0-or-later
"""Frame rates, the position of each key on Blender's timeline, and moving keys and NLA strips for a
scene that gets another rate.

Blender stores a rate as the integer ``fps`` over the float ``fps_base``; 29.97 is 30 / 1.001 there,
never 29 or 30. A pose seen at ``timestamp`` seconds is keyed at ``start_frame + timestamp · rate``,
so footage of variable frame rate keeps its timing; keys then lie between whole frames.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from bpy.types import ID, Action, FCurve, NlaStrip, Object, Scene

from ..arrays import Float64Array, FloatArray, IndexArray
from ..errors import MotionFileError, UsageError
from ..notices import Notice, notice
from .budget import LAST_FRAME
from .datablocks import action_of
from .stored_values import RATE, RATES, stored_rate, stored_text

# Rates within this tolerance (frames per second) of a standard one are taken to be it: 23.98 is 24
# / 1.001.
TOLERANCE = 0.005
BROADCAST = tuple(Fraction(n * 1000, 1001) for n in (24, 30, 48, 60, 72, 96, 120, 240))
POLICIES = ("keep", "set")
RATE_POLICIES = (*POLICIES, "resample")
# custom property of an armature: the frame range of the cycle, and that of the scene before it
_CYCLE = "scope_cycle"
_WHOLE = 1e-3  # keys this close to a whole frame are put on it


def blender_rate(frames_per_second: float) -> tuple[int, float]:
    """Return ``(fps, fps_base)``, whose quotient is the rate.

    :raises UsageError: when Blender cannot store the rate.
    """
    lowest, highest = RATES
    if not lowest <= frames_per_second <= highest:
        raise UsageError(
            f"the frame rate must be between {lowest:g} and {highest:g} frames per second, not "
            f"{frames_per_second}"
        )
    for rate in BROADCAST:
        if abs(frames_per_second - float(rate)) < TOLERANCE:
            return rate.numerator // 1000, 1.001
    nearest = round(frames_per_second)
    if nearest and abs(frames_per_second - nearest) < TOLERANCE:
        return nearest, 1.0
    fps = math.ceil(frames_per_second)
    return fps, fps / frames_per_second


def scene_rate(scene: Scene) -> float:
    """Return the frame rate of a scene, frames per second."""
    fps = scene.render.fps
    base = scene.render.fps_base
    # fps_base is a 32-bit float; the exact value is known for broadcast rates.
    exact = min(BROADCAST, key=lambda rate: abs(float(rate) - fps / base))
    return float(exact) if abs(float(exact) - fps / base) < 1e-5 else fps / base


def set_scene_rate(scene: Scene, frames_per_second: float) -> None:
    """Set the frame rate of a scene.

    :raises UsageError: when Blender cannot store the rate.
    """
    scene.render.fps, scene.render.fps_base = blender_rate(frames_per_second)


def stretched_time_notices(scene: Scene) -> list[Notice]:
    """Say that a scene plays its frames at another speed than that of its frame rate."""
    old = scene.render.frame_map_old
    new = scene.render.frame_map_new
    return [] if old == new else [notice("time_stretched", speed=old / new, old=old, new=new)]


def rows_of_scene_frames(frames: Float64Array) -> tuple[Float64Array, IndexArray]:
    """Return the whole frames (N,) of the scene during which a motion lasts, and the row of the
    pose that is nearest to each.

    :param frames: (T,) scene frame of each pose.
    """
    scene_frames = np.arange(np.floor(frames[0]), np.ceil(frames[-1]) + 1)
    rows = np.round(np.interp(scene_frames, frames, np.arange(len(frames)))).astype(np.intp)
    return scene_frames, rows


def key_frames(timestamps: Float64Array, rate: float, start_frame: float = 0.0) -> Float64Array:
    """Return the scene frame of each pose: ``start_frame + timestamp · rate``, fractions kept.

    Keys within a thousandth of a whole frame are snapped to it, because timestamps are rounded.

    :param timestamps: (T,) seconds.
    :param rate: frames per second of the scene.
    :param start_frame: the scene frame of timestamp 0.
    :return: (T,) scene frames.
    :raises MotionFileError: when timestamps are not finite and increasing.
    """
    timestamps = np.asarray(timestamps, float)
    if not np.isfinite(timestamps).all() or (np.diff(timestamps) <= 0).any():
        raise MotionFileError(
            "the motion's timestamps must be finite and increasing; capture the video again"
        )
    frames = start_frame + timestamps * rate
    whole = np.round(frames)
    return np.where(np.abs(frames - whole) < 1e-3, whole, frames)


def whole_frames_of(frames: Float64Array) -> Float64Array:
    """Return the whole frames (N,) within the span of keys (T,); the nearest if all keys lie
    between two of them.
    """
    whole = np.arange(math.ceil(frames[0] - 1e-4), math.floor(frames[-1] + 1e-4) + 1, dtype=float)
    return whole if len(whole) else np.round(frames[:1])


def store_rate(armature: Object, rate: float) -> None:
    """Store the frame rate for which an armature's keys were written, frames per second."""
    armature[RATE] = rate


def keyed_rate(armature: Object, scene: Scene) -> float:
    """Return the frame rate for which an armature's keys were written; older files do not say, and
    have the scene's.
    """
    return stored_rate(armature, scene_rate(scene))


def show_frame(scene: Scene, frame: float) -> None:
    """Set the current frame, which may lie between two whole ones, and evaluate the scene there."""
    whole = math.floor(frame)
    scene.frame_set(whole, subframe=float(frame - whole))


@contextmanager
def current_frame_kept(scene: Scene) -> Iterator[None]:
    """Go back to the scene's current frame when the block ends."""
    frame, subframe = scene.frame_current, scene.frame_subframe
    try:
        yield
    finally:
        scene.frame_set(frame, subframe=subframe)


def set_frame_range(scene: Scene, first: float, last: float) -> None:
    """Set the scene's frame range to that of the keys, rounded outwards to whole frames."""
    start = math.floor(first)
    end = math.ceil(last)
    scene.frame_end = max(end, scene.frame_start)  # Blender keeps start <= end at every step
    scene.frame_start = start
    scene.frame_end = end


def play_cycle(scene: Scene, armature: Object, first: int, last: int) -> None:
    """Set the scene's frame range to a cycle of an armature's motion, and store the range before
    it.
    """
    cycle, before = _stored_ranges(armature)
    if cycle != (scene.frame_start, scene.frame_end):
        before = scene.frame_start, scene.frame_end
    scene.frame_start = first
    scene.frame_end = last
    armature[_CYCLE] = f"{scene.frame_start} {scene.frame_end} {before[0]} {before[1]}"


def cycle_span(armature: Object) -> tuple[int, int] | None:
    """Return the frames of the first and the last key of an armature's cycle, rounded; None without
    a cycle. The last key is that of the first pose once more, which is not played.
    """
    cycle, _ = _stored_ranges(armature)
    return (cycle[0], cycle[1] + 1) if cycle else None


def retime_cycle(scene: Scene, armature: Object, retiming: Retiming) -> None:
    """Move the stored cycle with the armature's keys, and the scene's frame range if it is that of
    the cycle.
    """
    cycle, before = _stored_ranges(armature)
    if len(cycle) != 2 or len(before) != 2:
        return
    start = math.ceil(retiming.frame(cycle[0]))
    end = math.floor(retiming.frame(cycle[1] + 1)) - 1
    if cycle == (scene.frame_start, scene.frame_end):
        set_frame_range(scene, start, end)
    armature[_CYCLE] = "{} {} {} {}".format(start, end, *retiming.span(*before))


def restore_scene_range(scene: Scene, armature: Object) -> None:
    """Restore the scene's frame range from before the cycle, unless the user has changed it
    meanwhile.
    """
    cycle, before = _stored_ranges(armature)
    if _CYCLE in armature:
        del armature[_CYCLE]
    if cycle == (scene.frame_start, scene.frame_end):
        set_frame_range(scene, *before)


def _stored_ranges(armature: Object) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the frame range of the cycle and the one before it; both are empty without a cycle."""
    found = re.fullmatch(
        r"(-?\d{1,7}) (-?\d{1,7}) (-?\d{1,7}) "
        r"(-?\d{1,7})",
        stored_text(armature, _CYCLE),
        re.ASCII,
    )
    frames = tuple(int(frame) for frame in found.groups()) if found else ()
    if (
        not frames
        or max(map(abs, frames)) > LAST_FRAME
        or frames[0] > frames[1]
        or frames[2] > frames[3]
    ):
        return (), ()
    return frames[:2], frames[2:]


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

    def frames(self, frames: FloatArray) -> Float64Array:
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


def retime_keys(curves: Iterable[FCurve], retiming: Retiming) -> None:
    """Move every key of curves, with its handles."""
    for curve in curves:
        keys = curve.keyframe_points
        for name in ("co", "handle_left", "handle_right"):
            values = np.empty(2 * len(keys), np.float32)
            keys.foreach_get(name, values)
            values[::2] = retiming.frames(values[::2])
            keys.foreach_set(name, values)
        curve.update()


def action_strips(block: ID) -> list[NlaStrip]:
    """Return the NLA strips of a datablock that play an action."""
    animation = getattr(block, "animation_data", None)
    tracks = animation.nla_tracks if animation is not None else ()
    return [s for track in tracks for s in track.strips if s.type == "CLIP" and s.action]


def played_actions(block: ID) -> list[Action]:
    """Return the actions that animate a datablock: its own, and those of its NLA strips."""
    own = action_of(block)
    strips = [strip.action for strip in action_strips(block)]
    return strips if own is None else [own, *strips]


def retime_strip(strip: NlaStrip, retiming: Retiming) -> None:
    """Move an NLA strip, with the part of its action that it plays; the action's keys are not
    moved.
    """
    set_strip_ends(strip, [retiming.frame(frame) for frame in strip_ends(strip)])


def strip_ends(strip: NlaStrip) -> list[float]:
    """Return the first and the last frame of an NLA strip, and of what it plays of its action."""
    return [strip.frame_start, strip.frame_end, strip.action_frame_start, strip.action_frame_end]


def set_strip_ends(strip: NlaStrip, ends: Sequence[float]) -> None:
    """Set what `strip_ends` returns."""
    start, end, first, last = ends
    # Blender keeps the end after the start
    strip.action_frame_end = max(last, strip.action_frame_start + 1.0)
    strip.action_frame_start = first
    strip.action_frame_end = last
    strip.frame_start_raw = start
    strip.frame_end_raw = end
