# SPDX-License-Identifier: GPL-3.0-or-later
"""A person's way over the floor on an object of its own, and back into the bones.

The armature hangs below an empty that carries the path; the pelvis keeps what is left. What is seen stays the same.
What the user has hung a captured armature on, the empty hangs on meanwhile.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix

from ....solver.body import Body
from ...edit.clip import Clip
from ...edit.root_motion import floor_trajectory, relative_to_trajectory, with_trajectory
from ...errors import UsageError
from ..animation_data.actions import Channels, fcurves, read_keys
from .keys import read_clip, write_clip

ROOT_TAG = "scope_root"  # custom property of the empty
_LEFT_OUT = "scope_path"  # of one whose armature stays in place: the way that it does not go
_PLACE = "scope_place"  # where the armature stood before its place went with the way: a rigid matrix, row by row


def topmost(armature: bpy.types.Object) -> bpy.types.Object:
    """The armature, or the uppermost of the user's own objects that it hangs on. It is what hangs on the empty."""
    obj = armature
    while obj.parent is not None and ROOT_TAG not in obj.parent:
        obj = obj.parent
    return obj


def root_object(armature: bpy.types.Object) -> bpy.types.Object | None:
    """The empty that carries the armature's way, if it has one."""
    return topmost(armature).parent


def parent_to_root_object(
    armature: bpy.types.Object,
    frames: np.ndarray,
    positions: np.ndarray,
    angles: np.ndarray,
    *,
    in_place: bool = False,
    below_parent: bool = False,
) -> bpy.types.Object:
    """Let an empty carry the armature along a way, in place of one that did so before, whose parent it takes.

    :param frames: (T,) scene frames; positions: (T, 3) metres; angles: (T,) radians about the upright axis.
    :param in_place: it stays where the way begins, and only remembers it.
    :param below_parent: what the armature hangs on carries the empty, instead of being carried along.
    :raises UsageError: what the armature hangs on would be carried along and carries another one too.
    """
    former = root_object(armature)
    top = armature if below_parent else topmost(armature)
    others = [obj for obj in top.children_recursive if obj.type == "ARMATURE" and obj != armature]
    if top != armature and others:
        raise UsageError(
            f"'{armature.name}' hangs on '{top.name}', which would take '{others[0].name}' along; clear its parent, "
            "or keep the way in the bones"
        )
    empty = bpy.data.objects.new(f"{armature.name}_root", None)
    empty.empty_display_type, empty.empty_display_size = "ARROWS", 0.3
    empty[ROOT_TAG] = armature.name
    own = [c for c in armature.users_collection if c.library is None and c.override_library is None]
    for collection in own or [bpy.context.scene.collection]:  # to another file's collections nothing can be added
        collection.objects.link(empty)
    empty.location, empty.rotation_euler = positions[0], (0.0, 0.0, angles[0])
    if in_place:
        rows = np.concatenate([frames[:, None], positions[:, :2], angles[:, None]], axis=1)
        empty[_LEFT_OUT] = rows.ravel().tolist()
    else:
        channels, still = Channels(empty, bpy.data.actions.new(empty.name)), np.zeros_like(angles)
        channels.write("location", frames, positions)
        channels.write("rotation_euler", frames, np.stack([still, still, angles], axis=1))
    _hang_alike(empty, former or top)
    top.parent, top.parent_type = empty, "OBJECT"
    top.matrix_parent_inverse.identity()
    if former is not None:
        name = former[ROOT_TAG] + "_root"
        _remove(former)
        empty.name = name
    return empty


def remove_root_object(armature: bpy.types.Object) -> None:
    """Remove the empty; the armature stays with what its bones hold, and stands and hangs as it did before."""
    top, empty = topmost(armature), root_object(armature)
    if empty is None:
        return
    if _PLACE in empty:
        armature.matrix_basis = _place(empty) @ Matrix.Scale(armature.matrix_basis.median_scale, 4)
    _hang_alike(top, empty)
    _remove(empty)


def carried(obj: bpy.types.Object) -> Matrix:
    """Where the object's parent takes it at the current frame; without one nowhere."""
    if obj.parent is None:
        return Matrix()
    bpy.context.view_layer.update()
    return obj.matrix_world @ obj.matrix_basis.inverted_safe()


def move_root_motion_to_object(armature: bpy.types.Object, body: Body, rate: float, *, in_place: bool, heading: bool) -> None:
    """Take the way out of the bones.

    :param in_place: leave it out altogether: the person stays above the spot where the motion begins.
    :param heading: the turning about the upright axis goes with it.
    """
    clip, frames = read_clip(armature, body, rate)
    clip, former = clip_with_root_motion(armature, clip, frames), root_object(armature)
    if former is None:  # where the user has put the armature now goes with the way
        bpy.context.view_layer.update()
        seen = armature.matrix_world
        if armature.parent is not None:  # which stays and goes on carrying it
            seen = armature.matrix_parent_inverse.inverted_safe() @ armature.matrix_local
        place = Matrix.LocRotScale(seen.translation, seen.to_quaternion(), None)
        armature.matrix_basis = Matrix.Scale(seen.median_scale, 4)
    else:
        place = _place(former)
    size, height = armature.matrix_basis.median_scale, place.translation.z
    clip = _moved(clip, Matrix.Translation((0, 0, -height)) @ place, size)
    positions, angles = floor_trajectory(clip, heading=heading)
    write_clip(armature, body, relative_to_trajectory(clip, positions, angles), frames)
    positions = size * positions + [0.0, 0.0, height]
    empty = parent_to_root_object(armature, frames, positions, angles, in_place=in_place, below_parent=True)
    empty[_PLACE] = [number for row in place for number in row]


def move_root_motion_to_bones(armature: bpy.types.Object, body: Body, rate: float) -> None:
    """Put the way back into the bones and remove the empty. A way that was left out comes back too."""
    if root_object(armature) is None:
        return
    clip, frames = read_clip(armature, body, rate)
    write_clip(armature, body, clip_with_root_motion(armature, clip, frames), frames)
    remove_root_object(armature)


def clip_with_root_motion(armature: bpy.types.Object, clip: Clip, frames: np.ndarray) -> Clip:
    """The clip with the way of its root object, where it has one, also one that was left out: without the object."""
    whole, empty = with_trajectory(clip, *removed_root_motion(armature, frames)), root_object(armature)
    if empty is None:
        return whole
    return _moved(whole, _place(empty).inverted(), armature.matrix_basis.median_scale)


def removed_root_motion(armature: bpy.types.Object, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions (T, 3) and angles (T,) of the way that is not in the bones, also of one that was left out."""
    empty = root_object(armature)
    if empty is None:
        return np.zeros((len(frames), 3)), np.zeros(len(frames))
    if _LEFT_OUT not in empty:
        return _keyed_path(armature, empty, frames)
    rows = np.array(list(empty[_LEFT_OUT])).reshape(-1, 4)
    x, y, angle = (np.interp(frames, rows[:, 0], rows[:, k]) for k in (1, 2, 3))
    positions = np.stack([x, y, np.full(len(x), empty.location.z)], axis=1)
    return positions / armature.matrix_basis.median_scale, angle


def clip_as_displayed(armature: bpy.types.Object, clip: Clip, frames: np.ndarray) -> Clip:
    """The clip as it is seen: where its root object goes, or stands where the way was left out."""
    empty = root_object(armature)
    return clip if empty is None else with_trajectory(clip, *_keyed_path(armature, empty, frames))


def _keyed_path(
    armature: bpy.types.Object, empty: bpy.types.Object, frames: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Positions (T, 3) in the armature's units and angles (T,) at scene frames; where the empty stands without keys."""
    columns = {}
    for curve in fcurves(empty):
        keys = read_keys(curve)
        columns[curve.data_path, curve.array_index] = np.interp(frames, keys[:, 0], keys[:, 1])
    columns = {("rotation_euler", 2): np.full(len(frames), empty.rotation_euler.z)} | columns
    positions = [columns.get(("location", k), np.full(len(frames), empty.location[k])) for k in range(3)]
    return np.stack(positions, axis=1) / armature.matrix_basis.median_scale, columns["rotation_euler", 2]


def _place(empty: bpy.types.Object) -> Matrix:
    """Where the armature stood before."""
    numbers = list(empty.get(_PLACE, ()))
    return Matrix([numbers[k : k + 4] for k in (0, 4, 8, 12)]) if numbers else Matrix()


def _moved(clip: Clip, place: Matrix, size: float) -> Clip:
    """The clip of an armature of some size as it is seen from where that stands."""
    R, rotations = np.array(place.to_3x3()), clip.rotations.copy()
    rotations[:, 0] = R @ rotations[:, 0]
    return Clip(clip.times, rotations, clip.root @ R.T + np.array(place.translation) / size)


def _hang_alike(obj: bpy.types.Object, other: bpy.types.Object) -> None:
    """Let an object hang on what another one hangs on, in the same way."""
    obj.parent = other.parent
    obj.matrix_parent_inverse.identity()
    if other.parent is not None:
        obj.parent_type = other.parent_type
        obj.parent_bone, obj.parent_vertices = other.parent_bone, other.parent_vertices
        obj.matrix_parent_inverse = other.matrix_parent_inverse


def _remove(empty: bpy.types.Object) -> None:
    action = empty.animation_data.action if empty.animation_data else None
    bpy.data.objects.remove(empty)
    if action is not None and action.users == 0:
        bpy.data.actions.remove(action)
