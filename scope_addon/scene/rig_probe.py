# SPDX-License-Identifier: GPL-3.0-or-later
"""Measuring how the bones of a rig move together, by posing the rig itself.

Each mapped bone is rotated once, and the other bones are observed. Constraints, such as those of
Rigify's controls, therefore need no special treatment, and no frame of an animation has to be
evaluated.

Its rest pose is read as well: its bones, and the skin that each of them moves.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager

import bpy
import numpy as np
from bpy.types import Bone, Constraint, FCurve, Object, PoseBone
from mathutils import Matrix, Quaternion

from ...solver.errors import InputError
from ...solver.rotations import log
from ..arrays import BoolArray, Float64Array, IndexArray
from ..kinematics.axes import transform_points, transposed, unscaled
from ..notices import MAX_NAMES, Notice, and_more, notice
from ..retarget.bone_map import PHALANGES, check_bone_count
from ..retarget.fingers import bone_ends
from ..retarget.rest_pose import SAME_PLACE, BoneMotion, RestPose, Skeleton
from .actions import assign_action, bone_path, nla_fcurves, read_keys, used_slot
from .character.root_object import root_object, topmost
from .datablocks import changed, is_deformed_by, modifiers_off
from .rig_action import channel_of_rotation
from .visibility import evaluated

# Rigify's properties: limbs by FK, neck and head with the chest.
SWITCHES = ("IK_FK", "neck_follow", "head_follow")
# of a head's position relative to its carrier, as a share of their distance
_CARRIER_TOLERANCE = 0.02
# change of a rotation matrix's entries; the probe changes them by more than 0.3
_MIN_RESPONSE = 0.1
_MAX_CHECKED_FRAMES = 10
_MAX_DEVIATION = np.radians(20)
_MAX_SHIFT = 0.05  # of the root bone's head from where it should be, as a share of the rig's size
_VISIBLE = 1e-3  # of a bone's pose: radians, factors and shares of its length
# Values of a bone's channels.
_AT_REST = {
    "location": (0.0, 0.0, 0.0),
    "rotation_axis_angle": (0.0, 0.0, 1.0, 0.0),
    "rotation_euler": (0.0, 0.0, 0.0),
    "rotation_quaternion": (1.0, 0.0, 0.0, 0.0),
    "scale": (1.0, 1.0, 1.0),
}
# The part that carries each part of a limb; hips and shoulders move with the pelvis.
_CARRIED_BY = {"knee": "hip", "ankle": "knee", "elbow": "shoulder", "wrist": "elbow"}
# Constraints that hold a chain of bones, and all after which a bone does not turn as it is posed.
_CHAINED = ("IK", "SPLINE_IK")
_TURNING = (
    *("ACTION", "COPY_ROTATION", "COPY_TRANSFORMS", "DAMPED_TRACK", "LOCKED_TRACK", "STRETCH_TO"),
    *("TRACK_TO", "TRANSFORM", *_CHAINED),
)
_UNKNOWN = "the constraint or driver that controls the bone"
# How many are named in a message: enough for four limbs, with hands and feet.
_MAX_CONSTRAINTS = 12
# Of the lowest bone from the rig's origin, as a share of the rig's size.
_MAX_LIFT = 0.17


def probe(rig: Object, parts: dict[str, str]) -> Skeleton:
    """Measure the mapped bones at rest and their dependencies; the rig must be ``at_rest``.

    :param parts: bone name -> body part.
    :raises InputError: when a bone does not rotate, the pelvis does not move, or the rig's scale is
        0.
    """
    names = list(parts)
    whole = rest_pose(rig, with_skin=True)
    rest = _matrices(rig, names)
    if min(map(abs, rig.matrix_world.to_scale())) < 1e-9:
        raise InputError(
            f"'{rig.name}' is scaled to 0; give it a size (S, or Scale in the sidebar)"
        )
    follows, carried = _dependencies(rig, parts, rest)
    _check_root_moves(
        rig, next((bone for bone, part in parts.items() if part == "pelvis"), names[0])
    )
    order: list[int] = []
    while rows := [b for b in range(len(names)) if b not in order]:
        above = {
            b: sum(a not in order for a in np.flatnonzero(follows[b] | carried[b])) for b in rows
        }
        order.append(min(rows, key=above.__getitem__))
    parents, carriers = (_nearest(above[np.ix_(order, order)]) for above in (follows, carried))
    carriers = np.where(carriers < 0, parents, carriers)
    ordered = [names[b] for b in order]
    _check_carried(rig, ordered, carriers, parts)
    matrices = rest[order]
    return Skeleton(
        ordered,
        parents,
        carriers,
        matrices[:, :3, 3],
        bone_ends(whole, ordered, parts),
        unscaled(matrices[:, :3, :3]),
        _floor(rig, whole, parts),
    )


def held_bones(rig: Object) -> set[str]:
    """Return the bones that constraints turn: they do not turn as they are posed."""
    return {
        name
        for _, constraint, chain in _acting(rig)
        if constraint.type in _TURNING and getattr(constraint, "mix_mode", "REPLACE") == "REPLACE"
        for name in chain
    }


def _acting(rig: Object) -> Iterator[tuple[PoseBone, Constraint, list[str]]]:
    """Yield the constraints of bones that are not muted, each with the names of the bones that it
    controls: with IK, they may be several.
    """
    if rig.pose is None:  # as of an armature that a script has just made
        return
    for bone in rig.pose.bones:
        for constraint in bone.constraints:
            if constraint.is_valid and not constraint.mute and constraint.influence > 0.0:
                count = constraint.chain_count if constraint.type in _CHAINED else 1
                chain = [bone, *bone.parent_recursive][: count or None]
                yield bone, constraint, [each.name for each in chain]


def _controlling(rig: Object, names: Iterable[str]) -> str:
    """Return the constraints that control bones, in words; empty without any."""
    wanted = set(names)
    found = [
        f"'{constraint.name}' of '{bone.name}'"
        for bone, constraint, chain in _acting(rig)
        if wanted.intersection(chain)
    ]
    several = "s" if len(found) > 1 else ""
    listed = and_more(found[:_MAX_CONSTRAINTS], len(found), " and ")
    return f"the constraint{several} {listed}" if found else ""


def _check_carried(
    rig: Object, names: list[str], carriers: IndexArray, parts: dict[str, str]
) -> None:
    """Check that every limb moves as one piece with the pelvis; goals of IK, for example, do not.

    :param carriers: (B,) the bone that each bone's head moves with, -1 for none.
    :raises InputError: when a bone does not move with the one that should carry it.
    """
    bone_of = {parts[name]: index for index, name in enumerate(names)}
    apart: list[tuple[str, str]] = []  # parts and those that should carry them
    for part, bone in bone_of.items():
        side, _, kind = part.partition("_")
        above = f"{side}_{_CARRIED_BY[kind]}" if kind in _CARRIED_BY else "pelvis"
        if kind not in (*_CARRIED_BY, "hip", "shoulder") or above not in bone_of:
            continue
        carrying = bone
        while carrying >= 0 and carrying != bone_of[above]:
            carrying = int(carriers[carrying])
        if carrying < 0:
            apart.append((part, above))
    if apart:
        _refuse_apart(rig, apart, {part: rig.data.bones[names[b]] for part, b in bone_of.items()})


def _refuse_apart(rig: Object, apart: list[tuple[str, str]], bone_of: dict[str, Bone]) -> None:
    """Refuse a rig in which parts do not move with those that should carry them, naming all that
    has to be muted, or the bone that carries both.

    :raises InputError: always.
    """
    near: list[Bone] = []
    chains: list[list[Bone]] = []
    for part, above in apart:
        chain = [bone_of[part], *bone_of[part].parent_recursive]
        upper = bone_of[above]
        near += [*(chain[: chain.index(upper)] if upper in chain else chain[:1]), upper]
        chains.append(chain)
    held = _controlling(rig, [bone.name for bone in near]) or _controlling(
        rig, [bone.name for chain in chains for bone in chain]
    )
    part, above = apart[0]
    lower = bone_of[part]
    upper = bone_of[above]
    reason = f": mute {held}, or"
    advice = ""
    if not held:
        reason = f", so they cannot be {part} and {above};".replace("_", " ")
        shared = [bone for bone in upper.parent_recursive if all(bone in chain for chain in chains)]
        if above == "pelvis" and shared:
            advice = f", such as '{shared[0].name}' for the pelvis"
    raise InputError(
        f"'{lower.name}' of '{rig.name}' does not move with '{upper.name}'{reason} choose other "
        f"bones in the bone map{advice}"
    )


def _dependencies(
    rig: Object, parts: dict[str, str], rest: Float64Array
) -> tuple[BoolArray, BoolArray]:
    """Rotate each bone and observe the others, in the armature's space: the object may shear them.

    :param rest: (B, 4, 4) bones to world at rest.
    :return: (B, B) whether the row's bone rotates with the column's, and whether its head moves
        with it.
    :raises InputError: when bones do not rotate.
    """
    names = list(parts)
    armature_from_world = np.linalg.inv(np.array(rig.matrix_world, float))
    rest = armature_from_world @ rest
    follows = np.zeros((len(names), len(names)), bool)
    carried = follows.copy()
    heads = rest[:, :3, 3]
    blocked: list[str] = []  # at rest, other bones would seem to follow them
    for group in _independent(parts):
        # with different angles, to distinguish which bone another one follows
        for k, a in enumerate(group):
            turn = Quaternion((0.6, 0.48, 0.64), 0.5 + 0.15 * k)
            rig.pose.bones[names[a]].matrix_basis = turn.to_matrix().to_4x4()
        posed = armature_from_world @ _matrices(rig, names)
        turned = unscaled(posed[:, :3, :3]) @ transposed(unscaled(rest[:, :3, :3]))
        for a in group:
            if np.abs(turned[a] - np.eye(3)).max() < _MIN_RESPONSE:
                blocked.append(names[a])
            rig.pose.bones[names[a]].matrix_basis = Matrix()
            follows[:, a] = np.abs(turned - turned[a]).max(axis=(1, 2)) < 0.02
            away = heads - heads[a]
            expected = away @ turned[a].T
            off, moved = (
                np.linalg.norm(expected - now, axis=1) for now in (posed[:, :3, 3] - heads[a], away)
            )
            carried[:, a] = (off < _CARRIER_TOLERANCE * np.linalg.norm(away, axis=1)) & (
                off < moved
            )
            follows[a, a] = carried[a, a] = False
    if blocked:
        _refuse_blocked(rig, blocked, names)
    return follows, carried


def _independent(parts: dict[str, str]) -> list[list[int]]:
    """Group bones that do not move each other, such as those of both sides, to save evaluations."""
    groups: dict[tuple[str, str], list[int]] = {}
    for row, (bone, part) in enumerate(parts.items()):
        kind = part.partition("_")[2]
        # Bones of the trunk move each other, whatever their names.
        key = ("bone", bone)
        if kind:
            key = ("part", "phalanx" + kind[-1] if kind in PHALANGES else kind)
        groups.setdefault(key, []).append(row)
    return list(groups.values())


def _nearest(above: BoolArray) -> IndexArray:
    """Return the last preceding bone that each bone depends on (B,), -1 for none.

    :param above: (B, B) whether the row's bone depends on the column's.
    """
    return np.array([max(np.flatnonzero(row[:b]), default=-1) for b, row in enumerate(above)], int)


def _floor(rig: Object, rest: RestPose, parts: dict[str, str]) -> float:
    """Return the height of the floor: below the soles of the feet; without skin, the rig's origin
    if the rig rests near it, otherwise the lowest point where one of its bones begins or ends.
    """
    feet = [
        rest.names.index(name) for name, part in parts.items() if part.endswith(("ankle", "foot"))
    ]
    soles = rest.lowest_skin(feet)
    if soles is not None:
        return soles
    deforming = [index for index, bone in enumerate(rig.data.bones) if bone.use_deform]
    bones = deforming or range(len(rest.names))
    lowest = min(min(rest.heads[bone][2], rest.end(bone)[2]) for bone in bones)
    origin = rig.matrix_world.translation.z
    return float(origin if abs(lowest - origin) < _MAX_LIFT * rest.size else lowest)


def _refuse_blocked(rig: Object, blocked: list[str], names: list[str]) -> None:
    """Refuse a rig in which bones do not rotate, naming all that has to be muted.

    :param names: of all mapped bones; constraints may turn more of them than those that stay still.
    :raises InputError: always.
    """
    bones = and_more([f"'{name}'" for name in blocked[:MAX_NAMES]], len(blocked))
    held = held_bones(rig).intersection(names)
    one = len(blocked) == 1
    unknown = _UNKNOWN if one else "the constraints or drivers that control them"
    raise InputError(
        f"{bones} of '{rig.name}' {'does' if one else 'do'} not move when rotated: mute "
        f"{_controlling(rig, held.union(blocked)) or unknown}, or remove "
        f"{'the bone' if one else 'these bones'} from the list"
    )


def _check_root_moves(rig: Object, name: str) -> None:
    """Check that the pelvis, whose location is the root motion, can be moved. Leaves it at rest.

    :raises InputError: when it cannot.
    """
    bone = rig.pose.bones[name]
    rest = _matrices(rig, [name])
    bone.matrix_basis = Matrix.Translation((bone.length,) * 3)
    moved = np.linalg.norm(
        np.linalg.solve(np.array(rig.matrix_world), _matrices(rig, [name]) - rest)[0, :3, 3]
    )
    bone.matrix_basis = Matrix()
    if moved > 0.1 * bone.length:
        return
    if bone.bone.use_connect:
        raise InputError(
            f"'{name}' of '{rig.name}' is connected to '{bone.parent.name}' and cannot move away "
            "from it: in Edit Mode, disconnect the bone (Alt P)"
        )
    raise InputError(
        f"'{name}' of '{rig.name}' does not move when its location changes: mute "
        f"{_controlling(rig, [name]) or _UNKNOWN}, or choose another bone for the pelvis in the "
        "list"
    )


def blocked_bones(
    rig: Object, keys: Sequence[BoneMotion], wanted: Float64Array, heads: Float64Array
) -> list[Notice]:
    """Return warnings about bones that deviate from the motion although they can be moved, such as
    a leg with IK, and about those that should follow them and carry the skin.

    :param keys: of the B bones; only the root bone has locations.
    :param wanted: (T, B, 3, 3) bone to world.
    :param heads: (T, 3) of the root bone, metres.
    """
    names = [key.bone for key in keys]
    root = next(b for b, key in enumerate(keys) if key.locations is not None)
    twins = _twins(rig, names)
    followed = list(twins.values())
    names += twins
    rested = np.array([rig.data.bones[name].matrix_local.to_3x3() for name in names], float)
    R_bone_twin = transposed(rested[followed]) @ rested[len(keys) :]
    off = np.zeros(len(names))
    shift = 0.0
    for t in _farthest_frames(keys, heads - heads[0]):
        for key in keys:
            rig.pose.bones[key.bone].matrix_basis = basis_of(key, t)
        seen = _matrices(rig, names)
        expected = np.concatenate([wanted[t], wanted[t, followed] @ R_bone_twin])
        R = unscaled(seen[:, :3, :3])
        cosine = (np.einsum("bij,bij->b", R, expected) - 1) / 2
        # Bones that only follow may share a roll with others: what counts is where they point.
        cosine[len(keys) :] = np.einsum("bi,bi->b", R[..., 1], expected[..., 1])[len(keys) :]
        off = np.maximum(off, np.arccos(np.clip(cosine, -1, 1)))
        size = np.ptp(seen[:, :3, 3], axis=0).max()
        shift = max(shift, np.linalg.norm(seen[root, :3, 3] - heads[t]) / size)
    is_blocked = off > _MAX_DEVIATION
    is_blocked[root] |= shift > _MAX_SHIFT
    is_blocked[: len(keys)] |= np.array([_is_driven(rig, key) for key in keys])
    blocked = [name for name, blocks in zip(names, is_blocked, strict=True) if blocks]
    return [notice("blocked_bones", bones=blocked, rig=rig.name)] if blocked else []


def _twins(rig: Object, names: Sequence[str]) -> dict[str, int]:
    """Return the other bones that move skin and are where a bone is at rest, with its row."""
    bones = rig.data.bones
    places = np.array([[*bones[name].head_local, *bones[name].tail_local] for name in names])
    skins = [obj for obj in bpy.context.scene.objects if is_deformed_by(obj, rig)]
    skinned = {group.name for skin in skins for group in skin.vertex_groups}
    twins = {}
    for bone in bones:
        if bone.use_deform and bone.name in skinned and bone.name not in names:
            off = np.abs(places - [*bone.head_local, *bone.tail_local]).max(axis=1)
            if off.min() < SAME_PLACE * np.ptp(places):
                twins[bone.name] = int(off.argmin())
    return twins


def _is_driven(rig: Object, key: BoneMotion) -> bool:
    """Return whether drivers replace keys of a bone, whatever they make of them at this frame."""
    drivers = rig.animation_data.drivers if rig.animation_data else ()
    mode = rig.pose.bones[key.bone].rotation_mode
    paths = [bone_path(key.bone, channel_of_rotation(mode, np.eye(3)[None])[0])]
    if key.locations is not None:
        paths.append(bone_path(key.bone, "location"))
    return any(driver.data_path in paths and not driver.mute for driver in drivers)


def posed_bones(rig: Object, names: Sequence[str]) -> list[Notice]:
    """Return warnings about bones above mapped ones that are posed, or that the NLA poses: they
    move the motion, which was measured with them at rest.

    :param names: of the mapped bones.
    """
    above = dict.fromkeys(
        bone.name for name in names for bone in rig.data.bones[name].parent_recursive
    )
    in_nla = {curve.data_path for curve in nla_fcurves(rig) if _leaves_rest(curve)}
    others = [name for name in above if name not in names]
    by_nla = [
        name for name in others if any(bone_path(name, channel) in in_nla for channel in _AT_REST)
    ]
    posed = [name for name in others if name not in by_nla and _is_posed(rig.pose.bones[name])]
    notices = []
    if posed:
        notices.append(notice("posed_bones", bones=posed, rig=rig.name))
    if by_nla:
        notices.append(notice("nla_bones", bones=by_nla, rig=rig.name))
    return notices


def _is_posed(bone: PoseBone) -> bool:
    """Return whether a bone is moved, turned or scaled, visibly."""
    offset = np.array(bone.matrix_basis, float) - np.eye(4)
    offset[:3, 3] /= bone.length
    return bool(np.abs(offset).max() > _VISIBLE)


def _leaves_rest(curve: FCurve) -> bool:
    """Return whether a curve of a bone's location, rotation or scale has other values than at rest,
    as far as its keys tell; all that is keyed together with a posed bone has keys at rest.
    """
    rest = _AT_REST.get(curve.data_path.rpartition(".")[2])
    if rest is None:
        return False
    values = read_keys(curve)[:, 1]
    is_keyed = len(values) > 0 and len(curve.modifiers) == 0
    return not is_keyed or bool(np.abs(values - rest[curve.array_index]).max() > _VISIBLE)


def _farthest_frames(keys: Sequence[BoneMotion], path: Float64Array) -> list[int]:
    """Return the frames to look at: the first one, and those in which bones turn farthest about
    each of their axes, or the root bone is farthest in each direction; a frame may do for several.

    :param path: (T, 3) of the root bone, metres.
    """
    turns = [log(key.rotations) for key in keys]
    values = np.concatenate([*turns, path], axis=1)  # (T, C) radians, metres
    candidates = np.concatenate([values.argmax(axis=0), values.argmin(axis=0)])  # (2 C,)
    # (2 C, 2 C) what each candidate shows of every extreme; on the diagonal, its own
    shown = np.concatenate([values[candidates], -values[candidates]], axis=1)
    frames = [0]
    covered = np.concatenate([values[0], -values[0]])
    while len(frames) < _MAX_CHECKED_FRAMES:
        missing = shown.diagonal() - covered
        farthest = int(missing.argmax())
        if missing[farthest] < _MAX_DEVIATION / 2:
            break
        frames.append(int(candidates[farthest]))
        covered = np.maximum(covered, shown[farthest])
    return frames


def basis_of(key: BoneMotion, t: int) -> Matrix:
    """Return the bone's ``matrix_basis`` of one frame."""
    matrix = Matrix(key.rotations[t].tolist()).to_4x4()
    if key.locations is not None:
        matrix.translation = key.locations[t].tolist()
    return matrix


def _matrices(rig: Object, names: list[str]) -> Float64Array:
    """Return the evaluated bones to world (B, 4, 4)."""
    bpy.context.view_layer.update()
    posed = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array([posed.matrix_world @ posed.pose.bones[name].matrix for name in names], float)


@contextmanager
def at_rest(rig: Object) -> Iterator[None]:
    """Evaluate the rig without animation, pose and root object, with limbs switched to FK, inside
    the block.

    Everything is restored except the switches and Edit Mode.
    """
    if rig.mode == "EDIT":
        bpy.ops.object.mode_set(mode="OBJECT")
    animation = rig.animation_data
    action = animation.action if animation else None
    slot = used_slot(animation)
    bases = [(bone, bone.matrix_basis.copy()) for bone in rig.pose.bones]
    top = topmost(rig)
    empty = root_object(rig)
    with (
        evaluated(rig),
        skin_unmodified(rig),
        changed([rig.data], pose_position="POSE"),
        changed([animation] if animation else [], use_nla=False),
    ):
        try:
            top.parent = None
            if animation:
                animation.action = None
            for bone, _ in bases:
                bone.matrix_basis = Matrix()
                for switch in SWITCHES:
                    if switch in bone:
                        bone[switch] = 1.0
            rig.update_tag()
            bpy.context.view_layer.update()  # or its place is read as below the root object
            yield
        finally:
            for bone, matrix in bases:
                bone.matrix_basis = matrix
            top.parent = empty
            if action is not None:
                assign_action(animation, action, slot)


def skin_unmodified(rig: Object) -> AbstractContextManager[None]:
    """Leave out the modifiers of the meshes that a rig deforms inside the block: only bones are
    measured.
    """
    return modifiers_off(obj for obj in bpy.context.scene.objects if is_deformed_by(obj, rig))


def rest_pose(rig: Object, *, with_skin: bool = False) -> RestPose:
    """Return all bones of a rig at rest, in the world.

    :param with_skin: read the meshes that the rig deforms, too; the rig must be ``at_rest``.
    :raises InputError: when the rig has no bones, or too many.
    """
    bones = list(rig.data.bones)
    if not bones:
        raise InputError(f"'{rig.name}' has no bones; choose another armature as the rig")
    check_bone_count(f"'{rig.name}'", len(bones))
    names = [bone.name for bone in bones]
    row = {name: index for index, name in enumerate(names)}
    parents = np.array([row[bone.parent.name] if bone.parent else -1 for bone in bones], int)
    matrix = np.array(rig.matrix_world, float)
    heads = transform_points(matrix, np.array([bone.head_local for bone in bones], float))
    tails = transform_points(matrix, np.array([bone.tail_local for bone in bones], float))
    if not with_skin:
        return RestPose(names, parents, heads, tails)
    bpy.context.view_layer.update()  # Rigid parts follow bones that were just posed.
    points = [np.empty((0, 3))]
    owners = [np.empty(0, int)]
    for mesh in bpy.context.scene.objects:
        if mesh.type == "MESH" and (owned := _owners(mesh, rig, row)) is not None:
            of_mesh = np.empty(3 * len(mesh.data.vertices), np.float32)
            mesh.data.vertices.foreach_get("co", of_mesh)
            # Mesh and rig may move with a common parent: what counts is how one lies in the other.
            here = matrix @ np.array(rig.matrix_world.inverted_safe() @ mesh.matrix_world, float)
            points.append(transform_points(here, of_mesh.reshape(-1, 3).astype(float))[owned >= 0])
            owners.append(owned[owned >= 0])
    return RestPose(names, parents, heads, tails, np.concatenate(points), np.concatenate(owners))


def _owners(mesh: Object, rig: Object, row: dict[str, int]) -> IndexArray | None:
    """Return the bone that moves each vertex most (V,), -1 for none; None if the rig does not move
    the mesh.
    """
    vertices = mesh.data.vertices
    if mesh.parent == rig and mesh.parent_type == "BONE":
        return np.full(len(vertices), row.get(mesh.parent_bone, -1), int)
    if not is_deformed_by(mesh, rig):
        return None
    bone_of = [row.get(group.name, -1) for group in mesh.vertex_groups]
    owners = np.full(len(vertices), -1, int)
    for index, vertex in enumerate(vertices):
        most = 0.0
        for element in vertex.groups:
            if element.weight > most and bone_of[element.group] >= 0:
                most = element.weight
                owners[index] = bone_of[element.group]
    return owners
