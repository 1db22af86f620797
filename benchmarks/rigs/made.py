# SPDX-License-Identifier: GPL-3.0-or-later
"""Making one of the rigs in Blender: bones with the names of its kind, and a skin of boxes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector

from .kinds import ARM, FINGERS, PLACES, RigKind

# Where the skin of a bone at a place ends, if no bone of its chain comes after.
_SKIN_END = {
    "hip": "knee", "thigh2": "knee", "knee": "ankle", "shin2": "ankle", "ankle": "ball",
    "ball": "toe", "shoulder": "elbow", "arm2": "elbow", "elbow": "wrist", "fore2": "wrist",
    "wrist": "tip", "head": "top", "neck": "top", "spine1": "neck", "collar": "shoulder",
}  # fmt: skip
_WIDTH_M = 0.03


@dataclass(frozen=True)
class _Row:
    """A bone to be made."""

    name: str
    parent: str
    place: str
    side: int  # 1 left and centre, -1 right
    head: Vector
    end: Vector  # of its skin


@dataclass(frozen=True)
class MadeRig:
    """A rig, and the bones that lie at places of the body, such as ``left knee``."""

    armature: bpy.types.Object
    skins: list[bpy.types.Object]
    bone_at: dict[str, str]
    hand_ends: dict[str, Vector]  # by side: the middle knuckle at rest, in the armature


def make_rig(kind: RigKind, seed: int = 0) -> MadeRig:
    """Make a rig with its skin in the active scene."""
    rows = _rows(kind)
    rng = np.random.default_rng(seed)
    turn = Matrix.Rotation(math.radians(kind.turned), 4, "Z")
    upright = Matrix.Rotation(math.radians(90), 4, "X") if kind.lying else Matrix()
    object_matrix = turn @ upright @ Matrix.Scale(kind.unit, 4)
    into_armature = object_matrix.inverted() @ turn
    armature = bpy.data.armatures.new(kind.name)
    rig = bpy.data.objects.new(kind.name, armature)
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for row in rows:
        bone = armature.edit_bones.new(row.name)
        bone.head = into_armature @ row.head
        bone.tail = into_armature @ _tail(kind, row, rng)
        if (bone.tail - bone.head).length < 1e-4 / kind.unit:
            bone.tail = into_armature @ (row.head + Vector((0, 0, 0.05)))
        bone.roll = rng.uniform(-3, 3)
        if row.parent:
            bone.parent = armature.edit_bones[row.parent]
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.matrix_world = object_matrix
    bpy.context.view_layer.update()
    skins = _skins(kind, rows, rig, into_armature)
    if kind.other_armature:
        other = bpy.data.objects.new("Hat", bpy.data.armatures.new("Hat"))
        bpy.context.scene.collection.objects.link(other)
    sides = {1: "left", -1: "right"}
    bone_at: dict[str, str] = {}
    for row in rows:
        bone_at.setdefault(f"{sides[row.side]} {row.place}", row.name)
    ends = {name: into_armature @ _place(kind, "middle1", side) for side, name in sides.items()}
    return MadeRig(rig, skins, bone_at, ends)


def _rows(kind: RigKind) -> list[_Row]:
    """Return the bones, parents before children."""
    rows: list[_Row] = []
    for chain in kind.chains:
        for side, word in ((1, kind.sides[0]), (-1, kind.sides[1])):
            if side == 1 or "{s}" in chain:
                rows += _chain(kind, chain.replace("{s}", word), side if "{s}" in chain else 1)
    wrists = {
        row.side: row.name
        for row in reversed(rows)
        if row.place == "wrist" and "ik" not in row.name
    }
    for side, word in ((1, kind.sides[0]), (-1, kind.sides[1])) if kind.fingers else ():
        for finger, name in zip(FINGERS, kind.finger_names, strict=True):
            spelled = (
                kind.fingers.replace("f_thumb", "thumb") if finger == "thumb" else kind.fingers
            )
            spelled = spelled.replace("f_{f}", "thumb") if finger == "thumb" else spelled
            bones = ", ".join(
                f"{spelled.format(s=word, f=name, k=phalanx)}@{finger}{k}"
                for k, phalanx in enumerate(kind.phalanges, 1)
            )
            rows += _chain(kind, f"{wrists[side]} > {bones}", side)
    return rows


def _chain(kind: RigKind, chain: str, side: int) -> list[_Row]:
    parent, _, listed = chain.partition(">")
    entries = [entry.strip().rpartition("@") for entry in listed.split(",")]
    rows = []
    above = parent.strip()
    for k, (name, _, place) in enumerate(entries):
        after = entries[k + 1][2] if k + 1 < len(entries) else _SKIN_END.get(place, "")
        head = _place(kind, place, side)
        end = _place(kind, after, side) if after else head + Vector((0, 0, 0.04))
        if (end - head).length < 1e-4:
            end = _place(kind, _SKIN_END.get(place, "top"), side)
        rows.append(_Row(name, above, place, side, head, end))
        above = name
    return rows


def _place(kind: RigKind, place: str, side: int) -> Vector:
    """Return a place in the rig's rest pose, the person looking along -y, metres."""
    at = Vector(PLACES[place])
    if place in ARM or place.rstrip("0123") in FINGERS:
        centre = Vector(PLACES["shoulder"])
        lowered = Matrix.Rotation(math.radians(kind.arms_down), 3, "Y")
        at = centre + lowered @ (at - centre)
    at = Vector((side * at.x, at.y, at.z)) * kind.height
    return at + Vector((0, 0, kind.lift if place != "ground" else 0.0))


def _tail(kind: RigKind, row: _Row, rng: np.random.Generator) -> Vector:
    if kind.tails == "up":
        return row.head + Vector((0, 0, 0.1))
    if kind.tails == "random":
        return row.head + 0.1 * Vector(rng.normal(size=3)).normalized()
    if kind.tails == "deep" and row.place in ("knee", "wrist", "ball", "head"):
        return row.head + (row.end - row.head).normalized() * 44
    return row.end


def _skins(
    kind: RigKind, rows: list[_Row], rig: bpy.types.Object, into_armature: Matrix
) -> list[bpy.types.Object]:
    """Return one mesh of boxes, or a rigid part for each bone."""
    carrying = [
        row for row in rows if row.place not in ("ground", "low") and not _is_bare(row.name)
    ]
    # Of several bones at one place, such as twist bones, the first carries the skin.
    first = {(row.place, row.side): row for row in reversed(carrying)}
    boxes = [(row, _box(kind, row)) for row in first.values()]
    if kind.rigid:
        return [_part(rig, row, vertices) for row, vertices in boxes]
    mesh = bpy.data.meshes.new("skin")
    points = [into_armature @ point for _, vertices in boxes for point in vertices]
    mesh.from_pydata(points, [], [face for k in range(len(boxes)) for face in _faces(8 * k)])
    skin = bpy.data.objects.new("skin", mesh)
    bpy.context.scene.collection.objects.link(skin)
    for k, (row, _) in enumerate(boxes):
        skin.vertex_groups.new(name=row.name).add(list(range(8 * k, 8 * k + 8)), 1.0, "REPLACE")
    skin.parent = rig
    skin.modifiers.new("rig", "ARMATURE").object = rig
    return [skin]


def _part(rig: bpy.types.Object, row: _Row, vertices: list[Vector]) -> bpy.types.Object:
    """Return a rigid mesh that a bone carries."""
    mesh = bpy.data.meshes.new(row.name)
    mesh.from_pydata(vertices, [], _faces(0))
    part = bpy.data.objects.new(row.name, mesh)
    bpy.context.scene.collection.objects.link(part)
    part.parent = rig
    part.parent_type = "BONE"
    part.parent_bone = row.name
    bpy.context.view_layer.update()
    part.matrix_world = Matrix()
    return part


def _box(kind: RigKind, row: _Row) -> list[Vector]:
    """Return the eight corners of a bone's box; those of feet stand on the floor."""
    head = row.head
    end = row.end
    if row.place in ("ankle", "ball"):
        floor = kind.lift
        back = _place(kind, "heel", row.side) if row.place == "ankle" else head
        has_toes = any("@ball" in chain for chain in kind.chains)
        is_whole = row.place == "ball" or not has_toes
        front = _place(kind, "toe" if is_whole else "ball", row.side)
        wide = Vector((_WIDTH_M, 0, 0))
        corners = []
        for at, top in ((back, head.z), (front, floor + 0.04 * kind.height)):
            for side, height in ((1, floor), (1, top), (-1, top), (-1, floor)):
                corners.append(Vector((at.x, at.y, height)) + side * wide)
        return corners
    axis = (end - head).normalized()
    one = axis.orthogonal().normalized() * _WIDTH_M
    other = axis.cross(one)
    around = ((1, 1), (1, -1), (-1, -1), (-1, 1))
    return [at + one * a + other * b for at in (head, end) for a, b in around]


def _faces(first: int) -> list[tuple[int, ...]]:
    sides = [(k, 4 + k, 4 + (k + 1) % 4, (k + 1) % 4) for k in range(4)]
    return [
        tuple(first + corner for corner in face) for face in [(0, 1, 2, 3), (7, 6, 5, 4), *sides]
    ]


def _is_bare(name: str) -> bool:
    """Return whether a bone carries no skin: a goal, or hair."""
    return any(word in name for word in ("ik", "IK", "ＩＫ", "pole", "Hair", "RootPart"))
