# SPDX-License-Identifier: GPL-3.0-or-later
"""Fingers of rigs are found by name and by geometry, and point in the direction of the body's."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector
from scope.scope_addon.edit.clip import Clip
from scope.scope_addon.retarget.bone_map import BoneMap
from scope.scope_addon.scene.actions import bone_path, fcurves
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.scene.rig_retarget import guess_bone_map
from scope.solver.body_file import load_body
from scope.solver.rotations import exp

from ..edit.walking import BODY, motion_of, walk
from .made_rigs import FBX, FRAMES, angles, build_rig, captured, run, seen, truth

HANDS = load_body("scope_h")
FINGERS = ("thumb", "index", "middle", "ring", "pinky")
# Knuckle, the two joints after it and the tip: along the arm, across to the thumb's side, down;
# metres from the wrist.
SHAPE = {
    "thumb": ((0.02, 0.03, 0.01), (0.05, 0.06, 0.02), (0.075, 0.075, 0.03), (0.095, 0.085, 0.035)),
    "index": ((0.1, 0.03, 0), (0.14, 0.032, 0), (0.165, 0.034, 0.004), (0.185, 0.035, 0.01)),
    "middle": ((0.105, 0.01, 0), (0.15, 0.01, 0), (0.178, 0.01, 0.004), (0.2, 0.01, 0.01)),
    "ring": ((0.1, -0.01, 0), (0.14, -0.012, 0), (0.165, -0.013, 0.004), (0.185, -0.014, 0.01)),
    "pinky": ((0.09, -0.03, 0), (0.118, -0.034, 0), (0.137, -0.037, 0.004), (0.152, -0.039, 0.01)),
}
UNITY = {1: "Proximal", 2: "Intermediate", 3: "Distal"}
SPELL = {
    "mixamo": lambda f, k, side: f"mixamorig:{side.title()}Hand{f.title()}{k}",
    "unreal": lambda f, k, side: f"{f}_{k:02d}_{side[0]}",
    "unity": lambda f, k, side: (
        f"{side.title()}{'Little' if f == 'pinky' else f.title()}{UNITY[k]}"
    ),
    "mpfb": lambda f, k, side: f"finger{FINGERS.index(f) + 1}-{k}.{side[0].upper()}",
    "smpl": lambda f, k, side: f"{side}_{f}{k}",
    "biped": lambda f, k, side: f"Bip01 {side[0].upper()} Finger{FINGERS.index(f)}{k - 1 or ''}",
    "vroid": lambda f, k, side: (
        f"J_Bip_{side[0].upper()}_{'Little' if f == 'pinky' else f.title()}{k}"
    ),
    "character creator": lambda f, k, side: (
        f"CC_Base_{side[0].upper()}_{'Mid' if f == 'middle' else f.title()}{k}"
    ),
    "nameless": lambda f, k, side: f"{side[0]}{'qwert'[FINGERS.index(f)]}{'uvw'[k - 1]}",
}
PALM = {
    "unreal": lambda f, side: f"{f}_metacarpal_{side[0]}",
    "mpfb": lambda f, side: f"metacarpal{FINGERS.index(f)}.{side[0].upper()}",
}


def build_hands(scheme, twist=0.6, **options):
    """Build a rig with fingers and rotated palms; return it with the bones of the phalanges by
    part.
    """
    rig, bone_of = build_rig(scheme, **options)
    to_armature = rig.matrix_world.inverted()
    size = options.get("size", 1.3)
    rng = np.random.default_rng(5)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    edit = rig.data.edit_bones
    spell = SPELL[scheme]
    found = {}

    def bone(name, parent, head, tail):
        new = edit.new(name)
        new.head = to_armature @ head
        new.tail = to_armature @ tail
        new.parent = parent
        new.roll = rng.uniform(-3, 3)
        return new

    for side in ("left", "right"):
        wrist = edit[bone_of[f"{side}_wrist"]]
        elbow = edit[bone_of[f"{side}_elbow"]]
        start = rig.matrix_world @ wrist.head
        along = (start - rig.matrix_world @ elbow.head).normalized()
        down = along.cross(Vector((0, -1, 0))) * (1 if side == "left" else -1)
        turn = Matrix.Rotation(twist if side == "left" else -twist, 3, along)
        axes = [along, turn @ Vector((0, -1, 0)), turn @ down.normalized()]
        for finger in FINGERS:
            offsets = [
                sum((c * a for c, a in zip(p, axes, strict=True)), Vector()) for p in SHAPE[finger]
            ]
            points = [start + size * offset for offset in offsets]
            above = wrist
            if scheme in PALM and finger != "thumb":
                above = bone(
                    PALM[scheme](finger, side), wrist, start.lerp(points[0], 0.2), points[0]
                )
            for k in (1, 2, 3):
                above = bone(spell(finger, k, side), above, points[k - 1], points[k])
                found[f"{side}_{finger}{k}"] = above.name
            if scheme == "mixamo":  # its leaves
                bone(spell(finger, 4, side), above, points[3], 2 * points[3] - points[2])
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.update()
    return rig, bone_of | found


def gesture():
    """Return a walk whose hands open and close; every finger and wrist moves differently."""
    plain = walk(2.0)
    rotations = np.tile(np.eye(3), (len(plain), HANDS.K + 1, 1, 1))
    phase = 2 * np.pi * plain.times
    for i, name in enumerate(HANDS.joint_names):
        side, _, part = name.partition("_")
        if name in BODY.joint_names:
            rotations[:, i] = plain.rotations[:, BODY.joint_names.index(name)]
        sign = 1.0 if side == "left" else -1.0
        if part == "wrist":
            rotations[:, i] = exp(
                np.stack([0.5 * np.sin(phase), 0 * phase, 0.3 * sign * np.cos(phase)], axis=1)
            )
        elif part[:-1] in FINGERS:
            bend = 0.5 * (1 + np.sin(phase + FINGERS.index(part[:-1])))
            axis = [0, sign, 0] if part.startswith("thumb") else [0, 0, -sign]
            rotations[:, i] = exp(bend[:, None] * axis)
    return Clip(plain.times, rotations, plain.root)


@pytest.fixture
def source():
    return captured(motion_of(gesture(), body=HANDS), HANDS)


def check_hands(rig, bone_of):
    """Check that phalanges and palms have the directions of the body's at the checked frames."""
    joints = truth(motion_of(gesture(), body=HANDS), HANDS)[[f - 1 for f in FRAMES]]
    parts = list(bone_of)
    heads = seen(rig, [bone_of[part] for part in parts])
    for side in ("left", "right"):

        def rows(part, side=side):
            part = f"{side}_{part}"
            return heads[:, parts.index(part)], joints[:, HANDS.joint_names.index(part)]

        for finger in FINGERS:
            for k in (1, 2):
                (a, A) = rows(f"{finger}{k}")
                (b, B) = rows(f"{finger}{k + 1}")
                assert angles(b - a, B - A).max() < 1.0, (side, finger, k)
        (w, W), (i, I), (p, P) = (rows(part) for part in ("wrist", "index1", "pinky1"))
        assert angles(np.cross(i - w, p - w), np.cross(I - W, P - W)).max() < 1.0, side


def test_fingers_are_guessed():
    for scheme in SPELL:
        rig, bone_of = build_hands(scheme)
        found = guess_bone_map(rig).parts
        assert {bone: part for part, bone in bone_of.items()} == found, scheme


@pytest.mark.parametrize(("scheme", "twist"), [("mixamo", 0.9), ("unreal", -0.6)])
def test_fingers_point_where_the_body_points(source, scheme, twist):
    rig, bone_of = build_hands(scheme, twist, matrix=FBX if scheme == "mixamo" else None)
    run(source, rig, body=HANDS)
    check_hands(rig, bone_of)


def test_the_palms_of_hands_with_fewer_fingers_are_aligned(source):
    """They are turned at rest, and the outermost knuckles that there are show how far."""
    rig, bone_of = build_hands("unreal", 1.2)
    parts = guess_bone_map(rig).parts
    run(source, rig, BoneMap({b: p for b, p in parts.items() if "pinky" not in p}), body=HANDS)
    joints = truth(motion_of(gesture(), body=HANDS), HANDS)[[f - 1 for f in FRAMES]]
    for side in ("left", "right"):
        names = [f"{side}_{part}" for part in ("wrist", "index1", "ring1")]
        w, i, r = np.moveaxis(seen(rig, [bone_of[name] for name in names]), 1, 0)
        W, I, R = np.moveaxis(joints[:, [HANDS.joint_names.index(name) for name in names]], 1, 0)
        assert angles(np.cross(i - w, r - w), np.cross(I - W, R - W)).max() < 1.0, side


def test_captured_fingers_that_the_map_lacks_are_reported(source):
    rig, bone_of = build_hands("unreal")
    parts = guess_bone_map(rig).parts
    plain = {bone: part for bone, part in parts.items() if part[:-1].split("_")[-1] not in FINGERS}
    (warning,) = run(source, rig, BoneMap(plain), body=HANDS).warnings
    hands = [bone_of["left_wrist"], bone_of["right_wrist"]]
    assert (warning.code, warning.values["hands"]) == ("unlisted_fingers", hands)
    thumbs = plain | {bone: part for bone, part in parts.items() if "thumb" in part}
    assert run(source, rig, BoneMap(thumbs), body=HANDS).warnings == []
    without, _ = build_rig("unreal")
    assert run(source, without, body=HANDS).warnings == []


@pytest.mark.slow
def test_fingers_of_rigify(source, rigify_rigs):
    for rig, prefix in rigify_rigs:
        bone_of = {}
        for side in ("left", "right"):
            bone_of[f"{side}_wrist"] = f"{prefix}hand.{side[0].upper()}"
            for f in FINGERS:
                name = f if f == "thumb" else f"f_{f}"
                bone_of |= {
                    f"{side}_{f}{k}": f"{prefix}{name}.{k:02d}.{side[0].upper()}" for k in (1, 2, 3)
                }
        run(source, rig, body=HANDS)
        check_hands(rig, bone_of)


def test_fingers_of_a_hand_that_was_not_seen_stay_as_they_are() -> None:
    """The body has fingers, but those of such a hand are at rest in every frame."""
    clip = gesture()
    for i, name in enumerate(HANDS.joint_names):
        side, _, part = name.partition("_")
        if side == "left" and part[:-1] in FINGERS:
            clip.rotations[:, i] = np.eye(3)
    source = captured(motion_of(clip, body=HANDS), HANDS)
    rig, bone_of = build_hands("unreal")
    curled = Matrix.Rotation(0.7, 4, "X")
    for side in ("left", "right"):
        rig.pose.bones[bone_of[f"{side}_ring2"]].matrix_basis = curled
    run(source, rig, body=HANDS)
    keyed = {curve.data_path for curve in fcurves(rig)}
    bpy.context.scene.frame_set(30)
    for side in ("left", "right"):
        for finger in FINGERS:
            for k in (1, 2, 3):
                path = bone_path(bone_of[f"{side}_{finger}{k}"], "rotation_quaternion")
                assert (path in keyed) == (side == "right")
        is_curled = np.allclose(rig.pose.bones[bone_of[f"{side}_ring2"]].matrix_basis, curled)
        assert is_curled == (side == "left")


def test_a_rig_of_the_same_shape_deforms_the_same_mesh(source, blender):
    """The captured body's skeleton with other names: its mesh must coincide with the captured
    one.
    """
    person = build_scene(
        [motion_of(gesture(), body=HANDS)], HANDS, None, BuildOptions(start_frame=1.0)
    ).people[0]
    rig = person.armature
    mesh = person.mesh
    rig.animation_data_clear()
    for name in HANDS.joint_names:
        side, _, part = name.partition("_")
        if part[:-1] in FINGERS:
            rig.data.bones[name].name = SPELL["unreal"](part[:-1], int(part[-1]), side)
    for bone in rig.pose.bones:
        bone.matrix_basis = Matrix()
    run(source, rig, body=HANDS, feet=False)
    captured = next(o for o in source.children if o.type == "MESH")
    for frame in (1, 12, 23, 40):
        bpy.context.scene.frame_set(frame)
        off = np.linalg.norm(blender.vertices(mesh) - blender.vertices(captured), axis=1)
        assert off.max() < 0.002
