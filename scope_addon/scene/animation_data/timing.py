# SPDX-License-Identifier: GPL-3.0-or-later
"""Frame rates and the place of each key on Blender's timeline.

Blender holds a rate as the integer ``fps`` over the float ``fps_base``; 29.97 is 30 / 1.001 there, never 29 or 30.
A pose seen at ``timestamp`` seconds is keyed at ``start_frame + timestamp · rate``, so footage of variable frame rate
keeps its timing; keys then lie between whole frames.
"""

from __future__ import annotations

import math
from fractions import Fraction

import bpy
import numpy as np

from ...errors import MotionFileError, UsageError

# Rates this near (frames a second) to a standard one are taken to be that one: 23.976 and 23.98 are 24 / 1.001.
TOLERANCE = 0.005
BROADCAST = tuple(Fraction(n * 1000, 1001) for n in (24, 30, 48, 60, 72, 96, 120, 240))
POLICIES = ("keep", "set")
RATE_POLICIES = (*POLICIES, "resample")
_CYCLE = "scope_cycle"  # custom property of an armature: the cycle's first and last frame, and the scene's before it


def blender_rate(frames_per_second: float) -> tuple[int, float]:
    """``(fps, fps_base)`` with fps / fps_base the rate.

    :raises UsageError: the rate is not a positive number Blender can hold.
    """
    if not math.isfinite(frames_per_second) or not 0.01 <= frames_per_second <= 32767:
        raise UsageError(f"the frame rate must lie between 0.01 and 32767 frames a second, but is {frames_per_second}")
    for rate in BROADCAST:
        if abs(frames_per_second - float(rate)) < TOLERANCE:
            return rate.numerator // 1000, 1.001
    nearest = round(frames_per_second)
    if nearest and abs(frames_per_second - nearest) < TOLERANCE:
        return nearest, 1.0
    fps = math.ceil(frames_per_second)
    return fps, fps / frames_per_second


def scene_rate(scene: bpy.types.Scene) -> float:
    """Frames a second of a scene."""
    fps, base = scene.render.fps, scene.render.fps_base
    # fps_base is a 32-bit float; of the broadcast rates we know the exact value.
    exact = min(BROADCAST, key=lambda rate: abs(float(rate) - fps / base))
    return float(exact) if abs(float(exact) - fps / base) < 1e-5 else fps / base


def set_scene_rate(scene: bpy.types.Scene, frames_per_second: float) -> None:
    """Give the scene this frame rate."""
    scene.render.fps, scene.render.fps_base = blender_rate(frames_per_second)


def key_frames(timestamps: np.ndarray, rate: float, start_frame: float = 0.0) -> np.ndarray:
    """(T,) scene frame of each pose: ``start_frame + timestamp · rate``, fractions kept.

    Keys that miss a whole frame by less than a thousandth, which is what rounding of timestamps makes, are put on it.

    :raises MotionFileError: timestamps are not finite and increasing.
    """
    timestamps = np.asarray(timestamps, float)
    if not np.isfinite(timestamps).all() or (np.diff(timestamps) <= 0).any():
        raise MotionFileError("the motion's timestamps must be finite and increasing; capture the video again")
    frames = start_frame + timestamps * rate
    whole = np.round(frames)
    return np.where(np.abs(frames - whole) < 1e-3, whole, frames)


def set_frame_range(scene: bpy.types.Scene, first: float, last: float) -> None:
    """Let the scene play from the first key to the last, whole frames outwards."""
    start, end = math.floor(first), math.ceil(last)
    scene.frame_end = max(end, scene.frame_start)  # Blender keeps start <= end at every step
    scene.frame_start = start
    scene.frame_end = end


def play_cycle(scene: bpy.types.Scene, armature: bpy.types.Object, first: int, last: int) -> None:
    """Let the scene play a cycle that was cut out of an armature's motion, and remember what it played before."""
    cycle, before = _remembered(armature)
    if cycle != (scene.frame_start, scene.frame_end):
        before = scene.frame_start, scene.frame_end
    scene.frame_start, scene.frame_end = first, last
    armature[_CYCLE] = f"{scene.frame_start} {scene.frame_end} {before[0]} {before[1]}"


def restore_scene_range(scene: bpy.types.Scene, armature: bpy.types.Object) -> None:
    """Let the scene play again what it played before the cycle, unless other frames have been chosen meanwhile."""
    cycle, before = _remembered(armature)
    if _CYCLE in armature:
        del armature[_CYCLE]
    if cycle == (scene.frame_start, scene.frame_end):
        set_frame_range(scene, *before)


def _remembered(armature: bpy.types.Object) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The cycle's frames and those before, empty without a cycle."""
    frames = tuple(int(frame) for frame in armature.get(_CYCLE, "").split())
    return frames[:2], frames[2:]
