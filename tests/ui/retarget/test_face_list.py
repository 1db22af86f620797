# SPDX-License-Identifier: GPL-3.0-or-later
"""Retargeting to a rig whose bones move the face, as a user runs it.

The bone list leaves out what all names of a rig begin with, so that the rest has room.
"""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np
import pytest
from scope.scope_addon.scene import actions
from scope.scope_addon.scene.build import build_scene
from scope.scope_addon.ui.retarget_operators import common_prefix

from ...edit.walking import BODY, motion_of, walk
from ...made_motion import made_face
from ...scene.made_rigs import add_mpfb_face, build_rig
from ...scene.test_face_retarget import face_mesh


@pytest.fixture
def settings():
    motion = motion_of(walk(1.0))
    T = len(motion.frames)
    weights = made_face(T, jawOpen=np.linspace(0, 1, T), eyeLookOutLeft=0.5)
    build_scene([replace(motion, face=weights)], BODY)
    rig, _ = build_rig("mpfb")
    add_mpfb_face(rig)
    settings = bpy.context.scene.scope_retarget
    settings.rig = rig
    return settings


def turns(rig, bone):
    """How far a bone is turned from rest at the motion's start and end, degrees."""
    found = []
    for frame in (bpy.context.scene.frame_start, bpy.context.scene.frame_end):
        bpy.context.scene.frame_set(frame)
        bpy.context.view_layer.update()
        found.append(np.degrees(rig.pose.bones[bone].matrix_basis.to_quaternion().angle))
    return found


def keyed(rig):
    return {
        curve.data_path.split('"')[1]: len(curve.keyframe_points) for curve in actions.fcurves(rig)
    }


def test_one_button_moves_body_and_face(settings):
    assert settings.face == settings.rig
    bpy.ops.scope.retarget()
    assert turns(settings.rig, "jaw") == pytest.approx([0, 22.2], abs=0.5)
    keys = keyed(settings.rig)
    assert {"upperarm01.L", "jaw", "levator05.L"} <= keys.keys()
    assert keys["eye.L"] == 1  # it looks aside all the time
    assert "eye.R" not in keys
    assert len(settings.face_pairs) > 100
    name = settings.rig.animation_data.action.name
    bpy.ops.scope.retarget()  # replaces it, and takes its name
    assert settings.rig.animation_data.action.name == name
    assert not bpy.data.actions.get(f"{name}.001")


def test_the_list_is_edited_saved_loaded_and_used_for_the_face_alone(settings, tmp_path):
    bpy.ops.scope.retarget()
    body = keyed(settings.rig)["upperarm01.L"]
    jaw = next(
        p
        for p in settings.face_pairs
        if (p.key, p.channel, p.expression) == ("jaw", "pitch", "jawOpen")
    )
    jaw.factor = 10.0
    bpy.ops.scope.save_expression_map(filepath=str(tmp_path / "face"))
    count = len(settings.face_pairs)
    bpy.ops.scope.edit_expression_pair(action="ADD")
    assert settings.face_pairs[settings.face_active].channel == "up"
    bpy.ops.scope.load_expression_map(filepath=str(tmp_path / "face.json"))
    assert len(settings.face_pairs) == count
    bpy.ops.scope.retarget_face()
    assert turns(settings.rig, "jaw") == pytest.approx([0, 10], abs=0.1)
    assert keyed(settings.rig)["upperarm01.L"] == body
    bpy.ops.scope.guess_expressions()
    jaw = next(
        p
        for p in settings.face_pairs
        if (p.key, p.channel, p.expression) == ("jaw", "pitch", "jawOpen")
    )
    assert jaw.factor > 20


def test_a_rig_without_a_known_face_keeps_its_face(settings):
    other, _ = build_rig("unreal")
    settings.rig = other
    assert settings.face is None
    bpy.ops.scope.retarget()
    assert len(settings.face_pairs) == 0


def test_where_a_mesh_has_known_shape_keys_they_show_the_face(settings):
    face_mesh(["viseme_aa", "blinkLeft"], settings.rig)
    rig = settings.rig
    settings.face = None
    settings.rig = None
    settings.rig = rig
    assert settings.face is None
    bpy.ops.scope.retarget()
    assert "jaw" not in keyed(rig)


def test_a_face_that_is_cleared_is_not_moved(settings):
    settings.face = None
    bpy.ops.scope.retarget()
    assert "jaw" not in keyed(settings.rig)


def test_a_map_that_cannot_be_used_changes_nothing(settings):
    bpy.ops.scope.guess_expressions()
    settings.face_pairs[0].expression = "grin"
    with pytest.raises(RuntimeError, match="'grin', which is not an expression"):
        bpy.ops.scope.retarget()
    assert settings.rig.animation_data is None


@pytest.mark.parametrize(
    ("bones", "prefix"),
    [
        (["mixamorig:Hips", "mixamorig:LeftHand", "mixamorig:LeftHandPinky3"], "mixamorig:"),
        (["CC_Base_Hip", "CC_Base_Head"], "CC_Base_"),
        (["Bip01 Pelvis", "Bip01 L Hand"], "Bip01 "),
        (["spine_fk", "spine_fk.001", "upper_arm_fk.L"], ""),
        (["LeftArm", "LeftLeg"], ""),
        (["mixamorig:Hips"], ""),
        ([], ""),
    ],
)
def test_the_common_prefix_ends_at_a_separator(bones, prefix):
    assert common_prefix(bones) == prefix
