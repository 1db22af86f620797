# SPDX-License-Identifier: GPL-3.0-or-later
"""Retargeting to a generated Rigify rig: the limbs show the same pose by IK as by FK, as evaluated
by Blender.
"""

import bpy
import numpy as np

from ..edit.walking import NAMES, motion_of, walk
from .made_rigs import angles, captured, run

LIMBS = [
    (f"{name}.{side}", kind)
    for side in "LR"
    for name, kind in (("thigh", "leg"), ("upper_arm", "arm"))
]
SECONDS = 0.5
FRAMES = range(1, 17, 3)
BONES = {"leg": ("thigh", "shin", "foot", "toe"), "arm": ("upper_arm", "forearm", "hand")}


def switch(rig, **properties):
    """Set properties of every limb."""
    for limb, _ in LIMBS:
        for name, value in properties.items():
            rig.pose.bones[limb.replace(".", "_parent.")][name] = value
    rig.update_tag()


def posed(rig):
    """Return the deforming bones' ends (T, B, 2, 3) of all limbs in the world."""
    names = [f"ORG-{bone}.{limb[-1]}" for limb, kind in LIMBS for bone in BONES[kind]]
    out = []
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        bpy.context.view_layer.update()
        seen = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
        ends = [(seen.pose.bones[name].head, seen.pose.bones[name].tail) for name in names]
        out.append([[np.array(seen.matrix_world @ end) for end in pair] for pair in ends])
    return np.array(out)


def test_ik_shows_the_pose_of_fk(rigify_rigs):
    motion = motion_of(walk(SECONDS))
    elbows = motion.poses.reshape(len(motion), -1, 3)[
        :, [NAMES.index("left_elbow"), NAMES.index("right_elbow")]
    ]
    # not about the axis about which the rig's IK bends the elbow
    elbows += [[0.4, -1.2, 0.3], [0.5, 0.7, 0.6]]
    motion.poses.reshape(len(motion), -1, 3)[
        :, [NAMES.index("left_elbow"), NAMES.index("right_elbow")]
    ] = elbows
    source = captured(motion)
    rig = rigify_rigs[1][0]
    rig.pose.bones["foot_heel_ik.L"].rotation_euler = (0.4, 0.2, 0.1)  # left by the user
    run(source, rig, root="object")
    switch(rig, IK_FK=1.0)
    by_fk = posed(rig)
    for pole in (False, True):
        switch(rig, IK_FK=0.0, pole_vector=pole)
        by_ik = posed(rig)
        assert np.linalg.norm(by_ik - by_fk, axis=-1).max() < 0.01
        assert angles(*(ends[:, :, 1] - ends[:, :, 0] for ends in (by_fk, by_ik))).max() < 2.0
    assert np.linalg.norm(by_fk[0] - by_fk[-1], axis=-1).max() > 0.1  # it moves


def test_a_leg_that_is_straight_or_overstretched_does_not_turn_about_itself(rigify_rigs):
    """Hip, knee and ankle nearly on one line have no plane that the hinge could be turned into."""
    motion = motion_of(walk(SECONDS))
    turns = motion.poses.reshape(len(motion), -1, 3)
    bent = np.linspace(-0.06, 0.06, len(motion))
    for side in ("left", "right"):
        turns[:, NAMES.index(f"{side}_hip")] = 0.0
        turns[:, NAMES.index(f"{side}_knee")] = bent[:, None] * [1.0, 0.0, 0.0]
    rig = rigify_rigs[1][0]
    run(captured(motion), rig, feet=False)
    bones = [f"ORG-{bone}.{side}" for bone in ("thigh", "shin") for side in "LR"]
    axes = []
    places = []
    for fk in (1.0, 0.0):
        switch(rig, IK_FK=fk)
        places.append(posed(rig))
        axes.append(turned(rig, bones))
    assert np.linalg.norm(places[1] - places[0], axis=-1).max() < 0.01
    cosine = (np.einsum("tbij,tbij->tb", *axes) - 1) / 2
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 15.0


def test_limbs_that_are_folded_and_bent_aside_are_where_fk_has_them(rigify_rigs):
    """A hand at the shoulder, a heel at the seat: the roll decides where elbow and knee are."""
    motion = motion_of(walk(SECONDS))
    turns = motion.poses.reshape(len(motion), -1, 3)
    folded = np.linspace(0.1, 2.9, len(motion))
    aside = 0.6 * np.sin(np.linspace(0.0, 9.0, len(motion)))
    for side, sign in (("left", -1.0), ("right", 1.0)):
        elbow = np.stack([0.0 * folded, sign * folded, aside], axis=1)
        knee = np.stack([0.9 * folded, 0.0 * folded, 0.4 * aside], axis=1)
        turns[:, NAMES.index(f"{side}_elbow")] = elbow
        turns[:, NAMES.index(f"{side}_knee")] = knee
    rig = rigify_rigs[1][0]
    run(captured(motion), rig, feet=False)
    switch(rig, IK_FK=1.0)
    by_fk = posed(rig)
    for pole in (False, True):
        switch(rig, IK_FK=0.0, pole_vector=pole)
        assert np.linalg.norm(posed(rig) - by_fk, axis=-1).max() < 0.01


def turned(rig, names):
    """Return the orientations (T, B, 3, 3) of bones in the armature's space."""
    out = []
    for frame in FRAMES:
        bpy.context.scene.frame_set(frame)
        seen = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
        out.append([np.array(seen.pose.bones[name].matrix.to_3x3().normalized()) for name in names])
    return np.array(out)
