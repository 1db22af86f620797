# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig that follows is posed as the same frame of a retargeted capture, and can be given its pose
back.

Selection, mode and hidden objects are as they were.
"""

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from scope.scope_addon.errors import UsageError
from scope.scope_addon.scene import live_rig
from scope.scope_addon.scene.live_rig import LiveRig
from scope.scope_addon.scene.rig_retarget import RetargetOptions, guess_bone_map, retarget
from scope.scope_addon.scene.visibility import SceneBefore
from scope.solver.rotations import exp, quaternion_from_matrix

from ...edit.walking import BODY, RATE, motion_of, walk
from ..made_rigs import FRAMES, build_rig, captured, seen


@pytest.mark.parametrize(
    "options", [RetargetOptions(offset=(1.5, 0, 0)), RetargetOptions(False, "in-place")]
)
def test_the_pose_is_that_of_the_retargeted_frame(options):
    motion = motion_of(walk(2.0))
    rig, bones = build_rig("mixamo")
    bone_map = guess_bone_map(rig)
    for part in ("left_hip", "right_elbow", "spine2"):  # of quaternions, Euler angles and an axis
        posed = rig.pose.bones[bones[part]]
        posed.location = (0.1, 0.0, 0.05)
        posed.scale = (1.3, 1.0, 1.2)
    live = LiveRig(rig, BODY, bone_map, options)
    followed = []
    for frame in FRAMES:
        rotations = exp(motion.poses[frame - 1].reshape(-1, 3).astype(float))
        pelvis = BODY.rest_joints(motion.betas)[0] + motion.trans[frame - 1]
        live.show(quaternion_from_matrix(rotations), pelvis, motion.betas)
        posed = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
        followed.append(
            [np.array(posed.matrix_world @ posed.pose.bones[name].head) for name in bones.values()]
        )
    retarget(captured(motion), BODY, np.zeros(BODY.P), rig, bone_map, RATE, options)
    # The pelvis is lowered smoothly in time for stretched legs, and without the later frames a
    # little differently, which moves the knees most.
    np.testing.assert_allclose(followed, seen(rig, bones.values()), atol=0.004)


def test_the_pose_and_the_parent_from_before_are_kept():
    rig, bones = build_rig("unreal")
    parent = bpy.data.objects.new("parent", None)
    bpy.context.scene.collection.objects.link(parent)
    parent.matrix_world = Matrix.Translation((3, 4, 0)) @ Matrix.Rotation(1.0, 4, "Z")
    rig.parent = parent
    first = rig.pose.bones[0]
    first.location = (0.1, 0.2, 0.3)
    before = [bone.matrix_basis.copy() for bone in rig.pose.bones]
    live = LiveRig(rig, BODY, guess_bone_map(rig))
    assert [bone.matrix_basis for bone in rig.pose.bones] == before
    pelvis = np.array([0.5, 0.5, 0.9])
    upright = quaternion_from_matrix(exp(np.array([[np.pi / 2, 0, 0], *np.zeros((23, 3))])))
    live.show(upright, pelvis, np.zeros(BODY.P))
    bpy.context.view_layer.update()
    assert [bone.matrix_basis for bone in rig.pose.bones] != before
    head = rig.matrix_world @ rig.pose.bones[bones["pelvis"]].head
    assert abs(head.x) < 1.0  # where the body is, rather than where the parent is
    live.restore()
    np.testing.assert_allclose([bone.matrix_basis for bone in rig.pose.bones], before, atol=1e-5)
    assert rig.parent == parent


def test_a_removed_rig_is_left_out():
    rig, _ = build_rig("unity")
    live = LiveRig(rig, BODY, guess_bone_map(rig))
    bpy.data.objects.remove(rig)
    assert live.rig is None
    live.show(np.tile([1.0, 0, 0, 0], (24, 1)), np.zeros(3), np.zeros(BODY.P))
    live.restore()


def test_a_missing_bone_is_an_error():
    rig, bones = build_rig("unity")
    bone_map = guess_bone_map(rig)
    rig.data.bones[bones["left_knee"]].name = "other"
    with pytest.raises(UsageError, match="has no bone"):
        LiveRig(rig, BODY, bone_map)


def test_the_proportions_follow_the_shape_but_not_at_every_pose(monkeypatch):
    rig, _ = build_rig("unity")
    live = LiveRig(rig, BODY, guess_bone_map(rig))
    now = [100.0]
    monkeypatch.setattr(live_rig.time, "monotonic", lambda: now[0])
    first = live._transfer_of(np.zeros(BODY.P))
    tall = np.linspace(1, 0, BODY.P)
    assert live._transfer_of(tall) is first  # not yet
    now[0] += 1.0
    second = live._transfer_of(tall)
    assert second is not first
    now[0] += 1.0
    assert live._transfer_of(tall + 0.01) is second  # too little


def test_what_changed_is_restored_and_what_is_gone_is_left_out():
    for name in ("a", "b", "c"):
        bpy.ops.object.armature_add()
        bpy.context.object.name = name
    objects = bpy.data.objects
    objects["b"].select_set(True)
    objects["a"].hide_set(True)
    bpy.ops.object.mode_set(mode="POSE")  # of c, which is active
    before = SceneBefore()
    bpy.ops.object.mode_set(mode="OBJECT")
    objects["a"].hide_set(False)
    objects["c"].select_set(False)
    bpy.context.view_layer.objects.active = objects["a"]
    bpy.data.objects.remove(objects["b"])
    before.restore()
    assert bpy.context.view_layer.objects.active.name == "c"
    assert bpy.context.object.mode == "POSE"
    assert objects["a"].hide_get()
    assert objects["c"].select_get()


def test_another_scene_is_left_alone():
    first = bpy.context.scene
    other = bpy.data.scenes.new("other")
    before = SceneBefore()
    window = bpy.context.window_manager.windows[0]
    hidden = bpy.data.objects.new("hidden", None)
    other.collection.objects.link(hidden)
    hidden.hide_set(True, view_layer=other.view_layers[0])
    with bpy.context.temp_override(window=window):
        window.scene = other
        before.restore()
        assert hidden.hide_get(view_layer=other.view_layers[0])
        window.scene = first
