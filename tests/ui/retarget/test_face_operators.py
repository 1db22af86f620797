# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators that retarget the face, as a user runs them."""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np
import pytest
from scope.scope_addon.scene import actions
from scope.scope_addon.scene.build import build_scene
from scope.scope_addon.ui.retarget_panel import offered_expressions

from ...edit.walking import BODY, motion_of, walk
from ...made_motion import made_face
from ...scene.test_face_retarget import face_mesh


@pytest.fixture
def settings():
    motion = motion_of(walk(1.0))
    T = len(motion.frames)
    build_scene([replace(motion, face=made_face(T, jawOpen=np.linspace(0, 0.5, T)))], BODY)
    settings = bpy.context.scene.scope_retarget
    settings.face = face_mesh(["viseme_aa", "viseme_PP", "blinkLeft"])
    return settings


def test_guess_edit_keep_and_retarget(settings, tmp_path):
    bpy.ops.scope.guess_expressions()
    pairs = {(pair.key, pair.expression) for pair in settings.face_pairs}
    assert {
        ("viseme_aa", "jawOpen"),
        ("viseme_PP", "mouthPressLeft"),
        ("blinkLeft", "eyeBlinkLeft"),
    } <= pairs
    next(pair for pair in settings.face_pairs if pair.expression == "jawOpen").factor = 1.2
    bpy.ops.scope.save_expression_map(filepath=str(tmp_path / "face"))  # the suffix is added
    count = len(settings.face_pairs)
    settings.face_active = count - 1
    bpy.ops.scope.edit_expression_pair(action="REMOVE")
    assert len(settings.face_pairs) == count - 1
    bpy.ops.scope.edit_expression_pair(action="ADD")
    assert settings.face_active == count - 1
    bpy.ops.scope.load_expression_map(filepath=str(tmp_path / "face.json"))
    assert len(settings.face_pairs) == count
    bpy.ops.scope.retarget_face()
    (curve,) = actions.fcurves(settings.face.data.shape_keys)
    assert curve.data_path == 'key_blocks["viseme_aa"].value'
    assert actions.read_keys(curve)[-1, 1] == pytest.approx(0.6, abs=1e-5)
    name = settings.face.data.shape_keys.animation_data.action.name
    bpy.ops.scope.retarget_face()  # replaces it, and takes its name
    assert settings.face.data.shape_keys.animation_data.action.name == name
    assert not bpy.data.actions.get(f"{name}.001")


def test_retargeting_guesses_what_is_not_listed(settings):
    bpy.ops.scope.retarget_face()
    assert len(settings.face_pairs) > 3
    assert settings.face.data.shape_keys.animation_data.action is not None


def test_a_key_that_a_driver_moves_is_reported(settings, capfd):
    settings.face.data.shape_keys.key_blocks["viseme_aa"].driver_add("value")
    bpy.ops.scope.retarget_face()
    assert "do not show the expressions: 'viseme_aa'" in capfd.readouterr().out


def test_a_face_without_known_keys_is_an_error(settings):
    settings.face = face_mesh(["Key 1"])
    with pytest.raises(RuntimeError, match="no shape key"):
        bpy.ops.scope.retarget_face()
    assert settings.face.data.shape_keys.animation_data is None
    assert len(settings.face_pairs) == 0


def test_a_capture_without_face_says_so(settings):
    for obj in list(bpy.context.scene.objects):
        if "scope_source" in obj:
            bpy.data.objects.remove(obj)
    build_scene([motion_of(walk(1.0))], BODY)
    with pytest.raises(RuntimeError, match="was not captured; capture again with Face"):
        bpy.ops.scope.retarget_face()


def test_a_mesh_is_needed(settings):
    settings.face = None
    assert not bpy.ops.scope.retarget_face.poll()
    assert not bpy.ops.scope.guess_expressions.poll()


def test_a_mesh_that_was_deleted_from_the_scene_is_not_animated(settings):
    bpy.context.scene.collection.objects.unlink(settings.face)
    assert settings.face is not None  # it stays in the file as long as it is chosen
    assert not bpy.ops.scope.retarget_face.poll()


def test_choosing_another_mesh_replaces_the_list(settings):
    bpy.ops.scope.guess_expressions()
    first = settings.face
    other = face_mesh(["jawOpen", "mouthPucker", "mouthFunnel", "cheekPuff", "noseSneerLeft"])
    settings.face_pairs[0].factor = 0.25  # edited by hand
    for chosen in (None, first):
        settings.face = chosen
        assert settings.face_pairs[0].factor == 0.25
    settings.face = other
    assert {pair.key for pair in settings.face_pairs} == {
        block.name for block in other.data.shape_keys.key_blocks[1:]
    }


def test_guessing_without_known_names_leaves_the_list_as_it_is(settings):
    settings.face = face_mesh(["Key 1"])
    pair = settings.face_pairs.add()
    pair.key = "Key 1"
    pair.expression = "jawOpen"
    with pytest.raises(RuntimeError, match="has a name of ARKit, Oculus or VRM"):
        bpy.ops.scope.guess_expressions()
    assert settings.face_pairs[0].key == "Key 1"


def test_what_could_not_be_loaded_again_is_not_saved(settings, tmp_path):
    path = tmp_path / "face.json"
    with pytest.raises(RuntimeError, match="no shape key and no control; add one"):
        bpy.ops.scope.save_expression_map(filepath=str(path))
    bpy.ops.scope.guess_expressions()
    settings.face_pairs[0].expression = "grin"
    with pytest.raises(RuntimeError, match="'grin', which is not an expression"):
        bpy.ops.scope.save_expression_map(filepath=str(path))
    assert not path.exists()


def test_expressions_are_offered_by_what_was_typed():
    assert offered_expressions(None, bpy.context, "blink") == ["eyeBlinkLeft", "eyeBlinkRight"]
