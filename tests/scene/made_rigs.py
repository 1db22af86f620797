# SPDX-License-Identifier: GPL-3.0-or-later
"""Rigs with common naming schemes and other proportions, a capture to retarget, and positions of
bones and joints.
"""

import hashlib
import math
import os
import pickle

import bpy
import numpy as np
from mathutils import Matrix, Vector
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.scene.packed_motion import pack_motion
from scope.scope_addon.scene.rig_retarget import RetargetOptions, guess_bone_map, retarget

from ..edit.walking import BODY, NAMES, RATE, motion_of, walk
from ..retarget.naming_schemes import PARENTS, PLACES, SIDED, names_of
from .conftest import truth_of

FRAMES = range(1, 60, 6)
FBX = Matrix.LocRotScale(
    (0.4, -0.3, 0), Matrix.Rotation(math.radians(90), 3, "X").to_quaternion(), (0.01,) * 3
)
ARMS = [
    (f"{s}_{a}", f"{s}_{b}")
    for s in ("left", "right")
    for a, b in (("shoulder", "elbow"), ("elbow", "wrist"))
]
LEGS = [
    (f"{s}_{a}", f"{s}_{b}")
    for s in ("left", "right")
    for a, b in (("hip", "knee"), ("knee", "ankle"))
]
MAX_KEPT = 8  # captures, of 5 MB each
# By what tells their motions apart: the file, and the scene's first, last and current frame.
_kept: dict[str, tuple[str, tuple[int, int, int]]] = {}


def build_rig(scheme, size=1.3, drop=40.0, seed=1, matrix=None):
    """Build a rig of other proportions in an A-pose with random rolls; every fifth bone uses Euler
    angles.
    """
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
        after = {
            "hip": "knee",
            "knee": "ankle",
            "ankle": "foot",
            "shoulder": "elbow",
            "elbow": "wrist",
        }.get(kind)
        tail = place(f"{side}_{after}") if after else head + Vector((0, 0, 0.1))
        if kind == "wrist":
            tail = head + (head - place(f"{side}_elbow")) * 0.4
        elif kind == "foot":
            tail = head + Vector((0, -0.06, 0))
        bone = data.edit_bones.new(name)
        bone.head = matrix.inverted() @ head
        bone.tail = matrix.inverted() @ tail
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
    """Return the armature of a capture, built at the scene's frame 1 and at its own rate.

    In an empty file, a capture that was built before is appended from where it was kept, in a third
    of the time.
    """
    scene = bpy.context.scene
    scene.render.fps = int(RATE)
    scene.render.fps_base = 1.0
    is_plain = body is BODY and not bpy.data.objects and scene.unit_settings.scale_length == 1.0
    key = hashlib.sha1(pickle.dumps(vars(motion))).hexdigest() if is_plain else ""
    if key in _kept:
        return _appended(*_kept[key])
    result = build_scene([motion], body, None, BuildOptions(start_frame=1.0))
    if is_plain and not scene.timeline_markers:
        path = os.path.join(
            os.environ["BLENDER_USER_RESOURCES"], f"captured-{os.getpid()}-{key}.blend"
        )
        bpy.data.libraries.write(path, {result.collection})
        _kept[key] = path, (scene.frame_start, scene.frame_end, scene.frame_current)
        if len(_kept) > MAX_KEPT:
            os.remove(_kept.pop(next(iter(_kept)))[0])
    return result.people[0].armature


def captured_with(motion):
    """Return the armature of a capture, as `captured` does, which stores its motion."""
    armature = captured(motion)
    pack_motion(armature, motion.to_bytes())
    return armature


def _appended(path, frames):
    """Do what `captured` does, with a capture that was kept."""
    with bpy.data.libraries.load(path) as (there, here):
        here.collections = there.collections
    for library in bpy.data.libraries[:]:
        bpy.data.libraries.remove(library)  # the appended blocks remember it; a built file has none
    scene = bpy.context.scene
    (collection,) = here.collections
    scene.collection.children.link(collection)
    scene.frame_start, scene.frame_end = frames[:2]
    scene.frame_set(frames[2])
    armature = next(each for each in collection.objects if each.type == "ARMATURE")
    armature.animation_data.action.use_fake_user = True  # as built; appending clears it
    armature.select_set(True)
    bpy.context.view_layer.objects.active = armature
    return armature


def captured_together(seconds=1.0):
    """Return the armatures of two people whom one camera has captured, each with its motion, at
    frame 10.

    :param seconds: for which the second one was seen.
    """
    scene = bpy.context.scene
    scene.render.fps = 30
    motions = [motion_of(walk(1.0)), motion_of(walk(seconds, speed=0.8))]
    people = [p.armature for p in build_scene(motions, BODY, None, BuildOptions()).people]
    for person, motion in zip(people, motions, strict=True):
        pack_motion(person, motion.to_bytes())
    scene.frame_set(10)
    return people


def truth(motion=None, body=BODY):
    """Return the joints (T, K+1, 3) by forward kinematics of the motion."""
    return truth_of(body, motion or motion_of(walk(2.0))).joints


def renamed(rig, names):
    """Link a copy of a rig to the scene whose bones have other names, by their present ones."""
    data = rig.data.copy()
    for bone, name in names.items():
        data.bones[bone].name = name
    own = bpy.data.objects.new("own", data)
    bpy.context.scene.collection.objects.link(own)
    return own


def run(source, rig, bone_map=None, body=BODY, **options):
    """Retarget a capture to a rig, by its own bone map or the one that is guessed."""
    bone_map = bone_map or guess_bone_map(rig)
    options = RetargetOptions(**options)
    return retarget(source, body, np.zeros(body.P), rig, bone_map, RATE, options)


def direction_error(rig, bone_of, pairs, joints, frames=FRAMES):
    """Return the largest angle between a limb of the rig and the body's, degrees.

    :param joints: (T, K+1, 3) of the body, of which the first is shown in the scene's frame 1.
    """
    joints = joints[[frame - 1 for frame in frames]]
    worst = 0.0
    for a, b in pairs:
        ours = np.diff(seen(rig, [bone_of[a], bone_of[b]], frames), axis=1)[:, 0]
        theirs = joints[:, NAMES.index(b)] - joints[:, NAMES.index(a)]
        worst = max(worst, angles(ours, theirs).max())
    return worst


def angles(a, b):
    """Return the angles between directions (..., 3), degrees."""
    cosine = (a * b).sum(-1) / np.linalg.norm(a, axis=-1) / np.linalg.norm(b, axis=-1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def added_empty(name):
    """Add an empty to the scene."""
    empty = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(empty)
    return empty


def seen(rig, bones, frames=FRAMES):
    """Return the heads (T, B, 3) in the world."""
    out = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        posed = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
        out.append([np.array(posed.matrix_world @ posed.pose.bones[name].head) for name in bones])
    return np.array(out)


# Where MPFB's default rig has the bones that its face is known and measured by, and the tip of
# each; decimetres.
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
    bones = rig.data.edit_bones
    head = rig.data.edit_bones["head"]
    for name, ends in MPFB_FACE.items():
        for side in (1, -1) if name.endswith(".L") else (1,):
            bone = bones.new(name if side == 1 else name.replace(".L", ".R"))
            at = [Vector((side * x, -z, y - 6)) * 0.1 + head.head for x, y, z in ends]
            (bone.head, bone.tail) = at
            bone.parent = head
            bone.roll = 0.3
    bpy.ops.object.mode_set(mode="OBJECT")
