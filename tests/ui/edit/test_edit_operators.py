# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators that edit a captured motion, checked in Blender's evaluated scene."""

import re

import bpy
import numpy as np
import pytest
from scope.scope_addon.scene.actions import fcurves, read_keys
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.scene.character.keys import read_clip, write_clip
from scope.scope_addon.scene.character.root_object import root_object
from scope.scope_addon.scene.packed_motion import pack_motion
from scope.scope_addon.ui.captured_person import body_of
from scope.solver.body_file import BUILT_IN, load_body
from scope.solver.rotations import exp, log

from ...edit.walking import BODY, NAMES, RATE, motion_of, walk
from ...scene import made_rigs
from ...scene.made_rigs import captured, captured_with

SECONDS = 3.0


@pytest.fixture
def rig():
    """A captured walk whose armature is active, with its motion."""
    return captured_with(motion_of(walk(SECONDS), noise=0.05))


def seen(rig, frames=range(1, 80, 7)):
    """(T, K+1, 3) heads of all bones in the world."""
    return made_rigs.seen(rig, NAMES, frames)


def keys(rig):
    return read_clip(rig, BODY, RATE)


def turned(a, b):
    return np.degrees(np.linalg.norm(log(np.swapaxes(a, -1, -2) @ b), axis=-1).max())


def test_a_scene_of_the_users_own_body_knows_its_file(tmp_path, monkeypatch):
    """The command line, which has no cache, makes such a scene."""
    monkeypatch.chdir(tmp_path)
    with np.load(BUILT_IN["scope"]) as arrays:
        np.savez("hero.npz", **dict(arrays, name="hero"))
    body = load_body("hero.npz")
    captured(motion_of(walk(SECONDS)), body)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "walk.blend"))
    monkeypatch.chdir(tmp_path.parent)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "walk.blend"))
    armature = next(obj for obj in bpy.data.objects if "scope_source" in obj)
    bpy.context.view_layer.objects.active = armature
    assert bpy.ops.scope.refloor() == {"FINISHED"}
    assert body_of(armature).name == "hero"


def test_smoothing_from_raw_and_back(rig):
    before = seen(rig)
    action = rig.animation_data.action
    bpy.ops.scope.smooth(strength=0.0)
    raw = seen(rig)
    assert np.abs(raw - before).max() > 0.02
    bpy.ops.scope.smooth(strength=3.0)
    calm = seen(rig)
    shaking = [np.linalg.norm(np.diff(joints, 2, axis=0), axis=-1).mean() for joints in (calm, raw)]
    assert shaking[0] < shaking[1]
    bpy.ops.scope.smooth(strength=1.0)  # as after the capture
    np.testing.assert_allclose(seen(rig), before, atol=2e-4)
    assert rig.animation_data.action == action


def test_smoothing_a_resampled_motion_keeps_its_keys_on_whole_frames():
    scene = bpy.context.scene
    scene.render.fps = 24
    scene.render.fps_base = 1.0
    motion = motion_of(walk(SECONDS), noise=0.05)
    rig = (
        build_scene([motion], BODY, None, BuildOptions(frame_rate="resample", start_frame=1.0))
        .people[0]
        .armature
    )
    pack_motion(rig, motion.to_bytes())
    before = read_clip(rig, BODY, 24.0)[1]
    np.testing.assert_array_equal(before, np.arange(1, len(before) + 1))
    bpy.ops.scope.smooth(strength=2.0)
    np.testing.assert_array_equal(read_clip(rig, BODY, 24.0)[1], before)


def test_interpolating_a_span(rig):
    before = keys(rig)[0]
    bpy.ops.scope.interpolate_span(start=40, end=44)
    assert 0.1 < turned(keys(rig)[0].rotations, before.rotations) < 8
    with pytest.raises(RuntimeError, match="reaches the motion's end"):
        bpy.ops.scope.interpolate_span(start=1, end=44)


def test_the_floor_is_the_same_without_root_motion(rig):
    clip, frames = keys(rig)
    tilt = exp([0.1, 0.0, 0.0])
    clip.root = clip.root @ tilt.T
    clip.rotations[:, 0] = tilt @ clip.rotations[:, 0]
    write_clip(rig, BODY, clip, frames)
    bpy.ops.scope.root_motion(mode="IN_PLACE")
    bpy.ops.scope.refloor()
    bpy.ops.scope.root_motion(mode="BONES")
    there = keys(rig)[0]
    write_clip(rig, BODY, clip, frames)
    bpy.ops.scope.refloor()
    wanted = keys(rig)[0]
    np.testing.assert_allclose(there.root, wanted.root, atol=1e-3)
    assert turned(there.rotations, wanted.rotations) < 0.1


@pytest.mark.parametrize("heading", [True, False])
def test_root_motion_looks_the_same_and_comes_back(rig, heading):
    before = seen(rig)
    clip = keys(rig)[0]
    bpy.ops.scope.root_motion(mode="OBJECT", heading=heading)
    empty = root_object(rig)
    np.testing.assert_allclose(seen(rig), before, atol=2e-4)
    assert np.abs(keys(rig)[0].root[:, :2]).max() < 1e-5
    bpy.context.scene.frame_set(60)
    assert empty.matrix_world.translation.y == pytest.approx(-1.2 * 59 / RATE, abs=1e-3)
    bpy.ops.scope.root_motion(mode="IN_PLACE", heading=heading)
    there = seen(rig)
    assert np.ptp(there[:, 0, :2], axis=0).max() < 1e-3
    np.testing.assert_allclose(there[0], before[0], atol=2e-4)
    bpy.ops.scope.root_motion(mode="BONES")
    assert root_object(rig) is None
    np.testing.assert_allclose(seen(rig), before, atol=2e-4)
    assert turned(keys(rig)[0].rotations, clip.rotations) < 0.05
    assert not [o for o in bpy.data.objects if "scope_root" in o]


@pytest.mark.parametrize("mode", ["BONES", "smooth"])
def test_an_empty_that_was_moved_in_place_takes_the_whole_motion_along(rig, mode):
    rig.location.y = 0.4
    before = seen(rig)
    clip = keys(rig)[0]
    bpy.ops.scope.root_motion(mode="IN_PLACE")
    empty = root_object(rig)
    start = np.array(empty.location)
    empty.location.x += 3.0
    empty.rotation_euler.z += 0.7
    if mode == "smooth":
        bpy.ops.scope.smooth()
    else:
        bpy.ops.scope.root_motion(mode=mode)
    turn = exp([0.0, 0.0, 0.7])
    wanted = (before - start) @ turn.T + start + [3.0, 0.0, 0.0]
    np.testing.assert_allclose(seen(rig), wanted, atol=1e-2 if mode == "smooth" else 5e-4)
    if mode == "BONES":
        np.testing.assert_allclose(keys(rig)[0].root, clip.root, atol=1e-4)


def test_root_motion_of_an_armature_parented_to_a_bone(rig):
    crane = bpy.data.objects.new("Crane", bpy.data.armatures.new("Crane"))
    bpy.context.scene.collection.objects.link(crane)
    bpy.context.view_layer.objects.active = crane
    bpy.ops.object.mode_set(mode="EDIT")
    crane.data.edit_bones.new("hook").tail = (0.3, 0.0, 0.9)
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.context.view_layer.objects.active = rig
    rig.parent = crane
    rig.parent_type = "BONE"
    rig.parent_bone = "hook"
    before = seen(rig)
    for mode in ("OBJECT", "BONES"):
        bpy.ops.scope.root_motion(mode=mode)
        np.testing.assert_allclose(seen(rig), before, atol=3e-4)
    assert (rig.parent, rig.parent_type, rig.parent_bone) == (crane, "BONE", "hook")


def key_location(rig):
    rig.location.x = 5.0
    rig.keyframe_insert("location", frame=1)


def constrain(rig):
    rig.constraints.new("COPY_LOCATION")


@pytest.mark.parametrize(
    ("move", "by"),
    [(key_location, "location"), (constrain, "Copy Location")],
)
def test_root_motion_is_not_added_to_what_moves_the_armature_itself(rig, move, by):
    move(rig)
    before = seen(rig)
    for mode in ("OBJECT", "IN_PLACE"):
        with pytest.raises(
            RuntimeError,
            match=f"'walk' is itself keyed, driven or constrained by '{by}': remove that first",
        ):
            bpy.ops.scope.root_motion(mode=mode)
    np.testing.assert_array_equal(seen(rig), before)
    assert root_object(rig) is None


def linked_duplicate(rig):
    """Duplicate an armature with Alt+D."""
    bpy.ops.object.select_all(action="DESELECT")
    rig.select_set(True)
    bpy.ops.object.duplicate(linked=True)
    copy = bpy.context.object
    bpy.context.view_layer.objects.active = rig
    return copy


def test_a_linked_duplicate_keeps_its_root_motion(rig):
    copy = linked_duplicate(rig)
    before = seen(copy)
    with pytest.raises(RuntimeError, match="'walk' and 'walk.001' have the same action"):
        bpy.ops.scope.root_motion(mode="OBJECT")
    bpy.ops.object.make_single_user(
        type="SELECTED_OBJECTS", object=False, obdata=False, material=False, animation=True
    )
    bpy.ops.scope.root_motion(mode="OBJECT")
    assert root_object(rig) is not None
    np.testing.assert_allclose(seen(copy), before, atol=1e-6)


def test_a_linked_duplicate_on_the_same_root_object_does_not_move_twice(rig):
    bpy.ops.scope.root_motion(mode="OBJECT")
    copy = linked_duplicate(rig)
    before = seen(copy)
    for change in (
        lambda: bpy.ops.scope.root_motion(mode="BONES"),
        lambda: bpy.ops.scope.smooth(),
        lambda: bpy.ops.scope.loop(start=5, end=85),
    ):
        with pytest.raises(RuntimeError, match="have the same action"):
            change()
    np.testing.assert_array_equal(seen(copy), before)


def test_a_failed_edit_restores_keys_and_root(rig, monkeypatch):
    bpy.ops.scope.root_motion(mode="OBJECT")
    before = seen(rig)
    empty = root_object(rig)
    action = rig.animation_data.action.name
    blocks = (len(bpy.data.objects), len(bpy.data.actions))

    def fail(*args, **keywords):
        raise OSError("no room")

    monkeypatch.setattr("scope.scope_addon.scene.character.root_object.Channels", fail)
    with pytest.raises(RuntimeError, match="No room"):
        bpy.ops.scope.root_motion(mode="OBJECT", heading=False)  # fails after the bones are written
    assert root_object(rig) == empty
    assert (len(bpy.data.objects), len(bpy.data.actions)) == blocks
    np.testing.assert_array_equal(seen(rig), before)
    with pytest.raises(RuntimeError, match="no keys in the chosen frames"):
        bpy.ops.scope.loop(start=500, end=600)
    assert root_object(rig) == empty
    np.testing.assert_array_equal(seen(rig), before)
    assert rig.animation_data.action.name == action


def test_a_loop_in_place_stays_there(rig):
    bpy.ops.scope.loop(start=5, end=85, shortest=0.8)
    bpy.ops.scope.root_motion(mode="IN_PLACE")
    scene = bpy.context.scene
    length = scene.frame_end + 1 - scene.frame_start
    once, later = (seen(rig, [scene.frame_start + start]) for start in (0, 3 * length))
    np.testing.assert_allclose(later, once, atol=0.01)


def test_a_loop_of_keys_between_frames_lasts_as_long_as_its_cycle(rig):
    for curve in fcurves(rig):
        for key in curve.keyframe_points:
            key.co.x += 0.2
            key.handle_left.x += 0.2
            key.handle_right.x += 0.2
    bpy.ops.scope.loop(start=5, end=85, shortest=0.8)
    times = sorted({key.co.x for curve in fcurves(rig) for key in curve.keyframe_points})
    scene = bpy.context.scene
    assert scene.frame_end + 1 - scene.frame_start == round(times[-1] - times[0])


@pytest.mark.parametrize("root", ["bone", "object"])
def test_each_cycle_of_a_loop_continues_on_a_rig_and_on_a_root_object(rig, root):
    bpy.ops.scope.loop(start=5, end=85, shortest=0.8)
    hero, bone_of = made_rigs.build_rig("mixamo")
    settings = bpy.context.scene.scope_retarget
    settings.rig = hero
    settings.root = root
    bpy.context.view_layer.objects.active = rig
    bpy.ops.scope.retarget()
    bpy.context.view_layer.objects.active = rig
    if root == "object":
        bpy.ops.scope.root_motion(mode="OBJECT")
    scene = bpy.context.scene
    first = scene.frame_start
    length = scene.frame_end + 1 - first
    for armature, names in ((rig, NAMES), (hero, list(bone_of.values()))):
        once, later = (
            made_rigs.seen(armature, names, [first + start, first + start + 10])
            for start in (0, 3 * length)
        )
        gone = later - once
        ends = made_rigs.seen(armature, names, [first, first + length])
        expected = 3 * (ends[1, 0] - ends[0, 0])
        assert abs(expected[1]) > 2.0
        np.testing.assert_allclose(gone, np.broadcast_to(expected, gone.shape), atol=0.01)


def test_all_people_are_smoothed_at_once_on_request():
    motions = [motion_of(walk(1.0), noise=0.05, seed=seed) for seed in (0, 1)]
    built = build_scene(motions, BODY, None, BuildOptions())
    people = [person.armature for person in built.people]
    for person, motion in zip(people, motions, strict=True):
        pack_motion(person, motion.to_bytes())
    bpy.context.view_layer.objects.active = people[1]
    bpy.ops.scope.smooth(strength=0.0)
    assert [person.get("scope_smoothing") for person in people] == [None, 0.0]
    bpy.ops.scope.smooth(strength=0.0, everyone=True)
    assert [person["scope_smoothing"] for person in people] == [0.0, 0.0]
    for person, motion in zip(people, motions, strict=True):
        raw = exp(motion.poses_raw.reshape(len(motion), -1, 3).astype(float))
        assert turned(keys(person)[0].rotations, raw) < 0.01


def test_smoothing_everyone_changes_nobody_if_somebody_cannot_be_smoothed():
    built = build_scene([motion_of(walk(1.0), noise=0.05)] * 2, BODY, None, BuildOptions())
    first, second = (person.armature for person in built.people)
    for person in (first, second):
        pack_motion(person, built.people[0].motion.to_bytes())
    layer = bpy.context.view_layer
    layer.objects.active = second
    bpy.ops.scope.push_to_nla()
    layer.objects.active = first
    bpy.ops.scope.root_motion(mode="OBJECT")
    empty = root_object(first)
    before = seen(first)
    with pytest.raises(RuntimeError, match="NLA"):
        bpy.ops.scope.smooth(strength=3.0, everyone=True)
    assert root_object(first) == empty
    assert "scope_smoothing" not in first
    np.testing.assert_array_equal(seen(first), before)


def test_smoothing_a_loop_restores_the_motion_and_the_frame_range(rig):
    scene = bpy.context.scene
    scene.frame_start = 2
    scene.frame_end = 120
    last = 1 + round(SECONDS * RATE)
    bpy.ops.scope.smooth()
    before = seen(rig, [1, last, last + 20])
    keys_before = {curve.data_path: len(curve.keyframe_points) for curve in fcurves(rig)}
    bpy.ops.scope.loop(start=5, end=85, shortest=0.8)
    cycle = scene.frame_start, scene.frame_end
    # again, within the first one
    bpy.ops.scope.loop(start=cycle[0], end=cycle[1] + 1, shortest=0.5)
    bpy.ops.scope.smooth()
    assert (scene.frame_start, scene.frame_end) == (2, 120)
    keys_after = {curve.data_path: len(curve.keyframe_points) for curve in fcurves(rig)}
    assert keys_after == keys_before  # also those of the confidence
    np.testing.assert_allclose(seen(rig, [1, last, last + 20]), before, atol=1e-5)
    bpy.ops.scope.loop(start=5, end=85, shortest=0.8)
    scene.frame_start = 1  # a manual setting is kept
    bpy.ops.scope.smooth()
    assert (scene.frame_start, scene.frame_end) == (1, cycle[1])


def test_only_the_loop_is_exported(rig, tmp_path):
    """Neither cyclic curves nor confidence keys outside the cycle make the file longer."""
    bpy.ops.scope.loop(start=5, end=85, shortest=0.8)
    length = bpy.context.scene.frame_end + 1 - bpy.context.scene.frame_start
    path = str(tmp_path / "loop.glb")
    bpy.ops.scope.export(filepath=path, format="GLB")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = int(RATE)
    bpy.ops.import_scene.gltf(filepath=path)
    assert len(bpy.data.actions) > 0
    for action in bpy.data.actions:
        assert action.frame_range[1] - action.frame_range[0] == pytest.approx(length, abs=0.01)
        assert action.frame_range[0] == 0  # players begin there


def test_a_motion_file_without_the_armature_is_an_error(rig, tmp_path):
    bpy.data.objects.remove(rig)
    with pytest.raises(RuntimeError, match="armature was removed; undo that or capture again"):
        bpy.ops.scope.export(filepath=str(tmp_path / "walk.npz"), format="NPZ")
    assert not (tmp_path / "walk.npz").exists()


def test_reduced_keys_stay_within_the_chosen_error(rig, capfd):
    degrees = 2.0
    before = seen(rig, range(1, 91))
    dense = keys(rig)[0]
    count = sum(len(c.keyframe_points) for c in fcurves(rig))
    bpy.ops.scope.reduce_keys(degrees=degrees, millimetres=3.0)
    after = sum(len(c.keyframe_points) for c in fcurves(rig))
    assert after < 0.5 * count
    reduced, frames = keys(rig)
    truth = dense.rotations[np.round(frames - 1).astype(int)]
    assert turned(reduced.rotations, truth) <= degrees * 1.01 + 0.01
    off = 1000 * np.linalg.norm(seen(rig, range(1, 91)) - before, axis=-1)
    assert off[:, 0].max() < 3.1
    # What was chosen of the pelvis is said of it; a joint is off by more.
    said = capfd.readouterr().out
    pelvis, joint = re.findall(r"([\d.]+) mm for the pelvis, which add up to ([\d.]+) mm", said)[0]
    assert float(pelvis) == pytest.approx(off[:, 0].max(), abs=0.06)
    assert float(joint) == pytest.approx(off.max(), abs=0.06)
    assert float(joint) > 3.0 >= float(pelvis)


def test_baking_to_rates(rig):
    before = seen(rig)
    bpy.ops.scope.bake_rate(rate=15.0)
    assert len(keys(rig)[1]) == 46
    np.testing.assert_allclose(np.diff(keys(rig)[1]), 2.0)
    assert np.abs(seen(rig) - before).max() < 0.03
    bpy.ops.scope.bake_rate(rate=0.0)
    np.testing.assert_allclose(keys(rig)[1], 1 + np.arange(91))


def test_a_modifier_of_a_curve_is_not_baked_into_its_keys_beside_it(rig):
    bpy.ops.scope.reduce_keys(degrees=5.0)
    curve = next(curve for curve in fcurves(rig) if curve.data_path.endswith("location"))
    noise = curve.modifiers.new("NOISE")
    noise.strength = 0.5
    noise.scale = 8.0
    before = seen(rig)
    bpy.ops.scope.bake_rate()
    assert [(each.type, each.mute) for each in curve.modifiers] == [("NOISE", False)]
    np.testing.assert_allclose(seen(rig), before, atol=0.01)


def test_edits_need_a_captured_armature_and_find_the_only_one():
    assert not bpy.ops.scope.smooth.poll()
    bpy.ops.object.empty_add()
    assert not bpy.ops.scope.refloor.poll()


def test_a_linked_capture_is_not_edited_until_it_is_local(rig, tmp_path):
    name = rig.users_collection[0].name
    file = tmp_path / "capture.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    layer = bpy.context.view_layer
    scene.render.fps = int(RATE)
    with bpy.data.libraries.load(str(file), link=True) as (_, here):
        here.collections = [name]
    here.collections[0].override_hierarchy_create(scene, layer)
    linked = layer.objects.active = next(obj for obj in scene.objects if obj.type == "ARMATURE")
    before = seen(linked)
    for operator in (bpy.ops.scope.refloor, bpy.ops.scope.root_motion):
        with pytest.raises(RuntimeError, match=r"linked from .*capture\.blend.*Make Local"):
            operator()
    np.testing.assert_array_equal(seen(linked), before)
    for obj in layer.objects:
        obj.select_set(True)
    bpy.ops.object.make_local(type="ALL")
    local = layer.objects.active = next(obj for obj in scene.objects if obj.type == "ARMATURE")
    assert bpy.ops.scope.root_motion() == {"FINISHED"}
    np.testing.assert_allclose(seen(local), before, atol=2e-4)


def test_missing_keys_are_an_error_and_change_nothing(rig):
    name = NAMES[5]
    for curve in fcurves(rig):
        if name in curve.data_path:
            curve.keyframe_points.clear()
    with pytest.raises(RuntimeError, match="has lost the keys"):
        bpy.ops.scope.refloor()


@pytest.mark.parametrize("change", ["name", "mode"])
def test_a_renamed_or_converted_bone_is_named_and_the_keys_stay(rig, change):
    bpy.context.scene.frame_set(20)
    if change == "name":
        rig.data.bones["left_elbow"].name = "forearm.L"
        wanted = "'walk' has no bone 'left_elbow'; if you have renamed it"
    else:
        rig.pose.bones["left_elbow"].rotation_mode = "XYZ"
        wanted = (
            "'left_elbow' of 'walk' has the rotation mode XYZ, in which its captured keys have no "
            "effect"
        )
    before = [(c.data_path, c.array_index, read_keys(c).tobytes()) for c in fcurves(rig)]
    for edit in (
        lambda: bpy.ops.scope.refloor(),
        lambda: bpy.ops.scope.reduce_keys(),
        lambda: bpy.ops.scope.add_pin(joint="left_wrist", frame=20, location=(0.3, 0.0, 1.2)),
    ):
        with pytest.raises(RuntimeError, match=wanted):
            edit()
        now = [(c.data_path, c.array_index, read_keys(c).tobytes()) for c in fcurves(rig)]
        assert now == before
