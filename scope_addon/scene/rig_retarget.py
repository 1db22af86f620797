# SPDX-License-Identifier: GPL-3.0-or-later
"""Retargeting a captured motion to the user's own rig, as a new action."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace

import bpy
import numpy as np
from bpy.types import Action, Object
from mathutils import Matrix

from ...solver.body import Body
from ...solver.errors import InputError
from ..arrays import Float64Array, FloatArray
from ..edit.clip import Clip, about_z, floor_trajectory
from ..errors import UsageError
from ..kinematics.axes import rotated, transposed
from ..notices import PHRASES, Notice, notice
from ..retarget.bone_map import PHALANGES, SPINE, BoneMap
from ..retarget.expression_map import ExpressionMap
from ..retarget.foot_placement import frames_on_one_floor
from ..retarget.guess import SHAPED, guess
from ..retarget.rest_pose import BoneMotion, Pose, Skeleton, basis, rest_faults
from ..retarget.rig_source import ROOTS
from ..retarget.transfer import Transfer, leg_ratio
from .actions import add_cycles, bone_path, fcurves, is_cyclic, nla_strips
from .character.keys import read_clip
from .character.root_object import (
    clip_as_displayed,
    moved_by,
    parent_to_root_object,
    parent_transform,
    remove_root_object,
    repeat_root_object,
    root_object,
    topmost,
)
from .datablocks import action_of
from .face_retarget import captured_expressions, face_keys, key_face, rest_face
from .packed_motion import apart_at_cuts
from .rig_action import (
    clear_offsets,
    is_edited,
    leave_tweak_mode,
    mark_written,
    remember_motion,
    replace_action,
    root_locations,
    write_action,
)
from .rig_probe import (
    at_rest,
    blocked_bones,
    held_bones,
    posed_bones,
    probe,
    rest_pose,
    skin_unmodified,
)
from .rigify_ik import ik_keys
from .timing import current_frame_kept, show_frame, stretched_time_notices
from .transaction import all_or_nothing
from .visibility import evaluated, world_matrix

# Whose motion is missed where a rig has no bones for them.
_EXPECTED = (
    "head",
    *(f"{side}_{part}" for side in ("left", "right") for part in ("shoulder", "elbow", "wrist")),
    *("left_ankle", "right_ankle"),
)
# Largest difference from the identity of the rotations of fingers that were not captured, which
# single precision leaves.
_AT_REST = 1e-5
_SAME_SIZE = 1e-3  # of a rig whose parents change its size, as a share of it
# of an object's largest scale from its smallest; limbs are then up to 4 degrees off
_MAX_STRETCH = 1.05
# share of a rig's volume below which a frame counts as one that does not show the rig
_HIDDEN_VOLUME = 1e-12


@dataclass(frozen=True)
class RetargetOptions:
    """The user's choices for retargeting."""

    feet: bool = True  # place the feet where the body's are
    root: str = "bone"  # where the root motion goes: one of ``ROOTS``
    # metres, of the rig from the captured person
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    # of the bones that move the rig's face; None: it keeps its pose
    face: ExpressionMap | None = None
    travel: float | None = None  # scale of positions on the floor; None: the ratio of leg lengths

    def __post_init__(self) -> None:
        """Check the values.

        :raises UsageError: when ``root`` is unknown or ``travel`` is not positive.
        """
        if self.travel is not None and not self.travel > 0.0:
            raise UsageError(f"travel must be above 0, but is {self.travel:g}")
        if self.root not in ROOTS:
            raise UsageError(f"root must be one of {', '.join(ROOTS)}, but is '{self.root}'")


@dataclass(frozen=True)
class RetargetResult:
    """The result of ``retarget``: the rig's new action, warnings for the user, and the scale of
    positions.
    """

    action: Action
    warnings: list[Notice]
    travel: float


@dataclass(frozen=True)
class _PlacedMotion:
    """The rig's motion in the world, with root motion as the user chose."""

    rotations: Float64Array  # (T, B, 3, 3) bone to world, or to the root object
    heads: Float64Array  # (T, 3) of the root bone, metres
    # Positions (T, 3), metres, and angles (T,) about the vertical, radians, of the root object.
    trajectory: tuple[Float64Array, Float64Array] | None = None


def guess_bone_map(rig: Object) -> BoneMap:
    """Guess the bone map from the rig's names and rest pose.

    :raises InputError: when the rig has no bones.
    """
    is_mirrored = rig.matrix_world.determinant() < 0.0
    return guess(rest_pose(rig), is_mirrored=is_mirrored, held=held_bones(rig))


def usable_guess(rig: Object) -> BoneMap:
    """Guess the bone map, to be used without anybody looking at it.

    :raises InputError: when the rig has no bones, or its rest pose contradicts the guess.
    """
    found = guess_bone_map(rig)
    for fault in rest_faults(_heads_at_rest(rig, found)):
        bones = ", ".join(f"'{found.bone(part)}'" for part in fault.parts)
        raise InputError(
            f"the bone map of '{rig.name}' could not be guessed, because {bones} "
            f"{PHRASES[fault.reason]}; choose the bones yourself, or put the armature upright"
        )
    return found


def map_notices(rig: Object, bone_map: BoneMap) -> list[Notice]:
    """Return what a user should know about a bone map: guesses, parts without bones, and bones that
    do not look like their parts.
    """
    notices: list[Notice] = []
    unsure = [bone for bone, sure in bone_map.confidence.items() if sure <= SHAPED]
    if unsure:
        notices.append(notice("guessed_bones", rig=rig.name, bones=unsure))
    parts = set(bone_map.parts.values())
    still = [] if parts & set(SPINE) else ["spine"]
    still += [part for part in _EXPECTED if part not in parts]
    if still:
        notices.append(notice("still_parts", rig=rig.name, parts=still))
    scales = np.linalg.svd(np.array(rig.matrix_world.to_3x3(), float), compute_uv=False)
    if scales[0] > _MAX_STRETCH * scales[-1]:
        notices.append(notice("stretched_rig", rig=rig.name))
    for fault in rest_faults(_heads_at_rest(rig, bone_map)):
        bones = [bone_map.bone(part) or part for part in fault.parts]
        notices.append(notice("odd_bones", rig=rig.name, bones=bones, reason=fault.reason))
    return notices


def _heads_at_rest(rig: Object, bone_map: BoneMap) -> dict[str, Float64Array]:
    """Return the head (3,) of the first bone of each part at rest, in the world, metres."""
    heads: dict[str, Float64Array] = {}
    for bone, part in bone_map.parts.items():
        if bone in rig.data.bones and part not in heads:
            heads[part] = np.array(rig.matrix_world @ rig.data.bones[bone].head_local)
    return heads


def retarget(
    source: Object,
    body: Body,
    betas: FloatArray,
    rig: Object,
    bone_map: BoneMap,
    rate: float,
    options: RetargetOptions | None = None,
) -> RetargetResult:
    """Key the mapped bones of ``rig`` in a new action so that it moves like the captured
    ``source``.

    The rig's former action is kept in the file, unless it is an earlier retargeting of the same
    capture that was not edited. Fingers and face keep their pose if they were not captured. The rig
    leaves Edit Mode, Rest Position and its NLA's Tweak Mode, in which it would not move. Its NLA
    tracks are kept, below the new action, and its mapped bones lose what the pose moves or scales
    them by.

    :param betas: (P,) shape coefficients of the captured person.
    :param rate: scene frames per second.
    :raises UsageError: when the rig is the source, lacks a mapped bone or all controls of the
        face, or is in the Rest Position of a library.
    :raises InputError: when a map cannot be used, or a mapped bone does not move.
    """
    options = options or RetargetOptions()
    bone_map = usable_map(source, body, rig, bone_map)
    if rig.data.library is not None and rig.data.pose_position == "REST":
        raise UsageError(
            f"'{rig.name}' would not move once this file is opened again: its armature is linked "
            f"from {rig.data.library.filepath} and shown in Rest Position; set it to Pose Position "
            "there, or make an override of the armature data as well"
        )
    clip, frames = read_clip(source, body, rate)
    clip = clip_as_displayed(source, clip, frames)
    seen = _seen_parts(body, clip)
    unlisted = _unlisted_fingers(rig, bone_map, seen)
    bone_map = _with_parts(bone_map, seen)
    captured = captured_expressions(source) if options.face is not None else None
    face = (
        face_keys(captured, rig, options.face)
        if captured is not None and options.face is not None
        else None
    )
    leave_tweak_mode(rig)
    with all_or_nothing(bpy.context.scene, rig, topmost(rig)), skin_unmodified(rig):
        places = _places(source, frames)
        back_above = _back_above_root_object(rig, frames)
        with at_rest(rig), ExitStack() as at_frame:
            moved = _places(rig, frames)
            if len(moved) > 1:
                at_frame.enter_context(current_frame_kept(bpy.context.scene))
                present = np.array(rig.matrix_world, float)
                show_frame(bpy.context.scene, frames[_most_upright(moved, present)])
            skeleton = probe(rig, bone_map.parts)
            place = np.array(rig.matrix_world, float)
            root = skeleton.names.index(bone_map.bone("pelvis") or "")
            one_floor = np.zeros(len(clip), bool)
            if not source.get("scope_uneven_ground", False):
                one_floor = frames_on_one_floor(clip, body, betas)
            travel = options.travel or leg_ratio(body, betas, skeleton, bone_map)
            pose = Transfer(
                body,
                betas,
                skeleton,
                bone_map,
                feet=options.feet,
                travel=travel,
            ).pose(clip, one_floor)
            apart = apart_at_cuts(source, clip, rate)
            motion = _placed(places, apart, skeleton, place, pose, root, options)
            if options.root != "in-place":
                motion = _moved_back(motion, _below(motion.trajectory, back_above))
                motion = _moved_back(motion, _back(place, moved))
            turns = basis(skeleton, motion.rotations)
            keys = [BoneMotion(name, turns[:, b]) for b, name in enumerate(skeleton.names)]
            keys[root] = replace(
                keys[root], locations=root_locations(rig, place, skeleton, root, motion.heads)
            )
            warnings = map_notices(rig, bone_map) + unlisted
            warnings += blocked_bones(rig, keys, motion.rotations, motion.heads)
            keys += ik_keys(rig, keys)
        warnings += posed_bones(rig, skeleton.names)
        warnings += stretched_time_notices(bpy.context.scene)
        former = action_of(rig)
        action = write_action(rig, keys, frames, source.name)
        remember_motion(action, source)
        if face is not None:
            key_face(rig, face, source.name)
        _set_parent(rig, frames, motion)
        if is_cyclic(source):
            _repeat(rig, action, keys)
        if former is not None and is_edited(former):
            warnings.append(notice("kept_action", rig=rig.name, action=former.name))
        replace_action(rig, former, source.name)
    clear_offsets(rig, [key.bone for key in keys])
    if face is not None:
        rest_face(rig, face)
    return RetargetResult(action, warnings, travel)


def common_travel(
    body: Body, people_betas: Sequence[FloatArray], rig: Object, bone_map: BoneMap
) -> float:
    """Return the scale of positions for several people on copies of one rig: by their mean leg
    length.

    With a scale of their own each, people who stand side by side would move apart or into each
    other.

    :param people_betas: (P,) shape coefficients of each person.
    :raises UsageError: when the rig lacks a mapped bone.
    :raises InputError: when the map cannot be used.
    """
    bone_map = usable_map(None, body, rig, bone_map)
    with at_rest(rig):
        skeleton = probe(rig, bone_map.parts)
    ratios = [leg_ratio(body, betas, skeleton, bone_map) for betas in people_betas]
    return len(ratios) / sum(1.0 / ratio for ratio in ratios)


def usable_map(source: Object | None, body: Body, rig: Object, bone_map: BoneMap) -> BoneMap:
    """Return the bone map without the parts that the body lacks.

    :param source: the captured armature, if there is one.
    :raises UsageError: when the rig is the source, or lacks a mapped bone.
    :raises InputError: when the map cannot be used.
    """
    bone_map.check()
    if rig == source or rig.type != "ARMATURE":
        raise UsageError(
            "the rig must be an armature, and not the captured one; choose another armature"
        )
    missing = [name for name in bone_map.parts if name not in rig.pose.bones]
    if missing:
        raise UsageError(
            f"'{rig.name}' has no bone '{missing[0]}'; guess the bones again or correct the list"
        )
    return _with_parts(bone_map, set(body.joint_names))


def _seen_parts(body: Body, clip: Clip) -> set[str]:
    """Return the body's parts without the fingers of hands that were not captured: theirs are at
    rest in every frame.
    """
    names = body.joint_names
    seen = set(names)
    for side in ("left", "right"):
        fingers = {f"{side}_{phalanx}" for phalanx in PHALANGES}.intersection(names)
        rotations = clip.rotations[:, [names.index(finger) for finger in fingers]]
        if np.abs(rotations - np.eye(3)).max(initial=0.0) < _AT_REST:
            seen -= fingers
    return seen


def _unlisted_fingers(rig: Object, bone_map: BoneMap, seen: set[str]) -> list[Notice]:
    """Return a warning about hands whose fingers were captured, and are bones of the rig, but not
    in the map.

    :param seen: the parts of the body that were captured.
    """
    hands = []
    for side in ("left", "right"):
        fingers = {f"{side}_{phalanx}" for phalanx in PHALANGES} & seen
        hand = bone_map.bone(f"{side}_wrist")
        if fingers and hand and fingers.isdisjoint(bone_map.parts.values()):
            below = rig.data.bones[hand].children_recursive
            if len(below) > 1:  # not the end of the hand alone
                hands.append(hand)
    return [notice("unlisted_fingers", rig=rig.name, hands=hands)] if hands else []


def _with_parts(bone_map: BoneMap, kept: set[str]) -> BoneMap:
    """Return a bone map with these parts alone."""
    parts = {bone: part for bone, part in bone_map.parts.items() if part in kept}
    confidence = {bone: sure for bone, sure in bone_map.confidence.items() if bone in parts}
    return BoneMap(parts, confidence)


def _placed(
    places: Float64Array,
    clip: Clip,
    skeleton: Skeleton,
    place: Float64Array,
    pose: Pose,
    root: int,
    options: RetargetOptions,
) -> _PlacedMotion:
    """Apply the transform of the captured armature, the user's offset and the choice of root
    motion.

    :param places: of the captured armature, from `_places`.
    :param place: (4, 4) the rig's object to world at rest.
    :param root: index of the root bone.
    """
    rotations, heads, yaw = _with_source_transform(places, pose.rotations, pose.heads[:, root])
    heads = heads + options.offset
    if options.root == "in-place":
        heads[:, :2] = skeleton.heads[root, :2]
    elif options.root == "object":
        positions = heads * [1.0, 1.0, 0.0]
        angles = floor_trajectory(clip)[1] + yaw + pose.facing
        turn = about_z(angles)
        origin = place[:3, 3] * [1.0, 1.0, 0.0]
        rotations = transposed(turn)[:, None] @ rotations
        heads = rotated(transposed(turn), heads - positions) + origin
        return _PlacedMotion(rotations, heads, (positions - turn @ origin, angles))
    return _PlacedMotion(rotations, heads)


def _with_source_transform(
    places: Float64Array, rotations: Float64Array, heads: Float64Array
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Apply the position and rotation of the captured armature in the scene.

    :param places: (T, 4, 4) or (1, 4, 4) from `_places`.
    :param rotations: (T, B, 3, 3) bone to world.
    :param heads: (T, 3) metres.
    :return: the new rotations and heads, and the armature's rotation about the vertical, (T,) or
        (1,) radians.
    """
    parts = [Matrix(place.tolist()).decompose() for place in places]
    position = np.array([tuple(part[0]) for part in parts])
    R = np.array([part[1].to_matrix() for part in parts])
    angles = np.unwrap([part[1].to_euler("ZYX").z for part in parts])
    return R[:, None] @ rotations, rotated(R, heads) + position, angles


def _back_above_root_object(rig: Object, frames: Float64Array) -> Float64Array:
    """Return `_back` of the parents above the rig's root object, from which ``at_rest`` detaches
    it.
    """
    empty = root_object(rig)
    if empty is None:
        return np.eye(4)[None]
    return _back(np.array(parent_transform(empty), float), _places(rig, frames))


def _back(place: Float64Array, places: Float64Array) -> Float64Array:
    """Return the transforms, (T, 4, 4) or (1, 4, 4), that undo how parents move a rig; the identity
    where they scale it to nothing.

    :param place: (4, 4) the rig's object to world when it was measured.
    :param places: (T, 4, 4) the same at the keys' frames; (1, 4, 4) if it does not move.
    """
    back = np.tile(np.eye(4), (len(places), 1, 1))
    shown = np.abs(np.linalg.det(places)) > _HIDDEN_VOLUME * abs(np.linalg.det(place))
    back[shown] = place @ np.linalg.inv(places[shown])
    return back


def _below(
    trajectory: tuple[Float64Array, Float64Array] | None, back: Float64Array
) -> Float64Array:
    """Return what has the effect of ``back`` where it is applied below a root object that follows
    the trajectory instead of above it.

    :param back: (T, 4, 4) or (1, 4, 4).
    """
    if trajectory is None:
        return back
    positions, angles = trajectory
    root = np.tile(np.eye(4), (len(angles), 1, 1))
    root[:, :3, :3] = about_z(angles)
    root[:, :3, 3] = positions
    return np.linalg.inv(root) @ back @ root


def _moved_back(motion: _PlacedMotion, back: Float64Array) -> _PlacedMotion:
    """Return the motion as it is to be keyed under parents that move the rig, so that the root bone
    is where it was in the world, and every bone turned as it was.

    :param back: (T, 4, 4) or (1, 4, 4), from `_back`; it may scale.
    """
    R = np.array([Matrix(each.tolist()).decompose()[1].to_matrix() for each in back])
    heads = rotated(back[:, :3, :3], motion.heads) + back[:, :3, 3]
    return replace(motion, rotations=R[:, None] @ motion.rotations, heads=heads)


def _places(source: Object, frames: Float64Array) -> Float64Array:
    """Return the transform of the captured armature, or of a rig ``at_rest``, to the world at scene
    frames (T,), (T, 4, 4); (1, 4, 4) if it does not move.

    The trajectory of a root object is included in the motion already, but not the transform of its
    parent. The scale of the armature does not affect the rig.
    """
    empty = root_object(source)
    scene = bpy.context.scene
    if not _is_carried(source):
        place = world_matrix(source) if empty is None else parent_transform(empty)
        return np.array([place], float)
    places = []
    with evaluated(empty or source), current_frame_kept(scene):
        for frame in frames:
            show_frame(scene, frame)  # evaluates both, once
            if empty is None:
                places.append(source.matrix_world.copy())
            else:
                places.append(empty.matrix_world @ empty.matrix_basis.inverted_safe())
    return np.array(places, float)


def _most_upright(places: Float64Array, place: Float64Array) -> int:
    """Return the index of the place, of those where the rig has its present size, or the nearest to
    it, in which one of the axes is nearest to the vertical: a boat or a horse that carries a rig
    tilts it, and the rig is measured standing.

    :param places: (T, 4, 4) from `_places`.
    :param place: (4, 4) the present one.
    """
    R = np.array([Matrix(each.tolist()).to_quaternion().to_matrix() for each in places])
    sizes = np.cbrt(np.abs(np.linalg.det(places)) / max(abs(np.linalg.det(place)), 1e-30))
    apart = np.abs(sizes - 1.0)
    return int(np.where(apart < _SAME_SIZE, np.abs(R[:, 2]).max(axis=1), -apart).argmax())


def _is_carried(source: Object) -> bool:
    """Return whether the captured armature, or what it is parented to above its root object, may
    move.
    """
    empty = root_object(source)
    if empty is None and moved_by(source):
        return True
    above = source.parent if empty is None else empty.parent
    while above is not None:
        if _is_animated(above) or moved_by(above):
            return True
        above = above.parent
    return False


def _is_animated(obj: Object) -> bool:
    """Return whether keys, drivers or strips animate anything of an object, such as its bones."""
    animation = obj.animation_data
    drivers = animation.drivers if animation is not None else ()
    return bool(fcurves(obj) or len(drivers) or nla_strips(obj))


def _repeat(rig: Object, action: Action, keys: Sequence[BoneMotion]) -> None:
    """Repeat the keys as the captured person's loop does: each cycle goes on where the one before
    it ended.
    """
    travelling = {
        (bone_path(key.bone, "location"), channel)
        for key in keys
        if key.locations is not None
        for channel in range(3)
    }
    add_cycles(rig, offset_curves=travelling)
    mark_written(action)
    if (empty := root_object(rig)) is not None:
        repeat_root_object(empty)


def _set_parent(rig: Object, frames: Float64Array, motion: _PlacedMotion) -> None:
    """Parent the rig to a root object that follows the trajectory, or remove a former root
    object.
    """
    top = topmost(rig)
    if motion.trajectory is None:
        remove_root_object(rig)
    else:
        top = parent_to_root_object(rig, frames, *motion.trajectory)
    # the keys are in world coordinates, so the parent's transform is cancelled
    if top.parent is not None:
        top.matrix_parent_inverse = (
            top.matrix_parent_inverse @ parent_transform(top).inverted_safe()
        )
