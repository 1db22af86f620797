# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs with common naming schemes and other proportions, a capture to retarget, and positions of bones and joints."""

import math

import bpy
import numpy as np
from mathutils import Matrix, Vector
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.scene.packed_motion import pack_motion

from ..edit.walking import BODY, RATE, motion_of, walk

FRAMES = range(1, 60, 6)
FBX = Matrix.LocRotScale((0.4, -0.3, 0), Matrix.Rotation(math.radians(90), 3, "X").to_quaternion(), (0.01,) * 3)
ARMS = [(f"{s}_{a}", f"{s}_{b}") for s in ("left", "right") for a, b in (("shoulder", "elbow"), ("elbow", "wrist"))]
LEGS = [(f"{s}_{a}", f"{s}_{b}") for s in ("left", "right") for a, b in (("hip", "knee"), ("knee", "ankle"))]
# Parts in the order of a person's chains, with positions of the left side in a T-pose; metres.
PLACES = {
    "pelvis": (0, 0, 0.95), "spine1": (0, 0.01, 1.05), "spine2": (0, 0.02, 1.2), "spine3": (0, 0.01, 1.33),
    "neck": (0, 0.02, 1.5), "head": (0, 0, 1.6), "hip": (0.1, 0, 0.9), "knee": (0.1, -0.01, 0.5),
    "ankle": (0.1, 0.02, 0.08), "foot": (0.1, -0.12, 0.02), "collar": (0.04, 0.0, 1.44), "shoulder": (0.17, 0.02, 1.45),
    "elbow": (0.43, 0.03, 1.45), "wrist": (0.68, 0.02, 1.45),
}  # fmt: skip
PARENTS = {
    "spine1": "pelvis", "spine2": "spine1", "spine3": "spine2", "neck": "spine3", "head": "neck", "hip": "pelvis",
    "knee": "hip", "ankle": "knee", "foot": "ankle", "collar": "spine3", "shoulder": "collar", "elbow": "shoulder",
    "wrist": "elbow",
}  # fmt: skip
SIDED = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist")
CENTRE = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")
SCHEMES = {
    "mixamo": (
        ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head"),
        ("UpLeg", "Leg", "Foot", "ToeBase", "Shoulder", "Arm", "ForeArm", "Hand"),
        lambda name, side: "mixamorig:" + side.title() + name,
    ),
    "unreal": (
        ("pelvis", "spine_01", "spine_02", "spine_03", "neck_01", "head"),
        ("thigh", "calf", "foot", "ball", "clavicle", "upperarm", "lowerarm", "hand"),
        lambda name, side: f"{name}_{side[0]}" if side else name,
    ),
    "unity": (
        ("Hips", "Spine", "Chest", "UpperChest", "Neck", "Head"),
        ("UpperLeg", "LowerLeg", "Foot", "Toes", "Shoulder", "UpperArm", "LowerArm", "Hand"),
        lambda name, side: side.title() + name,
    ),
    "mpfb": (
        ("root", "spine05", "spine03", "spine01", "neck01", "head"),
        ("upperleg01", "lowerleg01", "foot", "toe1-1", "clavicle", "upperarm01", "lowerarm01", "wrist"),
        lambda name, side: f"{name}.{side[0].upper()}" if side else name,
    ),
    "smpl": (
        CENTRE,
        SIDED,
        lambda name, side: f"{side}_{name}" if side else name,
    ),
    "biped": (
        ("Pelvis", "Spine", "Spine1", "Spine2", "Neck", "Head"),
        ("Thigh", "Calf", "Foot", "Toe0", "Clavicle", "UpperArm", "Forearm", "Hand"),
        lambda name, side: f"Bip01 {side[:1].upper()} {name}" if side else f"Bip01 {name}",
    ),
    "vroid": (
        ("Hips", "Spine", "Chest", "UpperChest", "Neck", "Head"),
        ("UpperLeg", "LowerLeg", "Foot", "ToeBase", "Shoulder", "UpperArm", "LowerArm", "Hand"),
        lambda name, side: f"J_Bip_{side[:1].upper() or 'C'}_{name}",
    ),
    "character creator": (
        ("Hip", "Waist", "Spine01", "Spine02", "NeckTwist01", "Head"),
        ("Thigh", "Calf", "Foot", "ToeBase", "Clavicle", "Upperarm", "Forearm", "Hand"),
        lambda name, side: f"CC_Base_{side[:1].upper()}_{name}" if side else f"CC_Base_{name}",
    ),
    "nameless": (
        tuple("abcdef"),
        tuple("ghijklmn"),
        lambda name, side: {"left": "x", "right": "y", "": "z"}[side] * 3 + name,
    ),
}


def names_of(scheme):
    """Return the bone of each part."""
    centre, sided, spell = SCHEMES[scheme]
    found = {part: spell(name, "") for part, name in zip(CENTRE, centre, strict=True)}
    for side in ("left", "right"):
        found |= {f"{side}_{part}": spell(name, side) for part, name in zip(SIDED, sided, strict=True)}
    return found


def build_rig(scheme, size=1.3, drop=40.0, seed=1, matrix=None):
    """Build a rig of other proportions in an A-pose with random rolls; every fifth bone uses Euler angles."""
    rng = np.random.default_rng(seed)
    matrix = matrix or Matrix()
    bones = names_of(scheme)
    data = bpy.data.armatures.new(scheme)
    rig = bpy.data.objects.new(scheme, data)
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig

    def place(part):
        side, _, kind = part.partition("_")
        p = Vector(PLACES[kind or part])
        if kind in ("shoulder", "elbow", "wrist"):
            centre = Vector(PLACES["shoulder"])
            p = centre + Matrix.Rotation(math.radians(drop), 3, "Y") @ (p - centre) * 0.9
        return Vector((-p.x if side == "right" else p.x, p.y, p.z)) * size

    bpy.ops.object.mode_set(mode="EDIT")
    for part, name in bones.items():
        side, _, kind = part.partition("_")
        head = place(part)
        after = {"hip": "knee", "knee": "ankle", "ankle": "foot", "shoulder": "elbow", "elbow": "wrist"}.get(kind)
        tail = place(f"{side}_{after}") if after else head + Vector((0, 0, 0.1))
        if kind == "wrist":
            tail = head + (head - place(f"{side}_elbow")) * 0.4
        elif kind == "foot":
            tail = head + Vector((0, -0.06, 0))
        bone = data.edit_bones.new(name)
        bone.head, bone.tail = matrix.inverted() @ head, matrix.inverted() @ tail
        bone.roll = rng.uniform(-3, 3)
        parent = PARENTS.get(kind or part)
        if parent:
            bone.parent = data.edit_bones[bones[f"{side}_{parent}" if parent in SIDED else parent]]
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.matrix_world = matrix
    for k, bone in enumerate(rig.pose.bones):
        bone.rotation_mode = ("QUATERNION", "QUATERNION", "XYZ", "QUATERNION", "AXIS_ANGLE")[k % 5]
    bpy.context.view_layer.update()
    return rig, bones


def captured(motion, body=BODY):
    """Return the armature of a capture, built at the scene's frame 1 and at its own rate."""
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = int(RATE), 1.0
    return build_scene([motion], body, None, BuildOptions(start_frame=1.0)).people[0].armature


def captured_together():
    """Return the armatures of two people whom one camera has captured, each with its motion, at frame 10."""
    scene = bpy.context.scene
    scene.render.fps = 30
    motions = [motion_of(walk(1.0)), motion_of(walk(1.0, speed=0.8))]
    people = [p.armature for p in build_scene(motions, BODY, None, BuildOptions()).people]
    for person, motion in zip(people, motions, strict=True):
        pack_motion(person, motion.to_bytes())
    scene.frame_set(10)
    return people


def truth(motion=None, body=BODY):
    """Return the joints (T, K+1, 3) by forward kinematics of the motion."""
    motion, rest = motion or motion_of(walk(2.0)), body.rest_joints(np.zeros(body.P))
    out = np.empty((len(motion), body.K + 1, 3))
    for t, row in enumerate(motion.poses.reshape(len(motion), -1, 3)):
        R = []
        for i, w in enumerate(row):
            w = Vector(w)
            local = np.array(Matrix.Rotation(w.length, 3, w if w.length else Vector((1, 0, 0))))
            parent = body.parents[i]
            R.append(local if parent < 0 else R[parent] @ local)
            if parent < 0:
                out[t, i] = rest[0] + motion.trans[t]
            else:
                out[t, i] = out[t, parent] + R[parent] @ (rest[i] - rest[parent])
    return out


def renamed(rig, names):
    """Link a copy of a rig to the scene whose bones have other names, by their present ones."""
    data = rig.data.copy()
    for bone, name in names.items():
        data.bones[bone].name = name
    own = bpy.data.objects.new("own", data)
    bpy.context.scene.collection.objects.link(own)
    return own


def seen(rig, bones, frames=FRAMES):
    """Return the heads (T, B, 3) in the world."""
    out = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        posed = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
        out.append([np.array(posed.matrix_world @ posed.pose.bones[name].head) for name in bones])
    return np.array(out)


# Where MPFB's default rig has the bones that its face is known and measured by, and the tip of each; decimetres.
MPFB_FACE = {
    "jaw": ((0, 6.88, 0.64), (0, 6.16, 1.23)),
    "eye.L": ((0.31, 7.28, 1.25), (0.32, 7.29, 1.62)),
    "orbicularis03.L": ((0.31, 7.28, 1.25), (0.32, 7.41, 1.59)),
    "orbicularis04.L": ((0.31, 7.28, 1.25), (0.32, 7.18, 1.6)),
    "levator05.L": ((0.3, 6.63, 1.41), (0.26, 6.55, 1.41)),
}


def add_mpfb_face(rig):
    """Give a rig the bones of the face of MPFB's default rig, by which Scope knows it."""
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bones, head = rig.data.edit_bones, rig.data.edit_bones["head"]
    for name, ends in MPFB_FACE.items():
        for side in (1, -1) if name.endswith(".L") else (1,):
            bone = bones.new(name if side == 1 else name.replace(".L", ".R"))
            at = [Vector((side * x, -z, y - 6)) * 0.1 + head.head for x, y, z in ends]
            (bone.head, bone.tail), bone.parent, bone.roll = at, head, 0.3
    bpy.ops.object.mode_set(mode="OBJECT")
