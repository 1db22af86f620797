# SPDX-License-Identifier: GPL-3.0-or-later
"""Root motion of rig and capture: in the bones, on a root object, or in place."""

import math

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from scope.scope_addon.edit.clip import with_trajectory
from scope.scope_addon.errors import UsageError
from scope.scope_addon.scene.character.root_object import (
    move_root_motion_to_bones,
    move_root_motion_to_object,
    root_object,
)
from scope.scope_addon.scene.rig_retarget import RetargetOptions

from ..edit.walking import BODY, RATE, motion_of, walk
from .made_rigs import FBX, FRAMES, added_empty, build_rig, captured, run, seen

TURNED = Matrix.LocRotScale(
    (2.0, 1.0, 0.0), Matrix.Rotation(math.pi, 3, "Z").to_quaternion(), (1.0,) * 3
)


@pytest.fixture
def source():
    """A walk along a curve that does not begin at the origin."""
    clip = walk(2.0)
    bent = with_trajectory(clip, np.tile([0.7, -0.4, 0.0], (len(clip), 1)), 0.3 + 0.8 * clip.times)
    return captured(motion_of(bent))


def between_hips(armature, bone_of=None):
    """Return the middle (T, 3) of both hips, where rig and capture agree: pelvises lie anywhere."""
    hips = [(bone_of or {}).get(hip, hip) for hip in ("left_hip", "right_hip")]
    return seen(armature, hips).mean(axis=1)


def rigs_matrices(rig, frames=(1, 20, 50)):
    out = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        out.append(rig.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world.copy())
    return np.array(out)


@pytest.mark.parametrize("has_parent", [False, True])
def test_a_pelvis_without_local_location_is_where_one_with_it_is(source, has_parent):
    """Its location is along the axes of its parent, of which rigs have one on the ground that
    points forwards; without a parent, along the armature's.
    """
    rig, bone_of = build_rig("mixamo")
    if has_parent:
        bpy.ops.object.mode_set(mode="EDIT")
        ground = rig.data.edit_bones.new("ground")
        ground.tail = (0.1, -0.3, 0.05)
        ground.roll = 0.7
        rig.data.edit_bones[bone_of["pelvis"]].parent = ground
        bpy.ops.object.mode_set(mode="OBJECT")
    run(source, rig)
    expected = seen(rig, bone_of.values())
    rig.data.bones[bone_of["pelvis"]].use_local_location = False
    assert run(source, rig).warnings == []
    np.testing.assert_allclose(seen(rig, bone_of.values()), expected, atol=1e-4)


@pytest.mark.parametrize("frame", [1, 25])
@pytest.mark.parametrize("root", ["bone", "object"])
def test_a_rig_on_a_boat_moves_alike_at_whichever_frame_it_is_retargeted(source, frame, root):
    """The boat has a list of 20 degrees at first, and none at frame 25."""
    rig, bone_of = build_rig("mixamo")
    run(source, rig, root=root)
    expected = seen(rig, bone_of.values())
    bpy.data.objects.remove(rig)
    bpy.ops.outliner.orphans_purge()
    rig, bone_of = build_rig("mixamo")
    boat = added_empty("boat")
    for at, tilt in ((1, 0.35), (25, 0.0), (50, -0.2)):
        boat.rotation_euler.x = tilt
        boat.keyframe_insert("rotation_euler", frame=at)
    rig.parent = boat
    bpy.context.scene.frame_set(frame)
    run(source, rig, root=root)
    assert bpy.context.scene.frame_current == frame
    np.testing.assert_allclose(seen(rig, bone_of.values()), expected, atol=1e-3)


@pytest.mark.parametrize("matrix", [FBX, TURNED])
def test_on_an_object_the_rig_looks_the_same(source, matrix):
    rig, bone_of = build_rig("mixamo", matrix=matrix)
    own = np.array(rig.matrix_world)
    bones = list(bone_of.values())
    run(source, rig)
    before = seen(rig, bones)
    assert root_object(rig) is None
    for _ in range(2):  # and again, from a rig with a root object
        run(source, rig, root="object")
        np.testing.assert_allclose(seen(rig, bones), before, atol=1e-3)
        roots = [obj for obj in bpy.data.objects if "scope_root" in obj]
        assert roots == [root_object(rig)]
        # The rig's origin is below the pelvis, and the rig faces in its own object where it faces
        # at rest.
        places = rigs_matrices(rig)
        pelvis = seen(rig, [bone_of["pelvis"]], (1, 20, 50))[:, 0]
        np.testing.assert_allclose(places[:, :2, 3], pelvis[:, :2], atol=1e-3)
        hips = seen(rig, [bone_of["left_hip"], bone_of["right_hip"]], (1, 20, 50))
        left = np.einsum("tji,tj->ti", places[:, :3, :3], hips[:, 0] - hips[:, 1])
        rest = (
            rig.data.bones[bone_of["left_hip"]].head_local
            - rig.data.bones[bone_of["right_hip"]].head_local
        )
        cosine = left @ np.array(rest) / np.linalg.norm(left, axis=1) / rest.length
        assert cosine.min() > math.cos(math.radians(8))  # the heading is the hips' smoothed one
    run(source, rig)
    np.testing.assert_allclose(seen(rig, bones), before, atol=1e-3)
    bpy.context.view_layer.update()
    np.testing.assert_allclose(np.array(rig.matrix_world), own, atol=1e-6)
    assert not [obj for obj in bpy.data.objects if "scope_root" in obj]


def test_a_capture_with_root_motion_on_an_object_or_in_place(source):
    rig, bone_of = build_rig("unreal")
    bones = list(bone_of.values())
    run(source, rig)
    before = seen(rig, bones)
    move_root_motion_to_object(source, BODY, RATE, in_place=False, heading=True)
    for root in ("bone", "object"):
        run(source, rig, root=root)
        np.testing.assert_allclose(seen(rig, bones), before, atol=2e-3)
    move_root_motion_to_object(source, BODY, RATE, in_place=True, heading=False)
    travel = run(source, rig).travel
    np.testing.assert_allclose(seen(rig, bones)[0], before[0], atol=2e-3)
    # The pelvis stays, and the hips turn about it.
    assert np.ptp(seen(source, ["pelvis"])[:, 0, :2], axis=0).max() < 1e-3
    hips = between_hips(rig, bone_of)
    wanted = between_hips(source)
    np.testing.assert_allclose(hips[:, :2], travel * wanted[:, :2], atol=2e-3)
    move_root_motion_to_bones(source, BODY, RATE)
    run(source, rig)
    np.testing.assert_allclose(seen(rig, bones), before, atol=2e-3)


def test_the_rig_follows_where_the_user_puts_the_captured_armature(source):
    rig, bone_of = build_rig("unreal")
    bones = list(bone_of.values())
    run(source, rig, root="object")
    before = seen(rig, bones)
    place = Matrix.LocRotScale(
        (3.0, -1.0, 0.5), Matrix.Rotation(1.1, 3, "Z").to_quaternion(), (1.0,) * 3
    )
    source.matrix_world = place
    run(source, rig, root="object", offset=(0.0, 0.0, 0.25))
    wanted = before @ np.array(place)[:3, :3].T + np.array(place.translation) + [0, 0, 0.25]
    np.testing.assert_allclose(seen(rig, bones), wanted, atol=2e-3)


def drive_around(obj):
    """Key an object's place and heading."""
    for frame, angle in ((1, 0.5), (60, 4.0)):
        obj.location.y = 5.0 * angle
        obj.rotation_euler.z = angle
        obj.keyframe_insert("location", frame=frame)
        obj.keyframe_insert("rotation_euler", frame=frame)


@pytest.mark.parametrize(
    ("root", "carried"),
    [("bone", "itself"), ("object", "by a parent"), ("bone", "root object by a parent")],
)
def test_the_rig_follows_a_capture_that_is_carried(source, root, carried):
    rig, bone_of = build_rig("unreal")
    bones = list(bone_of.values())
    run(source, rig, root=root)
    before = seen(rig, bones)
    car = source
    if carried != "itself":
        car = added_empty("car")
        source.parent = car
    drive_around(car)
    places = rigs_matrices(car, FRAMES)
    if carried.startswith("root"):
        move_root_motion_to_object(source, BODY, RATE, in_place=False, heading=True)
    bpy.context.scene.frame_set(30)
    run(source, rig, root=root)
    assert bpy.context.scene.frame_current == 30
    wanted = before @ np.swapaxes(places[:, :3, :3], 1, 2) + places[:, None, :3, 3]
    np.testing.assert_allclose(seen(rig, bones), wanted, atol=5e-3)


@pytest.mark.parametrize("root", ["bone", "object"])
def test_a_rig_whose_parent_moves_is_where_the_capture_is(source, root):
    rig, bone_of = build_rig("unreal")
    bones = list(bone_of.values())
    run(source, rig, root=root)
    wanted = seen(rig, bones)
    car = added_empty("car")
    if root == "object":
        bpy.data.objects.remove(root_object(rig))
    rig.parent = car
    drive_around(car)
    bpy.context.scene.frame_set(30)
    assert run(source, rig, root=root).warnings == []
    np.testing.assert_allclose(seen(rig, bones), wanted, atol=5e-3)


@pytest.mark.parametrize("root", ["bone", "object"])
def test_a_rig_whose_root_object_is_on_what_moves_is_where_the_capture_is(source, root):
    rig, bone_of = build_rig("unreal")
    bones = list(bone_of.values())
    run(source, rig, root="object")
    wanted = seen(rig, bones)
    ferry = added_empty("ferry")
    root_object(rig).parent = ferry
    drive_around(ferry)
    bpy.context.scene.frame_set(30)
    assert run(source, rig, root=root).warnings == []
    np.testing.assert_allclose(seen(rig, bones), wanted, atol=5e-3)


def test_a_rig_that_its_parent_scales_from_nothing_is_where_the_capture_is(source):
    """In frame 1 there is nothing that could be."""
    rig, bone_of = build_rig("unreal")
    run(source, rig)
    pelvis = [bone_of["pelvis"]]
    wanted = seen(rig, pelvis)
    bubble = added_empty("bubble")
    rig.parent = bubble
    for frame, size in ((1, 0.0), (40, 1.0)):
        bubble.scale = (size,) * 3
        bubble.keyframe_insert("scale", frame=frame)
    bpy.context.scene.frame_set(45)
    assert run(source, rig).warnings == []
    np.testing.assert_allclose(seen(rig, pelvis)[1:], wanted[1:], atol=5e-3)


def test_retargeting_again_replaces_its_own_action_unless_it_was_edited(source):
    rig, _ = build_rig("unreal")
    name = run(source, rig).action.name
    actions = len(bpy.data.actions)
    for root in ("object", "object", "in-place", "bone"):
        assert run(source, rig, root=root).action.name == name
    assert len(bpy.data.actions) == actions
    rig.pose.bones[3].keyframe_insert("location", frame=7)
    changed = rig.animation_data.action
    run(source, rig)
    assert changed.use_fake_user
    assert len(bpy.data.actions) == actions + 1


@pytest.mark.parametrize("scale", [(1.1, 0.9, 1.2), (-1.0, 1.0, 1.0)])
def test_the_path_of_a_rig_with_three_factors_of_scale_is_the_captured_one(source, scale):
    rig, bone_of = build_rig("unreal")
    rig.scale = scale
    rig.rotation_euler = (0.0, 0.0, 0.5)
    travel = run(source, rig).travel
    path = between_hips(rig, bone_of)
    wanted = between_hips(source)
    np.testing.assert_allclose(
        (path - path[0])[:, :2], travel * (wanted - wanted[0])[:, :2], atol=2e-3
    )


def test_a_mirrored_rig_moves_as_the_one_that_it_mirrors(source):
    rig, bone_of = build_rig("unreal")
    run(source, rig)
    wanted = seen(rig, bone_of.values())
    rig.scale = (-1.0, 1.0, 1.0)
    bpy.context.view_layer.update()
    run(source, rig)
    swap = {"left": "right", "right": "left"}
    mirrored = [
        bone_of["_".join(swap.get(word, word) for word in part.split("_"))] for part in bone_of
    ]
    np.testing.assert_allclose(seen(rig, mirrored), wanted, atol=1e-3)


def test_several_captures_on_one_rig_keep_an_action_each(source):
    rig, bone_of = build_rig("unreal")
    bones = list(bone_of.values())
    first = run(source, rig).action
    wanted = seen(rig, bones)
    second = run(captured(motion_of(walk(1.0, speed=0.5))), rig).action
    assert {first, second} <= set(bpy.data.actions)
    assert first.use_fake_user  # or saving and opening the file would remove it
    bpy.context.view_layer.update()
    rig.animation_data.action = first
    if hasattr(rig.animation_data, "action_slot"):
        rig.animation_data.action_slot = first.slots[0]
    np.testing.assert_allclose(seen(rig, bones), wanted, atol=1e-6)


def test_the_parent_of_a_rig_moves_along(source):
    rig, bone_of = build_rig("unreal")
    bones = list(bone_of.values())
    holder = added_empty("Holder")
    holder.location = (1.0, 0.0, 0.0)
    rig.parent = holder
    run(source, rig)
    before = seen(rig, bones)
    run(source, rig, root="object")
    np.testing.assert_allclose(seen(rig, bones), before, atol=1e-3)
    assert rig.parent == holder
    assert holder.parent == root_object(rig)
    run(source, rig)
    assert holder.parent is None
    other, _ = build_rig("mixamo")
    other.parent = holder
    action = rig.animation_data.action
    with pytest.raises(UsageError, match="'mixamo' would move along"):
        run(source, rig, root="object")
    assert rig.animation_data.action == action
    np.testing.assert_allclose(seen(rig, bones), before, atol=1e-3)


@pytest.mark.parametrize("hung", ["capture", "rig"])
def test_a_root_object_keeps_the_parent_that_the_user_gives_it(source, hung):
    rig, bone_of = build_rig("unreal")
    bones = list(bone_of.values())
    run(source, rig, root="object")
    before = seen(rig, bones)
    move_root_motion_to_object(source, BODY, RATE, in_place=False, heading=True)
    stage = added_empty("Stage")
    turn = Matrix.Rotation(1.1, 3, "Z").to_quaternion()
    place = stage.matrix_world = Matrix.LocRotScale((3.0, -1.0, 0.5), turn, None)
    root_object(source if hung == "capture" else rig).parent = stage
    bpy.context.view_layer.update()
    wanted = before
    if hung == "capture":
        wanted = before @ np.array(place)[:3, :3].T + np.array(place.translation)
    for root in ("object", "bone"):
        run(source, rig, root=root)
        np.testing.assert_allclose(seen(rig, bones), wanted, atol=2e-3)
        if hung == "rig":
            assert (root_object(rig) or rig).parent == stage


def test_an_unknown_choice_is_refused():
    with pytest.raises(UsageError, match="bone, object, in-place"):
        RetargetOptions(root="pelvis")
