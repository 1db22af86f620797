# SPDX-License-Identifier: GPL-3.0-or-later
"""A person's way over the floor on an object of its own, and back into the bones.

The armature hangs below an empty that carries the path; the pelvis keeps what is left. What is seen stays the same.
"""

from __future__ import annotations

import bpy
import numpy as np

from ...solver.body import Body
from ..edit.clip import Clip
from ..edit.root_motion import floor_path, relative_to_path, with_path
from .actions import Channels, fcurves, read_keys
from .keys import read_clip, write_clip

ROOT_TAG = "scope_root"  # custom property of the empty


def root_object(armature: bpy.types.Object) -> bpy.types.Object | None:
    """The empty that carries the armature's way, if it has one."""
    parent = armature.parent
    return parent if parent is not None and ROOT_TAG in parent else None


def to_root_object(armature: bpy.types.Object, body: Body, rate: float, *, in_place: bool, heading: bool) -> None:
    """Take the way out of the bones.

    :param in_place: leave it out altogether: the person stays above the spot where the motion begins.
    :param heading: the turning about the upright axis goes with it.
    """
    if root_object(armature) is not None:
        to_bones(armature, body, rate)
    clip, frames = read_clip(armature, body, rate)
    positions, angles = floor_path(clip, heading=heading)
    write_clip(armature, body, relative_to_path(clip, positions, angles), frames)
    empty = bpy.data.objects.new(f"{armature.name}_root", None)
    empty.empty_display_type, empty.empty_display_size = "ARROWS", 0.3
    empty[ROOT_TAG] = armature.name
    for collection in armature.users_collection:
        collection.objects.link(empty)
    empty.matrix_world = armature.matrix_world.copy()
    armature.parent = empty
    armature.matrix_parent_inverse.identity()
    armature.matrix_basis.identity()
    if in_place:
        rows = np.concatenate([frames[:, None], positions[:, :2], angles[:, None]], axis=1)
        empty["scope_path"] = rows.ravel().tolist()
        empty.location, empty.rotation_euler = positions[0], (0.0, 0.0, angles[0])
        return
    action = bpy.data.actions.new(empty.name)
    channels = Channels(empty, action)
    channels.write("location", frames, positions)
    channels.write("rotation_euler", frames, np.stack([np.zeros_like(angles), np.zeros_like(angles), angles], axis=1))


def to_bones(armature: bpy.types.Object, body: Body, rate: float) -> None:
    """Put the way back into the bones and remove the empty. A way that was left out comes back too."""
    empty = root_object(armature)
    if empty is None:
        return
    clip, frames = read_clip(armature, body, rate)
    write_clip(armature, body, with_path(clip, *_path_of(empty, frames)), frames)
    armature.parent = None
    armature.matrix_parent_inverse.identity()
    action = empty.animation_data.action if empty.animation_data else None
    bpy.data.objects.remove(empty)
    if action is not None and action.users == 0:
        bpy.data.actions.remove(action)


def path_clip(armature: bpy.types.Object, clip: Clip, frames: np.ndarray) -> Clip:
    """The clip with the way of its root object, where it has one: the motion as it is seen."""
    empty = root_object(armature)
    return clip if empty is None else with_path(clip, *_path_of(empty, frames))


def _path_of(empty: bpy.types.Object, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (T, 3) and angles (T,) at scene frames."""
    if "scope_path" in empty:
        rows = np.array(list(empty["scope_path"])).reshape(-1, 4)
        x, y, angle = (np.interp(frames, rows[:, 0], rows[:, k]) for k in (1, 2, 3))
        return np.stack([x, y, np.zeros_like(x)], axis=1), angle
    columns = {}
    for curve in fcurves(empty):
        keys = read_keys(curve)
        columns[curve.data_path, curve.array_index] = np.interp(frames, keys[:, 0], keys[:, 1])
    zero = np.zeros(len(frames))
    positions = np.stack([columns.get(("location", k), zero) for k in range(3)], axis=1)
    return positions, columns.get(("rotation_euler", 2), zero)
