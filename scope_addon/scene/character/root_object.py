# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving root motion from the bones to a separate root object, and back.

The root object is an empty that is animated with the root trajectory. It becomes the parent of the
armature, and the pelvis keeps the rest of the motion, so what is displayed does not change. An
existing parent of a captured armature becomes the parent of the empty.
"""

from __future__ import annotations

import bpy
import numpy as np
from bpy.types import Object
from mathutils import Matrix

from ....solver.body import Body
from ...arrays import Float64Array
from ...edit.clip import Clip, floor_trajectory, relative_to_trajectory, with_trajectory
from ...edit.edits import moved_clip
from ...errors import UsageError
from ..actions import (
    Channels,
    add_cycles,
    check_not_in_nla,
    check_not_moved_by_nla,
    fcurves,
    is_cyclic,
    read_keys,
    used_slot,
)
from ..datablocks import ROOT_TAG, action_of, remove_blocks
from ..packed_motion import apart_at_cuts
from ..stored_values import stored_numbers
from ..timing import Retiming
from ..visibility import world_matrix
from .keys import read_clip, write_clip

# of an empty whose armature stays in place: the trajectory it does not follow
_UNUSED_TRAJECTORY = "scope_path"
# properties with an object's transform
_TRANSFORM = ("location", "rotation_euler", "rotation_quaternion", "rotation_axis_angle", "scale")
_RIGID = 1e-3  # by how much the determinant of a rigid transform may differ from 1
# the armature's transform before it became part of the trajectory: a rigid matrix by rows
_PLACE = "scope_place"


def topmost(armature: Object) -> Object:
    """Return the armature, or the topmost of its parents below the root object: the child of the
    root object.
    """
    obj = armature
    while obj.parent is not None and ROOT_TAG not in obj.parent:
        obj = obj.parent
    return obj


def root_object(armature: Object) -> Object | None:
    """Return the empty with the armature's root motion, or None."""
    return topmost(armature).parent


def parent_to_root_object(
    armature: Object,
    frames: Float64Array,
    positions: Float64Array,
    angles: Float64Array,
    *,
    in_place: bool = False,
    below_parent: bool = False,
) -> Object:
    """Parent the armature to a new empty that follows a trajectory, and replace a former root
    object.

    The parent of the former root object becomes that of the new one, and so do its other children,
    unless another armature has its root motion there: then it stays.

    :param frames: (T,) scene frames.
    :param positions: (T, 3) metres.
    :param angles: (T,) about the vertical, radians.
    :param in_place: the empty stays at the start of the trajectory, and only stores it.
    :param below_parent: insert the empty between the armature and its parent, instead of above the
        topmost parent.
    :raises UsageError: when the topmost parent would move along and has another armature below it.
    """
    former = root_object(armature)
    top = armature if below_parent else topmost(armature)
    others = [obj for obj in top.children_recursive if obj.type == "ARMATURE" and obj != armature]
    if top != armature and others:
        raise UsageError(
            f"'{armature.name}' is parented to '{top.name}', and '{others[0].name}' would move "
            "along; clear the "
            "parent, or keep the root motion in the bones"
        )
    empty = bpy.data.objects.new(f"{armature.name}_root", None)
    empty.empty_display_type = "ARROWS"
    empty.empty_display_size = 0.3
    empty[ROOT_TAG] = armature.name
    own = [c for c in armature.users_collection if c.library is None and c.override_library is None]
    for collection in own or [bpy.context.scene.collection]:  # linked collections cannot be changed
        collection.objects.link(empty)
    empty.location = positions[0]
    empty.rotation_euler = (0.0, 0.0, angles[0])
    if in_place:
        rows = np.concatenate([frames[:, None], positions[:, :2], angles[:, None]], axis=1)
        empty[_UNUSED_TRAJECTORY] = rows.ravel().tolist()
    else:
        channels = Channels(empty, bpy.data.actions.new(empty.name))
        zero = np.zeros_like(angles)
        channels.write("location", frames, positions)
        channels.write("rotation_euler", frames, np.stack([zero, zero, angles], axis=1))
    _copy_parenting(empty, former or top)
    top.parent = empty
    top.parent_type = "OBJECT"
    top.matrix_parent_inverse.identity()
    if former is not None:
        below = former.children_recursive
        if not any(obj.type == "ARMATURE" for obj in below):
            for child in former.children:
                child.parent = empty
        _remove_unless_parent(former)
        empty.name = f"{armature.name}_root"  # the take may have been renamed since
    return empty


def remove_root_object(armature: Object) -> None:
    """Remove the root object; the armature gets its former transform and parent and keeps the
    motion of its bones.

    A root object stays if something else is parented to it.
    """
    top = topmost(armature)
    empty = root_object(armature)
    if empty is None:
        return
    if _PLACE in empty:
        size = armature.matrix_basis.median_scale
        armature.matrix_basis = _place_now(empty) @ Matrix.Scale(size, 4)
    _copy_parenting(top, empty)
    _remove_unless_parent(empty)


def parent_transform(obj: Object) -> Matrix:
    """Return the transform (4, 4) that an object inherits at the current frame; the identity
    without a parent.
    """
    if obj.parent is None:
        return Matrix()
    return world_matrix(obj) @ obj.matrix_basis.inverted_safe()


def move_root_motion_to_object(
    armature: Object, body: Body, rate: float, *, in_place: bool, heading: bool
) -> None:
    """Move the root motion from the bones to a root object.

    :param rate: scene frames per second.
    :param in_place: do not animate the object: the person stays where the motion begins.
    :param heading: include the rotation about the vertical.
    :raises UsageError: when a bone or its keys are missing, another object has the same keys, the
        armature's scale is 0, or keys or constraints move the armature itself.
    """
    check_own_action(armature)
    clip, frames = read_clip(armature, body, rate)
    if not armature.matrix_basis.median_scale:
        raise UsageError(
            f"'{armature.name}' has the scale 0, so its motion cannot be moved; give "
            "it another one first"
        )
    clip = clip_with_root_motion(armature, clip, frames)
    former = root_object(armature)
    if former is None:  # the armature's own transform becomes part of the trajectory
        _check_own_transform(armature)
        seen = world_matrix(armature)
        if armature.parent is not None:  # stays the parent, so its transform is not included
            seen = armature.matrix_parent_inverse.inverted_safe() @ armature.matrix_local
        place = Matrix.LocRotScale(seen.translation, seen.to_quaternion(), None)
        armature.matrix_basis = Matrix.Scale(seen.median_scale, 4)
    else:
        place = _place_now(former)
    size = armature.matrix_basis.median_scale
    height = place.translation.z
    clip = _moved(clip, Matrix.Translation((0, 0, -height)) @ place, size)
    apart = apart_at_cuts(armature, clip, rate)
    positions, angles = floor_trajectory(apart, heading=heading)
    write_clip(armature, body, relative_to_trajectory(clip, positions, angles), frames)
    positions = size * positions + [0.0, 0.0, height]
    empty = parent_to_root_object(
        armature, frames, positions, angles, in_place=in_place, below_parent=True
    )
    empty[_PLACE] = [number for row in place for number in row]
    if is_cyclic(armature):
        repeat_root_object(empty)


def check_own_action(armature: Object) -> None:
    """Check that no other object, such as a linked duplicate, has the same keys: it would lose or
    double the root motion that they lose or get.

    :raises UsageError: another object has them.
    """
    animation = armature.animation_data
    if animation is None or animation.action is None:
        return
    for other in bpy.data.objects:
        its = other.animation_data
        if its is None or its.action != animation.action or used_slot(its) != used_slot(animation):
            continue
        if other != armature and other.library is None and other.users_scene:
            raise UsageError(
                f"'{armature.name}' and '{other.name}' have the same action "
                f"'{its.action.name}': make it a single user first (Object > Relations > Make "
                "Single User > Object Animation)"
            )


def _check_own_transform(armature: Object) -> None:
    """Check that an armature's own transform does not move, as the trajectory would have it twice.

    :raises UsageError: keys, drivers or constraints move it.
    """
    if moving := moved_by(armature):
        raise UsageError(
            f"the armature '{armature.name}' is itself keyed, driven or constrained by "
            f"'{moving[0]}': remove that first, or move a parent of the armature instead"
        )


def moved_by(obj: Object) -> list[str]:
    """Return the properties by whose keys or drivers an object itself moves, and its
    constraints.
    """
    animation = obj.animation_data
    curves = [*fcurves(obj), *(animation.drivers if animation else ())]
    moving = [
        curve.data_path
        for curve in curves
        if curve.data_path.removeprefix("delta_") in _TRANSFORM and not curve.mute
    ]
    return moving + [each.name for each in obj.constraints if not each.mute]


def repeat_root_object(empty: Object) -> None:
    """Repeat the trajectory of a root object whose armature repeats: each cycle goes on where the
    one before it ended.
    """
    add_cycles(empty, offset_curves={("location", 0), ("location", 1)})


def move_root_motion_to_bones(armature: Object, body: Body, rate: float) -> None:
    """Move the root motion back to the bones and remove the root object. A trajectory not in use is
    restored too.

    :param rate: scene frames per second.
    :raises UsageError: when a bone or its keys are missing, or another object has the same keys.
    """
    if root_object(armature) is None:
        return
    check_own_action(armature)
    clip, frames = read_clip(armature, body, rate)
    write_clip(armature, body, clip_with_root_motion(armature, clip, frames), frames)
    remove_root_object(armature)


def clip_with_root_motion(armature: Object, clip: Clip, frames: Float64Array) -> Clip:
    """Return the clip including the trajectory stored in its root object, in use or not, in the
    armature's own space.

    :param frames: (T,) scene frames of the clip's keys.
    :raises UsageError: the stored trajectory was changed, or is in the NLA.
    """
    whole = with_trajectory(clip, *removed_root_motion(armature, frames))
    empty = root_object(armature)
    if empty is None:
        return whole
    return _moved(whole, _place(empty).inverted(), armature.matrix_basis.median_scale)


def removed_root_motion(
    armature: Object, frames: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return the trajectory stored in the root object, in use or not; zeros without a root object.

    :param frames: (T,) scene frames.
    :return: positions (T, 3) in the armature's units; angles (T,) about the vertical, radians.
    :raises UsageError: the stored trajectory was changed, or is in the NLA.
    """
    empty = root_object(armature)
    if empty is None:
        return np.zeros((len(frames), 3)), np.zeros(len(frames))
    if _UNUSED_TRAJECTORY not in empty:
        return _keyed_path(armature, empty, frames)
    rows = _unused_trajectory(empty)
    if rows is None:
        raise UsageError(
            f"the trajectory that '{empty.name}' stores in {_UNUSED_TRAJECTORY} was changed; undo "
            "that, or smooth the "
            "motion, which restores it as captured"
        )
    x, y, angle = (np.interp(frames, rows[:, 0], rows[:, k]) for k in (1, 2, 3))
    positions = np.stack([x, y, np.full(len(x), empty.location.z)], axis=1)
    return positions / armature.matrix_basis.median_scale, angle


def retime_unused_trajectory(empty: Object, retiming: Retiming) -> None:
    """Move a trajectory in time that is stored but not in use."""
    if (rows := _unused_trajectory(empty)) is not None:
        rows[:, 0] = retiming.frames(rows[:, 0])
        empty[_UNUSED_TRAJECTORY] = rows.ravel().tolist()


def _unused_trajectory(empty: Object) -> Float64Array | None:
    """Return frame, x, y and angle of a trajectory that is stored but not in use, (T, 4); None if
    there is none.
    """
    numbers = stored_numbers(empty, _UNUSED_TRAJECTORY)
    rows = np.array(numbers[: len(numbers) // 4 * 4]).reshape(-1, 4)
    return rows if 4 * len(rows) == len(numbers) > 0 and (np.diff(rows[:, 0]) > 0).all() else None


def clip_as_displayed(armature: Object, clip: Clip, frames: Float64Array) -> Clip:
    """Return the clip as displayed: moved by its root object, whether animated or at rest.

    :param frames: (T,) scene frames of the clip's keys.
    :raises UsageError: the root object's keys are in its NLA.
    """
    empty = root_object(armature)
    return clip if empty is None else with_trajectory(clip, *_keyed_path(armature, empty, frames))


def _keyed_path(
    armature: Object, empty: Object, frames: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return the empty's positions (T, 3), in the armature's units, and angles (T,), radians, at
    scene frames (T,).

    :raises UsageError: the empty's keys are in its NLA.
    """
    columns = {}
    check_not_moved_by_nla(empty)
    if not fcurves(empty):
        check_not_in_nla(empty)
    for curve in fcurves(empty):
        keys = read_keys(curve)
        columns[curve.data_path, curve.array_index] = np.interp(frames, keys[:, 0], keys[:, 1])
    columns = {("rotation_euler", 2): np.full(len(frames), empty.rotation_euler.z)} | columns
    positions = [
        columns.get(("location", k), np.full(len(frames), empty.location[k])) for k in range(3)
    ]
    return np.stack(positions, axis=1) / armature.matrix_basis.median_scale, columns[
        "rotation_euler", 2
    ]


def _place(empty: Object) -> Matrix:
    """Return the armature's rigid transform before its root motion was moved."""
    numbers = stored_numbers(empty, _PLACE)
    place = Matrix([numbers[k : k + 4] for k in (0, 4, 8, 12)]) if len(numbers) == 16 else Matrix()
    return place if abs(place.determinant() - 1.0) < _RIGID else Matrix()


def _place_now(empty: Object) -> Matrix:
    """Return the transform that the armature gets back: that of `_place`, moved over the floor like
    an empty at rest since its trajectory was stored.
    """
    place = _place(empty)
    rows = _unused_trajectory(empty)
    if rows is None:
        return place
    _, x, y, angle = rows[0]
    turn = Matrix.Rotation(empty.rotation_euler.z - angle, 4, "Z")
    there = Matrix.Translation((empty.location.x, empty.location.y, 0.0))
    return there @ turn @ Matrix.Translation((-x, -y, 0.0)) @ place


def _moved(clip: Clip, place: Matrix, size: float) -> Clip:
    """Apply the rigid transform of an armature, whose scale is ``size``, to its clip."""
    transform = np.array(place)
    transform[:3, 3] /= size
    return moved_clip(clip, transform)


def _copy_parenting(obj: Object, other: Object) -> None:
    """Give an object the parent of another one, with the same kind of parenting."""
    obj.parent = other.parent
    obj.matrix_parent_inverse.identity()
    if other.parent is not None:
        obj.parent_type = other.parent_type
        obj.parent_bone = other.parent_bone
        obj.parent_vertices = other.parent_vertices
        obj.matrix_parent_inverse = other.matrix_parent_inverse


def _remove_unless_parent(empty: Object) -> None:
    if empty.children:
        return
    action = action_of(empty)
    remove_blocks([empty])
    if action is not None and action.users == 0:
        bpy.data.actions.remove(action)
