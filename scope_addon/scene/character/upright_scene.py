# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving a captured person's keys and the capture's camera by a rigid transform of the captured world."""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix, Quaternion
from numpy.typing import NDArray

from ....solver.body import Body
from ...edit.pins.upright import moved_clip
from ...errors import UsageError
from ..animation_data.actions import fcurves, read_keys, rewrite_keys
from .animation import on_one_hemisphere
from .keys import read_clip, write_clip
from .root_object import parent_transform, root_object


def move_person(armature: bpy.types.Object, body: Body, rate: float, transform: NDArray[np.float64]) -> None:
    """Move the keys.

    :param rate: scene frames per second.
    :param transform: (4, 4) rigid, of the captured world.
    :raises UsageError: the root motion is on an object, or keys are missing.
    """
    if root_object(armature) is not None:
        raise UsageError(f"the root motion of '{armature.name}' is on an object; put it back with In Bones first")
    clip, frames = read_clip(armature, body, rate)
    write_clip(armature, body, moved_clip(clip, transform), frames)


def move_camera(camera: bpy.types.Object, armature: bpy.types.Object, transform: NDArray[np.float64]) -> None:
    """Move the capture's camera, with its keys, together with a person.

    :param transform: (4, 4) rigid, of the captured world, in which the armature's keys are.
    """
    bpy.context.view_layer.update()
    world, above = armature.matrix_world, parent_transform(camera)
    move = above.inverted_safe() @ world @ Matrix(transform.tolist()) @ world.inverted_safe() @ above
    curves = {(c.data_path, c.array_index): c for c in fcurves(camera)}
    wanted = [("location", k) for k in range(3)] + [("rotation_quaternion", k) for k in range(4)]
    if not all(key in curves for key in wanted):
        camera.matrix_basis = move @ camera.matrix_basis
        return
    keys = [read_keys(curves[key]) for key in wanted]
    frames = keys[0][:, 0].astype(float)
    values = np.stack([np.interp(frames, k[:, 0], k[:, 1]) for k in keys], axis=1)
    moved = [
        (move @ Matrix.LocRotScale(row[:3], Quaternion(row[3:]).normalized(), None)).decompose()[:2]
        for row in values.tolist()
    ]
    values[:, :3] = [tuple(location) for location, _ in moved]
    values[:, 3:] = on_one_hemisphere(np.array([tuple(rotation) for _, rotation in moved]))
    for column, key in enumerate(wanted):
        rewrite_keys(curves[key], frames, values[:, column])
