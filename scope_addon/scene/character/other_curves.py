# SPDX-License-Identifier: GPL-3.0-or-later
"""The curves that a capture has beside those of the bones' motion: measurements and contact on the
bones, shape and expressions on the body.

A loop cuts them to its cycle, so that the whole action, and a strip of it in the NLA, is as long as
the cycle. Whoever restores the whole motion restores them from the captured one.
"""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ....solver.body import Body
from ...motion import Motion
from ..animation_data.actions import (
    bone_property_path,
    fcurves,
    read_keys,
    rewrite_keys,
    shape_key_path,
)
from .confidence_curves import measurements_of
from .keys import channel_curves
from .shape_keys import shape_key_name

_CONSTANT = "CONSTANT"


def cut_to_cycle(armature: bpy.types.Object, body: Body, first: float, last: float) -> None:
    """Cut the curves to scene frames, with a key at both ends; a curve of one key has it at the
    first.
    """
    moving = {(curve.data_path, curve.array_index) for curve in channel_curves(armature, body)}
    for curve in _curves(armature):
        if (curve.data_path, curve.array_index) in moving or not len(curve.keyframe_points):
            continue
        frames, values = read_keys(curve).T.astype(float)
        interpolation = curve.keyframe_points[0].interpolation
        is_constant = len(frames) == 1 or interpolation == _CONSTANT
        inside = (frames > first) & (frames < last)
        at = np.array([first]) if len(frames) == 1 else np.r_[first, frames[inside], last]
        kept = np.array([curve.evaluate(frame) for frame in at])
        rewrite_keys(curve, at, kept, _CONSTANT if is_constant else "LINEAR")


def restore_whole_motion(
    armature: bpy.types.Object, body: Body, motion: Motion, frames: NDArray[np.float64]
) -> None:
    """Give the curves the keys of the whole captured motion again, at scene frames (T,).

    Curves that the user has removed stay removed.
    """
    values = {
        bone_property_path(*names): column
        for names, column in measurements_of(body, motion).items()
    }
    if motion.face:
        names = motion.face["expression_names"].tolist()
        weights = motion.face["expressions"].astype(float)
        values |= {shape_key_path(name): weights[:, k] for k, name in enumerate(names)}
    shape = {
        shape_key_path(shape_key_name(p)): np.full(len(frames), beta)
        for p, beta in enumerate(motion.betas)
    }
    for curve in _curves(armature):
        is_shape = curve.data_path in shape
        column = shape.get(curve.data_path, values.get(curve.data_path))
        if column is None:
            continue
        known = np.isfinite(column)
        if len(curve.keyframe_points) == 1:  # it never changes
            known &= np.arange(len(column)) == np.flatnonzero(known)[0]
        interpolation = _CONSTANT if is_shape or known.sum() == 1 else "LINEAR"
        rewrite_keys(curve, frames[known], np.asarray(column)[known], interpolation)


def _curves(armature: bpy.types.Object) -> list[bpy.types.FCurve]:
    """Return the curves of an armature and of its meshes' shape keys that this file may change."""
    keys = [
        getattr(obj.data, "shape_keys", None)
        for obj in armature.children_recursive
        if obj.type == "MESH"
    ]
    blocks = [armature, *dict.fromkeys(block for block in keys if block is not None)]
    return [curve for block in blocks if block.library is None for curve in fcurves(block)]
