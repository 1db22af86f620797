# SPDX-License-Identifier: GPL-3.0-or-later
"""The keys as they were before corrections changed them, so that removing corrections restores them
to the bit.

They are stored with the motion's text, for the rows that corrections have changed: one row for each
time at which any curve has a key, one column for each curve, NaN where that curve has no key. A row
whose keys are still as the corrections wrote them is restored; a row that was edited since is not.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from bpy.types import Object

from ....solver.body import Body
from ...arrays import BoolArray, Float32Array, Float64Array
from ...edit.clip import Clip, differ
from ...errors import MotionFileError
from ...untrusted.files import read_npz
from ..actions import read_keys
from ..stored_values import start_frame
from .keys import channel_curves, write_clip

_SAME = 2e-3  # frames; keys are single precision
_HIGHEST_M = 1e3
_NAMES = ("times", "before", "written")


@dataclass(frozen=True)
class UncorrectedKeys:
    """R rows of C curves."""

    # (R,) seconds since timestamp 0, so that they are valid at any frame rate
    times: Float64Array
    before: Float32Array  # (R, C)
    written: Float32Array  # (R, C)
    # Metres by which all keys were raised together with the floor, those of other rows too.
    rise: float = 0.0

    def to_bytes(self) -> bytes:
        """Return the arrays as an .npz file."""
        file = io.BytesIO()
        np.savez_compressed(file, **{name: getattr(self, name) for name in (*_NAMES, "rise")})
        return file.getvalue()

    @staticmethod
    def from_bytes(content: object, curves: int) -> UncorrectedKeys:
        """Read what ``to_bytes`` returned; without rows if it is something else: a .blend file may
        be hostile.
        """
        no_rows = np.zeros((0, curves), np.float32)
        none = UncorrectedKeys(np.zeros(0), no_rows, no_rows)
        if not isinstance(content, bytes):
            return none
        try:
            found = read_npz(Path("keys"), MotionFileError, "record of keys", content)
            times, before, written = (np.asarray(found[name], float) for name in _NAMES)
            rise = float(found["rise"])
        except (MotionFileError, KeyError, ValueError, TypeError):
            return none
        shapes = times.ndim == 1 and before.shape == written.shape == (len(times), curves)
        if not shapes or not np.isfinite(times).all() or np.isinf(before).any():
            return none
        if not abs(rise) < _HIGHEST_M:
            return none
        return UncorrectedKeys(times, before.astype(np.float32), written.astype(np.float32), rise)


def keyed_values(armature: Object, body: Body, frames: Float32Array) -> Float32Array:
    """Return the keys' values (T, C) at scene frames (T,); NaN where a curve has no key."""
    curves = channel_curves(armature, body)
    out = np.full((len(frames), len(curves)), np.nan, np.float32)
    for column, curve in enumerate(curves):
        keys = read_keys(curve)
        at = np.clip(np.searchsorted(keys[:, 0], frames - _SAME), 0, len(keys) - 1)
        there = np.abs(keys[at, 0] - frames) < _SAME
        out[there, column] = keys[at[there], 1]
    return out


def restore(
    armature: Object, body: Body, start: float, rate: float, known: UncorrectedKeys
) -> set[int]:
    """Give the rows that are as the corrections wrote them the keys from before; remove keys that
    were added.

    :param start: scene frame of timestamp 0.
    :param rate: scene frames per second.
    :return: the numbers of the restored rows.
    """
    frames = (start + known.times * rate).astype(np.float32)
    now = keyed_values(armature, body, frames)
    same = (now == known.written) | (np.isnan(now) & np.isnan(known.written))
    rows = np.flatnonzero(same.all(axis=1) & ~np.isnan(now).all(axis=1))
    for column, curve in enumerate(channel_curves(armature, body)):
        values = known.before[rows, column]
        keys = curve.keyframe_points
        there = ~np.isnan(now[rows, column])
        coordinates = read_keys(curve)
        at = np.clip(
            np.searchsorted(coordinates[:, 0], frames[rows] - _SAME), 0, len(coordinates) - 1
        )
        put = there & ~np.isnan(values)
        coordinates[at[put], 1] = values[put]
        keys.foreach_set("co", coordinates.ravel())
        for index in sorted(at[there & np.isnan(values)].tolist(), reverse=True):
            keys.remove(keys[index], fast=True)
        curve.update()
    return set(rows.tolist())


def write_both(
    armature: Object, body: Body, free: Clip, corrected: Clip, frames: Float64Array, rate: float
) -> UncorrectedKeys:
    """Replace all keys by those of a corrected clip, at scene frames (T,).

    :param free: without corrections.
    :param rate: scene frames per second.
    :return: the keys that the corrections change.
    """
    keyed_frames = frames.astype(np.float32)
    write_clip(armature, body, free, frames)
    before = keyed_values(armature, body, keyed_frames)
    write_clip(armature, body, corrected, frames)
    after = keyed_values(armature, body, keyed_frames)
    rows = differ(free, corrected)
    return changed_rows(keyed_frames, rows, before, after, start_frame(armature), rate)


def changed_rows(
    frames: Float32Array,
    rows: BoolArray,
    before: Float32Array,
    after: Float32Array,
    start: float,
    rate: float,
) -> UncorrectedKeys:
    """Return rows that corrections have changed, even if not by as much as a key's precision.

    :param frames: (T,) scene frames.
    :param rows: (T,) which rows.
    :param before, after: (T, C) the keys.
    :param start: scene frame of timestamp 0.
    :param rate: scene frames per second.
    """
    return UncorrectedKeys((frames[rows].astype(float) - start) / rate, before[rows], after[rows])
