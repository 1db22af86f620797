# SPDX-License-Identifier: GPL-3.0-or-later
"""Giving the scene the footage's frame rate: captures are at the same place at the same time, other
keys stay.
"""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from scope.scope_addon.capture_report import Report
from scope.scope_addon.edit.corrected_motion import corrections_of
from scope.scope_addon.kinematics.face import EXPRESSIONS
from scope.scope_addon.motion import Motion
from scope.scope_addon.retarget.expression_map import ExpressionMap
from scope.scope_addon.scene.actions import fcurves, fcurves_of, has_slots, push_to_nla, read_keys
from scope.scope_addon.scene.build import NEW_SCENE, BuildOptions, build_scene
from scope.scope_addon.scene.character.correction_list import listed_corrections
from scope.scope_addon.scene.export.export import export_motions
from scope.scope_addon.scene.face_retarget import CapturedExpressions, retarget_expressions
from scope.scope_addon.scene.packed_motion import pack_motion, stored_motion
from scope.scope_addon.ui.capture_job import show_result
from scope.scope_addon.ui.frame_rate_operators import keyed_for, rate_warnings

from ..edit.walking import BODY, NAMES, motion_of, walk
from ..scene.made_rigs import build_rig

START = 11.0
TIMES = (0.0, 0.4, 1.0, 1.7)  # seconds of the footage


def built(start=START, **changes):
    """A capture of 30 frames per second in the scene, with its result."""
    motion: Motion = motion_of(walk(2.0))
    for name, value in changes.items():
        setattr(motion, name, value)
    result = build_scene([motion], BODY, None, BuildOptions(start_frame=start, name="walk"))
    person = result.people[0].armature
    pack_motion(person, motion.to_bytes())
    show_result(
        result.collection.scope_result,
        "",
        Report(warnings=rate_warnings(20.0, 30.0)),
        result,
    )
    bpy.context.scene.scope.capture = result.collection
    return person


@pytest.fixture
def scene():
    """A scene of 20 frames per second with an animated cube of the user's."""
    scene = bpy.context.scene
    scene.render.fps = 20
    scene.render.fps_base = 1.0
    bpy.ops.mesh.primitive_cube_add()
    cube = bpy.context.object
    for frame in (3, 40):
        cube.location.x = frame
        cube.keyframe_insert("location", index=0, frame=frame)
    scene["cube"] = cube
    return scene


def retargeted(person):
    """Return a rig with the motion of a person, and its bones by part."""
    rig, bones = build_rig("mixamo")
    bpy.context.scene.scope_retarget.rig = rig
    bpy.context.view_layer.objects.active = person
    bpy.ops.scope.retarget()
    return rig, bones


def at_times(armature, names, start=START):
    """Return where bones are at times of the footage, (T, B, 3)."""
    scene = bpy.context.scene
    out = []
    for time in TIMES:
        frame = start + time * scene.render.fps / scene.render.fps_base
        scene.frame_set(int(frame), subframe=frame - int(frame))
        posed = armature.evaluated_get(bpy.context.evaluated_depsgraph_get())
        out.append([posed.matrix_world @ posed.pose.bones[name].head for name in names])
    return np.array(out)


def cube_frames(scene):
    (curve,) = fcurves(scene["cube"])
    return read_keys(curve)[:, 0].tolist()


def test_keys_return_to_whole_frames_and_other_animation_stays(scene):
    person = built()
    before = at_times(person, NAMES)
    scene.frame_set(19)
    assert bpy.ops.scope.match_frame_rate() == {"FINISHED"}
    assert (scene.render.fps, scene.render.fps_base) == (30, 1.0)
    assert scene.frame_current == 23  # the same moment: 8 frames of 1/20 s are 12 of 1/30 s
    assert cube_frames(scene) == [3, 40]
    for curve in fcurves(person):
        np.testing.assert_array_equal(read_keys(curve)[:, 0], START + np.arange(61))
    assert (scene.frame_start, scene.frame_end) == (11, 71)
    np.testing.assert_allclose(at_times(person, NAMES), before, atol=1e-4)
    assert [w.text for w in scene.scope.result.warnings] == []
    again = at_times(person, NAMES)
    bpy.ops.scope.smooth(strength=1.0)  # which writes keys at the scene's rate
    np.testing.assert_allclose(at_times(person, NAMES), again, atol=1e-3)


@pytest.mark.skipif(not has_slots(), reason="this Blender has no slots")
def test_another_slot_of_the_captures_action_keeps_its_frames(scene):
    person = built()
    action = person.animation_data.action
    prop = bpy.data.objects.new("prop", None)
    scene.collection.objects.link(prop)
    prop.animation_data_create().action = action
    prop.animation_data.action_slot = action.slots.new(id_type="OBJECT", name="prop")
    for frame in (10, 40):
        prop.keyframe_insert("location", index=0, frame=frame)
    curves = fcurves(person)
    push_to_nla(person)
    bpy.ops.scope.match_frame_rate()
    assert key_times(prop) == [[10, 40]]
    for curve in curves:
        np.testing.assert_array_equal(read_keys(curve)[:, 0], START + np.arange(61))


def test_a_rate_that_an_importer_has_changed_is_noticed_and_restored(scene):
    person = built()
    before = at_times(person, NAMES)
    assert keyed_for(scene) == 0
    scene.render.fps = 24  # as Blender's importer of FBX files does
    assert keyed_for(scene) == 20
    bpy.ops.scope.match_frame_rate()
    assert keyed_for(scene) == 0
    np.testing.assert_allclose(at_times(person, NAMES), before, atol=1e-4)


def test_a_capture_that_another_one_with_its_rate_has_slowed_is_noticed(scene):
    person = built()
    before = at_times(person, NAMES)
    second = build_scene([motion_of(walk(2.0))], BODY, None, BuildOptions(frame_rate="set"))
    scene.scope.capture = second.collection
    assert keyed_for(scene) == 20
    bpy.ops.scope.match_frame_rate()
    assert keyed_for(scene) == 0
    np.testing.assert_allclose(at_times(person, NAMES), before, atol=1e-4)


def key_times(owner):
    """Return the scene frames of all keys of an object, curve by curve."""
    return [read_keys(curve)[:, 0].tolist() for curve in fcurves(owner)]


def test_smoothing_moves_no_key_to_a_rate_that_an_importer_has_changed(scene):
    person = built()
    keys = key_times(person)
    before = at_times(person, NAMES)
    scene.render.fps = 24
    bpy.ops.scope.smooth(strength=1.0)
    assert key_times(person) == keys  # of the bones and of what only Match Frame Rate moves
    assert keyed_for(scene) == 20
    bpy.ops.scope.match_frame_rate()
    np.testing.assert_allclose(at_times(person, NAMES), before, atol=1e-3)


def test_corrections_name_the_footage_that_is_shown_after_an_importer_has_changed_the_rate(scene):
    person = built()
    place = at_times(person, ["left_wrist"])[2, 0]
    scene.render.fps = 24
    scene.frame_set(31)  # a second after the start for the keys, which are 20 in a second
    bpy.ops.scope.add_pin(joint="left_wrist", location=place)
    bpy.ops.scope.foot_stands(start=31, end=33, foot="left")
    bpy.ops.scope.floor_here(foot="left")
    pin, stands, floor = corrections_of(stored_motion(person))
    assert (pin.frame, stands.first, stands.last, floor.frame) == (30, 30, 33, 30)


def test_a_frame_range_of_the_users_stays(scene):
    built()
    scene.frame_start = 1
    scene.frame_end = 250
    bpy.ops.scope.match_frame_rate()
    assert (scene.frame_start, scene.frame_end) == (1, 250)


@pytest.mark.parametrize("mode", ["OBJECT", "IN_PLACE"])
def test_a_root_object_that_a_duplicate_has_too_moves_once(scene, mode):
    person = built()
    bpy.ops.scope.root_motion(mode=mode)
    if mode == "OBJECT":
        push_to_nla(person.parent)
    bpy.ops.object.select_all(action="DESELECT")
    person.select_set(True)
    bpy.ops.object.duplicate()
    assert bpy.context.object.parent == person.parent
    bpy.context.view_layer.objects.active = person
    before = at_times(person, NAMES)
    bpy.ops.scope.match_frame_rate()
    np.testing.assert_allclose(at_times(person, NAMES), before, atol=1e-4)
    if mode == "IN_PLACE":
        bpy.ops.scope.root_motion(mode="BONES")
        path = at_times(person, ["pelvis"])[:, 0, 1]
        np.testing.assert_allclose(np.diff(path) / np.diff(TIMES), -1.2, atol=0.1)


def test_nla_strips_and_their_actions_move(scene):
    person = built()
    bpy.ops.scope.push_to_nla()
    before = at_times(person, NAMES)
    bpy.ops.scope.match_frame_rate()
    (strip,) = person.animation_data.nla_tracks[0].strips
    assert (strip.frame_start, strip.frame_end) == (11.0, 71.0)
    assert strip.scale == pytest.approx(1.0)
    np.testing.assert_allclose(at_times(person, NAMES), before, atol=1e-4)


def test_a_loop_stays_closed_and_the_scene_plays_it(scene):
    person = built()
    bpy.ops.scope.loop(start=12, end=50)
    first = scene.frame_start
    last = scene.frame_end
    bpy.ops.scope.match_frame_rate()
    frames = read_keys(fcurves(person)[0])[:, 0]
    assert abs(scene.frame_start - frames[0]) < 1
    assert abs(scene.frame_end + 1 - frames[-1]) < 1
    assert (last - first) * 1.4 < scene.frame_end - scene.frame_start < (last - first) * 1.6
    bpy.ops.scope.smooth(strength=1.0)
    assert (scene.frame_start, scene.frame_end) == (11, 71)


def test_a_retargeted_rig_moves_along_and_its_own_action_stays(scene):
    person = built()
    rig, bones = build_rig("mixamo")
    rig.pose.bones[bones["head"]].keyframe_insert("location", frame=7)
    own = rig.animation_data.action
    scene.scope_retarget.rig = rig
    bpy.context.view_layer.objects.active = person
    bpy.ops.scope.retarget()
    before = at_times(rig, list(bones.values()))
    bpy.ops.scope.match_frame_rate()
    np.testing.assert_allclose(at_times(rig, list(bones.values())), before, atol=1e-3)
    rig.animation_data.action = own
    assert read_keys(fcurves(rig)[0])[:, 0].tolist() == [7]


def test_every_take_of_a_rig_moves_along_in_the_nla_too(scene):
    first = built()
    second = built(start=101.0)
    rig, bones = retargeted(first)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.scope.push_to_nla()
    (strip,) = rig.animation_data.nla_tracks[0].strips
    bpy.context.view_layer.objects.active = second
    bpy.ops.scope.retarget()
    take_2 = at_times(rig, list(bones.values()), 101.0)
    rig.animation_data.action, kept = None, rig.animation_data.action
    take_1 = at_times(rig, list(bones.values()))
    bpy.ops.scope.match_frame_rate()
    assert strip.frame_end - strip.frame_start == pytest.approx(60, abs=0.01)
    np.testing.assert_allclose(at_times(rig, list(bones.values())), take_1, atol=1e-3)
    rig.animation_data.action = kept
    if hasattr(rig.animation_data, "action_slot"):
        rig.animation_data.action_slot = kept.slots[0]
    np.testing.assert_allclose(at_times(rig, list(bones.values()), 101.0), take_2, atol=1e-3)


def test_a_failure_leaves_everything_at_its_frames(scene, monkeypatch):
    """An earlier take in the NLA, one that nothing uses, a face, a trajectory and a marker."""
    person = built()
    scene.scope_retarget.root = "object"
    rig, _ = retargeted(person)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.scope.push_to_nla()
    bpy.context.view_layer.objects.active = person
    bpy.ops.scope.retarget()
    unused = rig.animation_data.action.copy()
    unused.use_fake_user = True
    face = scene["cube"]
    for name in ("Basis", "jawOpen"):
        face.shape_key_add(name=name)
    captured = CapturedExpressions(START + np.arange(41.0), np.ones((41, len(EXPRESSIONS))))
    chosen = ExpressionMap({"jawOpen": {"jawOpen": 1.0}})
    retarget_expressions(captured, [face], chosen, person.name)
    push_to_nla(face.data.shape_keys)
    scene.timeline_markers.new("check 12-20", frame=12)

    def all_frames():
        animations = [rig.animation_data, face.data.shape_keys.animation_data]
        strips = [each.nla_tracks[0].strips[0] for each in animations]
        return (
            {
                action.name: ([read_keys(c).tolist() for c in fcurves_of(action)], dict(action))
                for action in bpy.data.actions
            },
            [(s.frame_start, s.frame_end, s.action_frame_end) for s in strips],
            [(marker.name, marker.frame) for marker in scene.timeline_markers],
            [obj.get("scope_rate") for obj in scene.objects],
        )

    def fail(*arguments):
        raise MemoryError

    before = all_frames()
    monkeypatch.setattr("scope.scope_addon.scene.match_rate._show_footage", fail)
    with pytest.raises((MemoryError, RuntimeError)):
        bpy.ops.scope.match_frame_rate()
    assert all_frames() == before
    assert scene.render.fps == 20
    monkeypatch.undo()
    bpy.ops.scope.match_frame_rate()
    assert all(now != then for now, then in zip(all_frames()[:3], before[:3], strict=True))


def test_a_strip_that_plays_the_action_of_a_library_stays_with_its_keys(scene, tmp_path):
    person = built()
    rig, _ = retargeted(person)
    action = rig.animation_data.action
    path = str(tmp_path / "take.blend")
    bpy.data.libraries.write(path, {action})
    with bpy.data.libraries.load(path, link=True) as (_, here):
        here.actions = [action.name]
    (linked,) = here.actions
    rig.animation_data.action = None
    strip = rig.animation_data.nla_tracks.new().strips.new("take", int(START), linked)
    played = strip.frame_start, strip.frame_end
    keys = [read_keys(curve) for curve in fcurves_of(linked)]
    bpy.ops.scope.match_frame_rate()
    assert (strip.frame_start, strip.frame_end) == played
    np.testing.assert_array_equal([read_keys(curve) for curve in fcurves_of(linked)], keys)


def test_only_animation_that_was_not_captured_is_said_to_play_faster(scene, capfd):
    person = built()
    bpy.data.objects.remove(scene["cube"])
    scene.scope_retarget.root = "object"
    rig, _ = retargeted(person)
    assert rig.parent is not None
    bpy.ops.scope.match_frame_rate()
    said = capfd.readouterr().out
    assert "30 frames/s, like the motion" in said
    assert "not captured" not in said


# below the captured armature, with keys of all names that a captured body has
@pytest.mark.parametrize(("in_nla", "is_below"), [(False, True), (True, False)])
def test_a_retargeted_face_moves_along_in_the_nla_too(scene, in_nla, is_below):
    person = built()
    face = scene["cube"]
    for name in ("Basis", "A", *(EXPRESSIONS if is_below else ("jawOpen",))):
        face.shape_key_add(name=name)
    if is_below:
        face.parent = person
    frames = START + np.arange(41.0)
    weights = np.zeros((41, len(EXPRESSIONS)))
    weights[:, EXPRESSIONS.index("jawOpen")] = np.linspace(0.0, 1.0, 41)
    chosen = ExpressionMap({"jawOpen": {"jawOpen": 1.0}})
    retarget_expressions(CapturedExpressions(frames, weights), [face], chosen, person.name)
    keys = face.data.shape_keys
    strip = push_to_nla(keys) if in_nla else None
    bpy.ops.scope.match_frame_rate()
    if strip is not None:
        assert (strip.frame_start, strip.frame_end) == pytest.approx((START, START + 60))
    for time in (0.5, 1.0, 1.7):
        frame = START + 30 * time
        scene.frame_set(int(frame), subframe=frame % 1)
        seen = keys.evaluated_get(bpy.context.evaluated_depsgraph_get())
        assert seen.key_blocks["jawOpen"].value == pytest.approx(time / 2, abs=1e-4)


def test_review_frames_and_corrections_name_the_moved_frames(scene):
    valid = np.ones(61, bool)
    valid[30:45] = False
    person = built(valid=valid)
    bpy.ops.scope.add_pin(
        joint="left_wrist", frame=31, location=at_times(person, ["left_wrist"])[2, 0]
    )
    assert (scene.timeline_markers[0].name, scene.timeline_markers[0].frame) == (
        "not seen 31-40",
        31,
    )
    bpy.ops.scope.match_frame_rate()
    assert (scene.timeline_markers[0].name, scene.timeline_markers[0].frame) == (
        "not seen 41-54",
        41,
    )
    assert [w.spans for w in scene.scope.result.warnings if w.spans] == ["41-54"]
    assert [e["first"] for e in listed_corrections(person)] == [41]
    bpy.ops.scope.delete_capture()
    assert not scene.timeline_markers


def test_the_users_own_camera_keeps_its_keys(scene):
    built()
    data = bpy.data.cameras.new("own")
    camera = bpy.data.objects.new("own", data)
    scene.scope.capture.objects.link(camera)
    for frame in (3, 40):
        camera.keyframe_insert("location", index=0, frame=frame)
        data.keyframe_insert("lens", frame=frame)
    bpy.ops.scope.match_frame_rate()
    assert key_times(camera) == key_times(data) == [[3, 40]]


def test_two_captures_keep_their_starts_and_speeds(scene):
    first = built()
    second = built(start=101.0)
    before = at_times(first, NAMES), at_times(second, NAMES, 101.0)
    bpy.ops.scope.match_frame_rate()
    np.testing.assert_allclose(at_times(first, NAMES), before[0], atol=1e-4)
    np.testing.assert_allclose(at_times(second, NAMES, 101.0), before[1], atol=1e-4)
    assert (scene.frame_start, scene.frame_end) == (11, 161)


def texts(collection):
    return [warning.text for warning in collection.scope_result.warnings]


def test_a_capture_of_another_rate_keeps_its_warning_with_the_new_rate(scene):
    built(mocap_framerate=np.array(5.0), timestamps=np.arange(61) / 5.0)
    other = scene.scope.capture
    built()
    bpy.ops.scope.match_frame_rate()
    assert texts(scene.scope.capture) == []
    (text,) = texts(other)
    assert "keeps its 30 frames/s" in text
    assert "has 5: keys are 6 frames apart" in text
    scene.scope.capture = other
    bpy.ops.scope.match_frame_rate()
    assert texts(other) == []


def test_a_picture_has_no_frame_rate(scene, standing):
    result = build_scene([motion_of(walk(0.0))], BODY, None, BuildOptions())
    show_result(result.collection.scope_result, "", Report(), result)
    with pytest.raises(RuntimeError, match="no captured video"):
        bpy.ops.scope.match_frame_rate()


@pytest.fixture
def shell_file(tmp_path):
    """A capture of 30 frames per second in a .blend file, as the command line writes it."""
    path = tmp_path / "walk.blend"
    motion = motion_of(walk(2.0))
    export_motions([motion], BODY, path, build_options=replace(NEW_SCENE, name="walk"))
    return path


def test_a_capture_that_the_shell_wrote_keeps_its_speed(shell_file):
    bpy.ops.wm.open_mainfile(filepath=str(shell_file))
    scene = bpy.context.scene
    person = bpy.data.objects["walk"]
    action = person.animation_data.action
    assert not action.use_frame_range  # which would cut what the NLA plays of it
    before = at_times(person, NAMES, 0.0)
    scene.render.fps = 15
    assert keyed_for(scene) == 30
    bpy.ops.scope.match_frame_rate()
    assert scene.render.fps == 30
    np.testing.assert_allclose(at_times(person, NAMES, 0.0), before, atol=1e-4)
    built(mocap_framerate=np.array(60.0), timestamps=np.arange(61) / 60.0)
    bpy.ops.scope.match_frame_rate()
    assert scene.render.fps == 60
    np.testing.assert_allclose(at_times(person, NAMES, 0.0), before, atol=1e-4)
    assert tuple(action.frame_range) == (0, 120)


def test_a_person_who_was_appended_without_the_collection_gets_the_speed_back(scene, shell_file):
    with bpy.data.libraries.load(str(shell_file)) as (_, chosen):
        chosen.objects = ["walk"]
    (person,) = chosen.objects
    scene.collection.objects.link(person)
    assert keyed_for(scene) == 30
    assert bpy.types.SCOPE_PT_result.poll(bpy.context)  # and says so
    bpy.ops.scope.match_frame_rate()
    assert scene.render.fps == 30
    assert tuple(person.animation_data.action.frame_range) == (0, 60)
    assert keyed_for(scene) == 0


@pytest.mark.parametrize(
    ("scene_rate", "rate", "said"),
    [
        (30, 5, "are 6 frames apart"),
        (30, 29.98, "lie between"),
        (60, 29.99, "lie between"),
        (24, 1000, "lie between"),
    ],
)
def test_keys_are_whole_frames_apart_only_if_they_stay_so(scene_rate, rate, said):
    (text,) = map(str, rate_warnings(scene_rate, rate))
    assert f"keys {said}" in text


def test_a_rate_that_is_none_has_no_warning():
    assert rate_warnings(30.0, float("nan")) == []
    assert rate_warnings(30.0, 0.0) == []
