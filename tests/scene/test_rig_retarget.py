# SPDX-License-Identifier: GPL-3.0-or-later
"""Retargeting: the rig as evaluated by Blender against forward kinematics of the motion."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector
from scope.scope_addon.errors import UsageError
from scope.scope_addon.retarget.bone_map import BoneMap
from scope.scope_addon.scene.datablocks import action_of
from scope.scope_addon.scene.export.export import ExportOptions
from scope.scope_addon.scene.rig_file import export_rig
from scope.scope_addon.scene.rig_retarget import guess_bone_map
from scope.solver.errors import InputError
from scope.solver.rotations import exp

from ..edit.walking import NAMES, motion_of, walk
from .made_rigs import (
    ARMS,
    FBX,
    FRAMES,
    LEGS,
    added_empty,
    build_rig,
    captured,
    direction_error,
    run,
    seen,
    truth,
)

JOINTS = truth()


@pytest.fixture
def source():
    return captured(motion_of(walk(2.0)))


@pytest.mark.parametrize(("scheme", "feet"), [("mixamo", False), ("unreal", True)])
def test_limbs_point_where_the_body_points(source, scheme, feet):
    rig, bone_of = build_rig(scheme, matrix=FBX if scheme == "mixamo" else None)
    run(source, rig, feet=feet)
    assert direction_error(rig, bone_of, ARMS, JOINTS) < 1.0
    if not feet:  # test_retarget_feet.py has the legs of standing feet
        assert direction_error(rig, bone_of, LEGS, JOINTS) < 1.0


def test_a_scene_that_stretches_time_gives_a_warning(source):
    rig, _ = build_rig("mixamo")
    bpy.context.scene.render.frame_map_old = 50
    (warning,) = run(source, rig).warnings
    assert "at 0.5 times its speed" in str(warning)


def _in_edit_mode(rig):
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")


def _in_a_hidden_collection(rig):
    hidden = bpy.data.collections.new("Hidden")
    bpy.context.scene.collection.children.link(hidden)
    hidden.objects.link(rig)
    bpy.context.scene.collection.objects.unlink(rig)
    hidden.hide_viewport = True


def _disabled_in_viewports_at_rest(rig):
    rig.data.pose_position = "REST"
    rig.hide_viewport = True


@pytest.mark.parametrize(
    "hide", [_in_edit_mode, _disabled_in_viewports_at_rest, _in_a_hidden_collection]
)
def test_a_hidden_or_edited_rig_moves(source, hide):
    rig, bone_of = build_rig("mixamo")
    hide(rig)
    collections = rig.users_collection
    hidden = rig.hide_viewport
    run(source, rig, feet=False)
    assert (rig.users_collection, rig.hide_viewport) == (collections, hidden)
    # it would not be seen to move otherwise
    assert (rig.mode, rig.data.pose_position) == ("OBJECT", "POSE")
    rig.hide_viewport = collections[0].hide_viewport = False
    assert direction_error(rig, bone_of, ARMS + LEGS, JOINTS) < 1.0


def test_a_subdivided_mesh_is_not_evaluated_for_bones(source, tmp_path):
    """A character of half a million vertices would take minutes: its modifiers are left out while
    the rig is measured, moved by its parent and written as a .bvh file.
    """
    rig, bone_of = build_rig("mixamo")
    rig.parent = added_empty("carrier")
    rig.parent.keyframe_insert("location", frame=1)
    mesh = bpy.data.meshes.new("skin")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    skin = bpy.data.objects.new("skin", mesh)
    bpy.context.scene.collection.objects.link(skin)
    skin.modifiers.new("rig", "ARMATURE").object = rig
    subdivision = skin.modifiers.new("smooth", "SUBSURF")
    skin.modifiers.new("waves", "WAVE")  # after the other two, for which Blender evaluates them
    counts = []

    def count(scene, depsgraph):
        counts.append(len(skin.evaluated_get(depsgraph).data.vertices))

    handlers = bpy.app.handlers.frame_change_post, bpy.app.handlers.depsgraph_update_post
    for handler in handlers:
        handler.append(count)
    run(source, rig, feet=False)
    export_rig(tmp_path / "rig.bvh", rig, ExportOptions())
    for handler in handlers:
        handler.remove(count)
    assert counts.count(3) > 2 * len(FRAMES)
    assert sum(each > 3 for each in counts) < 10
    assert subdivision.show_viewport
    assert direction_error(rig, bone_of, ARMS + LEGS, JOINTS) < 1.0


def test_hands_and_feet_without_bones_are_named(source):
    rig, bone_of = build_rig("unreal")
    parts = guess_bone_map(rig).parts
    for part in ("left_foot", "left_ankle", "right_wrist"):
        del parts[bone_of[part]]
    (warning,) = run(source, rig, BoneMap(parts)).warnings
    assert warning.code == "still_parts"
    assert warning.values["parts"] == ["right_wrist", "left_ankle"]


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_stretched_rig_keeps_its_bones_together_and_is_reported(source, axis):
    """A stretched object shears bones that turn. Where the probe looked at them in the world, a
    foot seemed to move with the other leg, which kicked by 41 degrees.
    """
    rig, bone_of = build_rig("unreal")
    rig.scale[axis] = 1.1
    bpy.context.view_layer.update()
    assert [warning.code for warning in run(source, rig).warnings] == ["stretched_rig"]
    assert direction_error(rig, bone_of, ARMS + LEGS, JOINTS) < 10.0
    rig.scale = (1.1, 1.1, 1.1)
    bpy.context.view_layer.update()
    assert run(source, rig).warnings == []


def test_a_blocked_bone_is_named_and_nothing_changes(source):
    rig, bone_of = build_rig("mixamo")
    target = added_empty("target")
    rig.pose.bones[bone_of["left_elbow"]].constraints.new("COPY_ROTATION").target = target
    rig.data.pose_position = "REST"
    with pytest.raises(InputError, match="'mixamorig:LeftForeArm' of 'mixamo' does not move"):
        run(source, rig)
    assert rig.data.pose_position == "REST"
    assert rig.animation_data is None


def test_a_rig_without_size_or_bones_is_refused(source):
    rig, _ = build_rig("mixamo")
    rig.scale = (1, 1, 0)
    with pytest.raises(InputError, match="'mixamo' is scaled to 0"):
        run(source, rig)
    empty = bpy.data.objects.new("Empty", bpy.data.armatures.new("Empty"))
    with pytest.raises(InputError, match="'Empty' has no bones"):
        guess_bone_map(empty)


def test_a_rig_of_controls_alone_stands_on_its_lowest_bone(source):
    rig, bone_of = build_rig("mixamo")
    run(source, rig)
    before = seen(rig, bone_of.values())
    for bone in rig.data.bones:
        bone.use_deform = False
    run(source, rig)
    np.testing.assert_allclose(seen(rig, bone_of.values()), before, atol=1e-5)


@pytest.mark.slow
def test_rigify(rigify_rigs):
    source = captured(motion_of(walk(1.0)))
    frames = range(1, 31, 6)
    limbs = ("thigh", "shin", "foot", "upper_arm", "forearm", "hand")
    parts = ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
    for rig, prefix in rigify_rigs:
        bone_of = {
            f"{side}_{part}": f"{prefix}{limb}.{side[0].upper()}"
            for side in ("left", "right")
            for part, limb in zip(parts, limbs, strict=True)
        }
        assert run(source, rig, feet=False).warnings == []
        assert direction_error(rig, bone_of, ARMS + LEGS, JOINTS, frames) < 1.0
        assert run(source, rig).warnings == []
        assert direction_error(rig, bone_of, ARMS, JOINTS, frames) < 1.0
    metarig = rigify_rigs[0][0]
    before = guess_bone_map(metarig).parts
    for bone in metarig.data.bones:  # the bones that a game gets
        bone.name = f"DEF-{bone.name}"
    assert guess_bone_map(metarig).parts == {f"DEF-{bone}": part for bone, part in before.items()}


def test_what_was_posed_without_a_key_elsewhere_stays_so(source):
    """Where nothing carries the rig, no frame is set, which would undo it."""
    rig, _ = build_rig("unreal")
    other = added_empty("other")
    for frame in (1, 9):
        other.keyframe_insert("location", frame=frame)
    other.location.x = 3.0
    run(source, rig)
    assert other.location.x == 3.0


def test_the_rigs_own_action_stays(source):
    rig, bone_of = build_rig("unreal")
    rig.pose.bones[0].keyframe_insert("location", frame=3)
    before = rig.animation_data.action
    run(source, rig)
    assert rig.animation_data.action != before
    assert before.use_fake_user


def _tweaked(animation):
    animation.nla_tracks[0].strips[0].select = animation.nla_tracks[0].select = True
    animation.use_tweak_mode = True


def _added_faintly(animation):
    animation.action_blend_type = "ADD"
    animation.action_influence = 0.3


def _solo(animation):
    animation.nla_tracks[0].is_solo = True


@pytest.mark.parametrize("prepare", [_tweaked, _added_faintly, _solo])
def test_a_rig_whose_nla_plays_moves_as_captured(source, prepare):
    rig, bone_of = build_rig("unreal")
    knee = rig.pose.bones[bone_of["left_knee"]]
    knee.rotation_mode = "QUATERNION"
    knee.rotation_quaternion = (0.7, 0.7, 0, 0)
    knee.keyframe_insert("rotation_quaternion", frame=1)
    animation = rig.animation_data
    own = animation.action
    track = animation.nla_tracks.new()
    track.strips.new("own", 1, own)
    animation.action = None
    prepare(animation)
    run(source, rig, feet=False)
    assert direction_error(rig, bone_of, ARMS + LEGS, JOINTS) < 1.0
    assert [strip.action for strip in track.strips] == [own]


def _keyed(bone):
    bone.location = (0.1, 0.0, 0.05)
    bone.scale = (1.3, 1.0, 1.2)
    for channel in ("location", "scale"):
        bone.keyframe_insert(channel, frame=1)


def _in_the_nla(bone):
    _keyed(bone)
    animation = bone.id_data.animation_data
    animation.nla_tracks.new().strips.new("own", 1, animation.action)
    animation.action = None


@pytest.mark.parametrize("pose", [_keyed, _in_the_nla])
def test_bones_that_were_moved_and_scaled_before_follow_as_at_rest(source, pose):
    rig, bone_of = build_rig("unreal")
    bones = list(bone_of.values())
    run(source, rig)
    wanted = seen(rig, bones)
    rig.animation_data_clear()
    for part in ("pelvis", "left_hip", "spine2", "right_elbow"):
        pose(rig.pose.bones[bone_of[part]])
    run(source, rig)
    np.testing.assert_allclose(seen(rig, bones), wanted, atol=1e-5)
    assert rig.animation_data.use_nla


@pytest.mark.parametrize("step", ["rig_retarget.probe", "rig_retarget.remove_root_object"])
def test_a_failure_leaves_the_rig_unchanged(source, monkeypatch, step):
    rig, _ = build_rig("unreal")
    bone = rig.pose.bones[3]
    bone["IK_FK"] = 0.25
    rig.pose.bones[0].keyframe_insert("location", frame=3)
    before = rig.animation_data.action
    actions = len(bpy.data.actions)

    def fail(*args, **keywords):
        raise MemoryError

    monkeypatch.setattr(f"scope.scope_addon.scene.{step}", fail)
    with pytest.raises(MemoryError):
        run(source, rig)
    assert bone["IK_FK"] == 0.25
    assert rig.animation_data.action == before
    assert len(bpy.data.actions) == actions
    assert not before.use_fake_user


def test_in_place_stays_on_the_spot(source):
    rig, bone_of = build_rig("unreal")
    run(source, rig, root="in-place")
    assert np.ptp(seen(rig, [bone_of["pelvis"]])[:, 0, :2], axis=0).max() < 1e-3


def test_an_unusable_rig_or_map_is_reported(source):
    rig, _ = build_rig("unreal")
    with pytest.raises(UsageError, match="another armature"):
        run(source, source, guess_bone_map(rig))
    with pytest.raises(InputError, match="pelvis"):
        run(source, rig, BoneMap({"head": "head"}))


def test_a_pelvis_that_cannot_be_moved_is_reported(source):
    rig, bone_of = build_rig("unreal")
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    root = rig.data.edit_bones.new("root")
    pelvis = rig.data.edit_bones[bone_of["pelvis"]]
    root.head = (0, 0, 0)
    root.tail = pelvis.head
    pelvis.parent = root
    pelvis.use_connect = True
    bpy.ops.object.mode_set(mode="OBJECT")
    with pytest.raises(InputError, match="'pelvis' of 'unreal' is connected to 'root'"):
        run(source, rig)
    bpy.ops.object.mode_set(mode="EDIT")
    rig.data.edit_bones["pelvis"].use_connect = False
    bpy.ops.object.mode_set(mode="OBJECT")
    run(source, rig)
    assert np.ptp(seen(rig, ["pelvis"])[:, 0, 1]) > 1.0
    constraint = rig.pose.bones["pelvis"].constraints.new("COPY_LOCATION")
    constraint.target = rig
    constraint.subtarget = "root"
    with pytest.raises(InputError, match="does not move when .*: mute the constraint 'Copy Loc"):
        run(source, rig)


@pytest.mark.parametrize("influence", [0.5, 1.0])
@pytest.mark.parametrize(("owner", "end"), [("left_knee", "ankle"), ("right_elbow", "wrist")])
def test_an_ik_constraint_that_holds_a_limb_and_what_carries_it_is_named(
    source, influence, owner, end
):
    """Its goal is where the limb ends at rest."""
    rig, bone_of = build_rig("unreal")
    target = added_empty("target")
    hand = rig.data.bones[bone_of[f"{owner.partition('_')[0]}_{end}"]]
    target.location = rig.matrix_world @ hand.head_local
    constraint = rig.pose.bones[bone_of[owner]].constraints.new("IK")
    constraint.target = target
    constraint.chain_count = 3
    constraint.influence = influence
    bpy.context.view_layer.update()
    with pytest.raises(InputError, match=f"mute the constraint 'IK' of '{bone_of[owner]}'"):
        run(source, rig)
    constraint.mute = True
    assert run(source, rig).warnings == []


def test_all_constraints_that_hold_legs_are_named_at_once(source):
    """IK of both, and the feet's rotations by its controls; or IK that holds them in part."""
    rig, bone_of = build_rig("unreal")
    ik = []
    for side in ("left", "right"):
        target = added_empty(side)
        foot = rig.data.bones[bone_of[f"{side}_ankle"]]
        target.location = rig.matrix_world @ foot.head_local
        constraint = rig.pose.bones[bone_of[f"{side}_knee"]].constraints.new("IK")
        constraint.name = f"{side} leg"
        constraint.target = target
        constraint.chain_count = 3
        ik.append(constraint)
        constraint = rig.pose.bones[bone_of[f"{side}_ankle"]].constraints.new("COPY_ROTATION")
        constraint.name = f"{side} foot"
        constraint.target = target
    with pytest.raises(InputError, match="mute the constraints") as caught:
        run(source, rig)
    for named in ("left leg", "right leg", "left foot", "right foot"):
        assert f"'{named}' of" in str(caught.value)
    for constraint in ik:
        constraint.influence = 0.5
    for side in ("left", "right"):
        rig.pose.bones[bone_of[f"{side}_ankle"]].constraints[0].mute = True
    with pytest.raises(InputError, match="'left leg' of 'calf_l' and 'right leg' of 'calf_r'"):
        run(source, rig)


def test_of_a_rig_that_follows_another_a_few_of_its_constraints_are_named(source):
    rig, bone_of = build_rig("unreal")
    target = rig.copy()
    bpy.context.scene.collection.objects.link(target)
    for bone in rig.pose.bones:
        constraint = bone.constraints.new("COPY_TRANSFORMS")
        constraint.target, constraint.subtarget = target, bone.name
    bone_map = BoneMap({bone: part for part, bone in bone_of.items()})
    with pytest.raises(InputError, match=f"and {len(bone_of) - 6} more of 'unreal' do not") as said:
        run(source, rig, bone_map=bone_map)
    assert f"and {len(bone_of) - 12} more, or remove these bones" in str(said.value)
    assert len(str(said.value)) < 700


def test_the_bone_that_carries_hips_and_spine_is_proposed_for_the_pelvis(source):
    rig, bone_of = build_rig("unreal")
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bones = rig.data.edit_bones
    carrying = bones.new("COG")
    carrying.head = bones["pelvis"].head
    carrying.tail = carrying.head + Vector((0.0, 0.2, 0.0))
    for part in ("pelvis", "spine1"):
        bones[bone_of[part]].use_connect = False
        bones[bone_of[part]].parent = carrying
    bpy.ops.object.mode_set(mode="OBJECT")
    bone_map = BoneMap({bone: part for part, bone in bone_of.items()})
    with pytest.raises(InputError, match="does not move with 'pelvis'.*, such as 'COG' for the pe"):
        run(source, rig, bone_map=bone_map)


def with_deform_bones(rig):
    """Give each bone a copy that alone moves skin and follows it, in a hierarchy of their own."""
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bones = rig.data.edit_bones
    names = bones.keys()
    for name in names:
        copy = bones.new(f"DEF_{name}")
        (copy.head, copy.tail, copy.roll) = (bones[name].head, bones[name].tail, bones[name].roll)
    for name in names:
        if bones[name].parent is not None:
            bones[f"DEF_{name}"].parent = bones[f"DEF_{bones[name].parent.name}"]
    bpy.ops.object.mode_set(mode="OBJECT")
    for name in names:
        rig.data.bones[name].use_deform = False
        constraint = rig.pose.bones[f"DEF_{name}"].constraints.new("COPY_TRANSFORMS")
        constraint.target = rig
        constraint.subtarget = name
    bpy.ops.mesh.primitive_cube_add()
    skin = bpy.context.object
    skin.modifiers.new("Armature", "ARMATURE").object = rig
    for name in names:
        skin.vertex_groups.new(name=f"DEF_{name}")
    bpy.context.view_layer.update()


@pytest.mark.parametrize("scheme", ["unreal", "nameless"])
def test_bones_that_follow_others_are_not_guessed_and_move_with_them(source, scheme):
    rig, bone_of = build_rig(scheme)
    with_deform_bones(rig)
    assert guess_bone_map(rig).parts == {bone: part for part, bone in bone_of.items()}
    codes = [warning.code for warning in run(source, rig).warnings]
    assert codes == ["guessed_bones"] * (scheme == "nameless")
    copies = {part: f"DEF_{bone}" for part, bone in bone_of.items()}
    assert direction_error(rig, copies, ARMS, JOINTS) < 1.0


def test_bones_that_carry_the_skin_and_do_not_follow_those_in_the_list_are_reported(source):
    """As of a limb that a switch of the rig's own has turned to IK."""
    rig, bone_of = build_rig("unreal")
    with_deform_bones(rig)
    thigh = rig.pose.bones[f"DEF_{bone_of['left_hip']}"]
    thigh.constraints[0].subtarget = bone_of["pelvis"]
    (warning,) = run(source, rig).warnings
    assert warning.code == "blocked_bones"
    assert warning.values["bones"] == [thigh.name]
    skin = bpy.data.objects["Cube"]
    # As goals of IK, it now carries no skin, whatever its settings say.
    skin.vertex_groups.remove(skin.vertex_groups[thigh.name])
    assert run(source, rig).warnings == []


def test_bones_that_follow_with_another_roll_are_not_reported(source):
    """As the copies of Rigify's thumbs do."""
    rig, bone_of = build_rig("unreal")
    with_deform_bones(rig)
    copy = rig.pose.bones[f"DEF_{bone_of['left_elbow']}"]
    roll = copy.constraints.new("TRANSFORM")
    roll.target = rig
    roll.subtarget = bone_of["pelvis"]
    roll.map_to = "ROTATION"
    roll.to_min_y_rot = roll.to_max_y_rot = 0.6
    roll.mix_mode_rot = "ADD"
    roll.target_space = roll.owner_space = "LOCAL"
    bpy.context.view_layer.update()
    elbow = rig.pose.bones[bone_of["left_elbow"]].matrix.to_quaternion()
    turn = elbow.rotation_difference(copy.matrix.to_quaternion())
    assert turn.angle > 0.5
    assert run(source, rig).warnings == []


def test_an_edited_action_is_said_to_be_kept(source):
    rig, bone_of = build_rig("unreal")
    run(source, rig)
    assert run(source, rig).warnings == []  # which removed the first one
    before = rig.animation_data.action
    rig.pose.bones[bone_of["head"]].keyframe_insert("scale", frame=3)
    (warning,) = run(source, rig).warnings
    assert (warning.code, warning.values["action"]) == ("kept_action", before.name)
    assert before.use_fake_user
    assert rig.animation_data.action != before


def test_a_linked_rest_position_which_would_come_back_is_refused(source, tmp_path):
    rig, _ = build_rig("unreal")
    rig.data.pose_position = "REST"
    path = str(tmp_path / "library.blend")
    bpy.data.libraries.write(path, {rig})
    with bpy.data.libraries.load(path, link=True) as (_, chosen):
        chosen.objects = [rig.name]
    (linked,) = chosen.objects
    bpy.context.scene.collection.objects.link(linked)
    override = linked.override_create()
    bpy.context.scene.collection.objects.link(override)
    with pytest.raises(UsageError, match="set it to Pose Position there"):
        run(source, override, guess_bone_map(rig))
    assert override.data.pose_position == "REST"
    assert action_of(override) is None


def test_bones_blocked_by_a_constraint_are_reported(source):
    rig, bone_of = build_rig("unreal")
    assert run(source, rig).warnings == []
    target = added_empty("target")
    target.location = (0.2, -0.4, 0.5)  # far before where the foot ever is in this walk
    constraint = rig.pose.bones[bone_of["left_knee"]].constraints.new("IK")
    constraint.target = target
    constraint.chain_count = 2
    (warning,) = map(str, run(source, rig).warnings)
    assert "'thigh_l'" in warning
    assert "cannot follow the motion" in warning
    assert "mute the constraints" in warning
    constraint.mute = True
    assert run(source, rig).warnings == []
    assert direction_error(rig, bone_of, ARMS, JOINTS) < 1.0


@pytest.mark.parametrize("channel", ["rotation_euler", "rotation_quaternion"])
def test_a_bone_that_a_driver_turns_is_reported(source, channel):
    """A little in the shown frame, and farther later; a driver of a channel that is not in use
    does nothing.
    """
    rig, bone_of = build_rig("unreal")
    hand = rig.pose.bones[bone_of["left_wrist"]]
    hand.rotation_mode = "XYZ"
    driver = hand.driver_add(channel, 2)
    driver.driver.expression = "frame * 0.01"
    blocked = [w.values["bones"] for w in run(source, rig).warnings]
    assert blocked == ([[hand.name]] if channel == "rotation_euler" else [])
    driver.mute = True
    assert run(source, rig).warnings == []


def _turned(bone):
    bone.rotation_mode = "XYZ"
    bone.rotation_euler.y = 0.5


def _scaled(bone):
    bone.scale = (0.5, 0.5, 0.5)


def _at_rest_in_the_nla(bone):
    """As all controls are if those that move are keyed with the whole character."""
    bone.constraints.new("LIMIT_DISTANCE").keyframe_insert("influence", frame=1)
    for channel in ("location", "rotation_quaternion", "scale"):
        bone.keyframe_insert(channel, frame=1)
    animation = bone.id_data.animation_data
    animation.nla_tracks.new().strips.new("own", 1, animation.action)
    animation.action = None


@pytest.mark.parametrize("pose", [_turned, _scaled, _in_the_nla, _at_rest_in_the_nla, None])
def test_a_bone_that_carries_the_rig_and_is_posed_is_reported(source, pose):
    """As the control of a whole rig is, which is not in the list and keeps its pose."""
    rig, bone_of = build_rig("unreal")
    bpy.ops.object.mode_set(mode="EDIT")
    master = rig.data.edit_bones.new("Master")
    master.tail = (0.0, 0.0, 0.2)
    rig.data.edit_bones[bone_of["pelvis"]].parent = master
    ponytail = rig.data.edit_bones.new("Ponytail")
    ponytail.tail = (0.0, 0.2, 0.0)
    ponytail.parent = rig.data.edit_bones[bone_of["head"]]
    bpy.ops.object.mode_set(mode="OBJECT")
    _scaled(rig.pose.bones["Ponytail"])  # which carries nothing
    if pose is not None:
        pose(rig.pose.bones["Master"])
        if pose is _in_the_nla:
            rig.pose.bones["Master"].matrix_basis = Matrix()
    warnings = run(source, rig).warnings
    is_moved = pose not in (_at_rest_in_the_nla, None)
    assert [w.values["bones"] for w in warnings] == [["Master"]] * is_moved
    if is_moved:  # which clearing the pose does not settle
        assert warnings[0].code == ("nla_bones" if pose is _in_the_nla else "posed_bones")
    if not is_moved:
        assert direction_error(rig, bone_of, ARMS, JOINTS) < 1.0
    elif pose is _turned:  # so that it is said for a reason
        assert direction_error(rig, bone_of, ARMS, JOINTS) > 10.0


@pytest.mark.parametrize("part", ["left_knee", "pelvis"])
def test_a_bone_that_a_limit_stops_for_a_moment_is_reported(part):
    """In frame 20 alone, one between those at even distances, the knee is bent by 86 degrees and
    the pelvis a metre away.
    """
    clip = walk(2.0)
    knee = NAMES.index("left_knee")
    clip.rotations[:, knee] = np.eye(3)
    clip.rotations[20, knee] = exp(np.array([1.5, 0.0, 0.0]))
    clip.root[:] = clip.root[0]
    clip.root[20, 0] += 1.0
    rig, bone_of = build_rig("mixamo")
    constraints = rig.pose.bones[bone_of[part]].constraints
    if part == "pelvis":
        limit = constraints.new("LIMIT_LOCATION")
        limit.use_max_x = True
        limit.max_x = 0.3
    else:
        limit = constraints.new("LIMIT_ROTATION")
        limit.owner_space = "LOCAL"
        limit.use_limit_x = limit.use_limit_z = True
        limit.min_x = limit.min_z = -0.6
        limit.max_x = limit.max_z = 0.6
    (warning,) = run(captured(motion_of(clip)), rig, feet=False).warnings
    assert bone_of[part] in warning.values["bones"]
