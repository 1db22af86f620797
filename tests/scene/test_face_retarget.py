# SPDX-License-Identifier: GPL-3.0-or-later
"""Captured expressions on the shape keys of other meshes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import bpy
import numpy as np
import pytest
from scope.scope_addon.errors import UsageError
from scope.scope_addon.kinematics.face import EXPRESSIONS
from scope.scope_addon.motion import Motion
from scope.scope_addon.retarget.expression_map import ExpressionMap
from scope.scope_addon.retarget.rig_source import RigSource
from scope.scope_addon.scene import actions, face_retarget
from scope.scope_addon.scene.build import NEW_SCENE, build_scene
from scope.scope_addon.scene.export import formats
from scope.scope_addon.scene.face_retarget import (
    CapturedExpressions,
    captured_expressions,
    driven_keys,
    faces_of,
    retarget_expressions,
)
from scope.scope_addon.scene.rig_file import export_on_rig
from scope.solver.body import Body

from ..edit.walking import motion_of, walk
from ..made_motion import made_face
from .character.test_expression_keys import morph_animation
from .made_rigs import add_mpfb_face, build_rig

JAW = np.array([0.0, 0.3, 0.9, 0.2])


def face_mesh(names, parent=None):
    """A mesh of a triangle, with one shape key per name."""
    mesh = bpy.data.meshes.new("Head")
    mesh.from_pydata([(0, 0, 1.6), (0.1, 0, 1.6), (0, 0, 1.7)], [], [(0, 1, 2)])
    face = bpy.data.objects.new("Head", mesh)
    bpy.context.scene.collection.objects.link(face)
    for k, name in enumerate(["Basis", *names]):
        face.shape_key_add(name=name, from_mix=False).data[0].co.y += 0.01 * k
    if parent is not None:
        face.parent = parent
        face.modifiers.new("Armature", "ARMATURE").object = parent
    return face


def keyed(face):
    """The (T, 2) keys of each animated shape key, by name."""
    curves = actions.fcurves(face.data.shape_keys)
    return {curve.data_path.split('"')[1]: actions.read_keys(curve) for curve in curves}


@pytest.fixture(scope="module")
def captured(whole_body, make_motion):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    motion = replace(make_motion(whole_body, 4), face=made_face(4, jawOpen=JAW, eyeBlinkLeft=0.4))
    return captured_expressions(
        build_scene([motion], whole_body, options=NEW_SCENE).people[0].armature
    )


def test_expressions_are_read_back_from_the_captured_body(captured):
    np.testing.assert_allclose(captured.frames, np.arange(4))
    columns = dict(zip(EXPRESSIONS, captured.weights.T, strict=True))
    np.testing.assert_allclose(columns["jawOpen"], JAW, atol=1e-6)
    np.testing.assert_allclose(columns["eyeBlinkLeft"], 0.4, atol=1e-6)


def test_a_capture_without_face_has_no_expressions(whole_body, make_motion):
    person = build_scene([make_motion(whole_body, 4)], whole_body, options=NEW_SCENE).people[0]
    assert captured_expressions(person.armature) is None


def test_arkits_keys_move_as_captured(captured):
    face = face_mesh(
        ["jawOpen", "eyeBlink_L", "eyeBlink_R", "mouthSmile_L", "mouthSmile_R", "width"]
    )
    face.data.shape_keys.key_blocks["width"].value = 0.7
    (action,) = retarget_expressions(captured, [face], name="talk")
    assert action.name == "Head_talk"
    assert set(keyed(face)) == {"jawOpen"}  # what never moves has a value alone
    np.testing.assert_allclose(
        keyed(face)["jawOpen"], np.stack([np.arange(4), JAW], axis=1), atol=1e-6
    )
    values = {block.name: block.value for block in face.data.shape_keys.key_blocks}
    assert values["eyeBlink_L"] == pytest.approx(0.4)
    assert values["width"] == pytest.approx(0.7)


def test_expressions_of_a_looped_person_repeat(
    captured: CapturedExpressions, whole_body: Body, make_motion: Callable[..., Motion]
) -> None:
    assert not captured.repeat
    motion = replace(make_motion(whole_body, 4), face=made_face(4, jawOpen=JAW))
    person = build_scene([motion], whole_body, options=NEW_SCENE).people[0].armature
    for block in actions.animated_together(person, None):
        actions.add_cycles(block)
    looped = captured_expressions(person)
    assert looped is not None
    face = face_mesh(["jawOpen", "eyeBlink_L", "eyeBlink_R", "mouthSmile_L", "mouthSmile_R"])
    for _ in range(2):
        (action,) = retarget_expressions(looped, [face])
        (curve,) = actions.fcurves(face.data.shape_keys)
        cycle = looped.frames[-1] - looped.frames[0]
        for k in (1, 2):
            later = looped.frames[k] + 2 * cycle
            assert curve.evaluate(later) == pytest.approx(JAW[k], abs=1e-5)
    assert action.name == "Head_Face"  # The first one was not edited, and so replaced.


def test_a_map_adds_up_and_stays_within_0_and_1(captured):
    face = face_mesh(["mund", "lid"])
    chosen = ExpressionMap(
        {"mund": {"jawOpen": 2.0, "eyeBlinkLeft": -1.0}, "lid": {"eyeBlinkLeft": 0.5}}
    )
    retarget_expressions(captured, [face], chosen)
    np.testing.assert_allclose(keyed(face)["mund"][:, 1], np.clip(2 * JAW - 0.4, 0, 1), atol=1e-6)
    assert face.data.shape_keys.key_blocks["lid"].value == pytest.approx(0.2)


def test_an_unedited_result_is_replaced_and_an_edited_one_is_kept(captured):
    face = face_mesh(["A", "Blink"])
    retarget_expressions(captured, [face])
    retarget_expressions(captured, [face])
    assert len(bpy.data.actions) == 1
    actions.fcurves(face.data.shape_keys)[0].keyframe_points[0].co.y += 0.1
    retarget_expressions(captured, [face])
    assert len(bpy.data.actions) == 2


def test_the_result_of_another_capture_is_kept(captured):
    face = face_mesh(["A", "Blink"])
    (first,) = retarget_expressions(captured, [face], name="take 1")
    (second,) = retarget_expressions(captured, [face], name="take 2")
    assert {first.name, second.name} == {"Head_take 1", "Head_take 2"}
    retarget_expressions(captured, [face], name="take 2")
    assert bpy.data.actions.keys() == ["Head_take 1", "Head_take 2"]


def test_a_mesh_without_known_names_is_refused(captured):
    face = face_mesh(["Key 1"])
    with pytest.raises(UsageError, match="'Head' is mapped to an expression; name them as"):
        retarget_expressions(captured, [face])
    assert face.data.shape_keys.animation_data is None


def test_keys_that_drivers_move_are_reported(captured):
    """Animated values of driven keys have no effect."""
    faces = [face_mesh(["jawOpen", "eyeBlink_L", "width"]), face_mesh(["A"])]
    for key in ("jawOpen", "width"):
        faces[0].data.shape_keys.key_blocks[key].driver_add("value")
    retarget_expressions(captured, faces)
    (warning,) = driven_keys(faces)
    assert str(warning).endswith(
        "'Head', so they do not show the expressions: 'jawOpen'; remove the drivers"
    )
    faces[0].data.shape_keys.animation_data.drivers[0].mute = True
    assert driven_keys(faces) == []


def test_what_fails_changes_nothing(captured, monkeypatch):
    faces = [face_mesh(["A"]), face_mesh(["A"])]
    retarget_expressions(captured, faces)
    before = [(keyed(face), face.data.shape_keys.animation_data.action) for face in faces]
    count = len(bpy.data.actions)
    monkeypatch.setattr(face_retarget, "retire", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        retarget_expressions(captured, faces, ExpressionMap({"A": {"eyeBlinkLeft": 1.0}}))
    assert len(bpy.data.actions) == count
    for face, (keys, action) in zip(faces, before, strict=True):
        assert face.data.shape_keys.animation_data.action == action
        np.testing.assert_array_equal(keyed(face)["A"], keys["A"])
        at_frame_1 = pytest.approx(keys["A"][1, 1])
        assert face.data.shape_keys.key_blocks["A"].value == at_frame_1


def test_meshes_that_share_their_data_are_one_face():
    face = face_mesh(["A"])
    copy = bpy.data.objects.new("Copy", face.data)
    assert len(faces_of([face, copy])) == 1


@pytest.mark.parametrize(
    ("names", "moving"), [(["viseme_aa", "viseme_O"], "viseme_aa"), (["Key 1"], None)]
)
def test_a_rig_file_gets_body_and_face(whole_body, tmp_path, names, moving):
    rig, _ = build_rig("mixamo")
    face_mesh(names, rig)
    path = tmp_path / "hero.blend"
    with formats.quiet():
        formats.write_blend(path, bpy.context.scene)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    motion = motion_of(walk(0.3))
    T = len(motion.frames)
    motion = replace(motion, face=made_face(T, jawOpen=np.linspace(0, 0.5, T)))
    _, warnings = export_on_rig(
        [motion], whole_body, [tmp_path / "out.glb"], RigSource(path), NEW_SCENE
    )
    found = [warning for warning in map(str, warnings) if "face" in warning]
    if moving is None:
        assert "was not retargeted" in found[0]
        return
    assert not found
    weights = morph_animation(tmp_path / "out.glb")
    np.testing.assert_allclose(weights[moving], 1.5 * np.linspace(0, 0.5, T), atol=1e-4)
    assert not weights["viseme_O"].any()


@pytest.mark.parametrize("known_keys", [False, True])
def test_a_rig_file_whose_bones_move_the_face(whole_body, tmp_path, known_keys):
    rig, _ = build_rig("mpfb")
    add_mpfb_face(rig)
    face_mesh(["viseme_aa"] if known_keys else ["Key 1"], rig)
    with formats.quiet():
        formats.write_blend(tmp_path / "hero.blend", bpy.context.scene)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    motion = motion_of(walk(0.3))
    motion = replace(
        motion, face=made_face(len(motion.frames), jawOpen=np.linspace(0, 1, len(motion.frames)))
    )
    _, warnings = export_on_rig(
        [motion],
        whole_body,
        [tmp_path / "out.blend"],
        RigSource(tmp_path / "hero.blend"),
        NEW_SCENE,
    )
    assert not [warning for warning in map(str, warnings) if "face" in warning]
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "out.blend"))
    (written,) = (obj for obj in bpy.data.objects if obj.type == "ARMATURE")
    bones = {curve.data_path.split('"')[1] for curve in actions.fcurves(written)}
    assert "upperarm01.L" in bones
    assert ("jaw" in bones) != known_keys


def test_a_failure_in_tweak_mode_keeps_the_action_outside_of_it(captured, monkeypatch):
    face = face_mesh(EXPRESSIONS)
    keys = face.data.shape_keys
    keys.key_blocks["jawOpen"].keyframe_insert("value", frame=1)
    animation = keys.animation_data
    animation.nla_tracks.new().strips.new("strip", 1, animation.action)
    animation.action = own = bpy.data.actions.new("own")
    animation.nla_tracks[0].strips[0].select = animation.nla_tracks[0].select = True
    animation.use_tweak_mode = True
    assert animation.action != own
    monkeypatch.setattr(face_retarget, "mark_written", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        retarget_expressions(captured, [face])
    assert animation.action == own
