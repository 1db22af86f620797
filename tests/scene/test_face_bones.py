# SPDX-License-Identifier: GPL-3.0-or-later
"""Expressions on a face that bones move: a rig that Rigify generates, as Blender evaluates it.

How far the face should move is known from the body's own expressions, which come from shapes made
by an artist.
"""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np
import pytest
from scope.scope_addon.errors import UsageError
from scope.scope_addon.kinematics.face import EXPRESSIONS
from scope.scope_addon.retarget.expression_map import ExpressionMap
from scope.scope_addon.scene import actions
from scope.scope_addon.scene.face_retarget import (
    CapturedExpressions,
    guess_face_bones,
    has_bone_face,
    retarget_face_bones,
)

FRAMES = np.array([1.0, 2.0, 3.0])


def shown(**values):
    """Neutral at frame 1, the expressions at frames 2 and 3."""
    weights = np.zeros((3, len(EXPRESSIONS)))
    for name, value in values.items():
        weights[1:, EXPRESSIONS.index(name)] = value
    return CapturedExpressions(FRAMES, weights)


def heads(rig, frame, *names):
    """The world positions (n, 3) of bones' heads."""
    bpy.context.scene.frame_set(frame)
    bpy.context.view_layer.update()
    seen = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array([seen.matrix_world @ seen.pose.bones[name].head for name in names])


def moved(rig, *names, **values):
    """How far bones' heads move (n, 3) with an expression, in the world."""
    retarget_face_bones(shown(**values), rig, guess_face_bones(rig))
    return heads(rig, 3, *names) - heads(rig, 1, *names)


def keyed(rig):
    return {curve.data_path.split('"')[1] for curve in actions.fcurves(rig)}


@pytest.mark.slow
def test_the_jaw_opens_as_far_as_on_the_body_in_widths_of_the_mouth(rigify_face):
    lower, upper = moved(rigify_face, "DEF-lip.B.L", "DEF-lip.T.L", jawOpen=1.0)
    corners = heads(rigify_face, 1, "lips.L", "lips.R")
    width = np.linalg.norm(corners[0] - corners[1])
    # The body's lower lip goes down by 32.5 mm and back by 18.3, its mouth is 51.1 mm wide.
    assert -lower[2] / width == pytest.approx(32.5 / 51.1, abs=0.08)
    assert lower[1] / width == pytest.approx(18.3 / 51.1, abs=0.12)
    assert np.linalg.norm(upper) < 0.05 * width
    assert abs(lower[0]) < 1e-3 * width


def test_lips_that_stay_closed_meet_although_the_jaw_opens(rigify_face):
    lower, upper = moved(rigify_face, "DEF-lip.B.L", "DEF-lip.T.L", jawOpen=1.0, mouthClose=1.0)
    corners = heads(rigify_face, 1, "lips.L", "lips.R")
    assert np.linalg.norm(upper - lower) < 0.06 * np.linalg.norm(corners[0] - corners[1])


@pytest.mark.parametrize(
    ("name", "side", "other"), [("eyeBlinkLeft", "L", "R"), ("eyeBlinkRight", "R", "L")]
)
def test_a_blink_closes_the_eye_of_its_side_alone(rigify_face, name, side, other):
    lids = [f"DEF-lid.{lid}.{s}.002" for s in (side, other) for lid in "TB"]
    moves = moved(rigify_face, *lids, **{name: 1.0})
    gaps = heads(rigify_face, 1, *lids)
    gap = gaps[0, 2] - gaps[1, 2]
    assert abs(gap + moves[0, 2] - moves[1, 2]) < 0.05 * gap
    assert np.abs(moves[2:]).max() < 1e-6
    assert (heads(rigify_face, 1, "lips.L")[0, 0] > 0) == (heads(rigify_face, 1, "eye.L")[0, 0] > 0)


def test_left_is_the_persons_left(rigify_face):
    left, right = moved(rigify_face, "lips.L", "lips.R", mouthSmileLeft=1.0)
    assert left[2] > 0.01
    assert left[0] > 0.005  # outwards, of a person who looks along -y
    assert np.linalg.norm(right) < 0.1 * np.linalg.norm(left)


def test_both_eyes_look_to_the_left(rigify_face):
    moved(rigify_face, eyeLookOutLeft=1.0, eyeLookInRight=1.0)
    bpy.context.scene.frame_set(3)
    bpy.context.view_layer.update()
    seen = rigify_face.evaluated_get(bpy.context.evaluated_depsgraph_get())
    for side in "LR":
        ahead = seen.pose.bones[f"MCH-eye.{side}"].y_axis
        assert np.degrees(np.arctan2(ahead.x, -ahead.y)) == pytest.approx(15.0, abs=0.5)
        assert abs(ahead.z) < 0.01


def test_brows_rise(rigify_face):
    inner, outer = moved(rigify_face, "DEF-brow.T.L.003", "DEF-brow.T.L.001", browInnerUp=1.0)
    assert inner[2] > 0.005
    assert outer[2] < 0.2 * inner[2]


def test_a_neutral_face_is_the_rest_pose_and_has_no_keys(rigify_face):
    rigify_face.pose.bones["lip.B"].location = (0.1, 0, 0)  # left by the user
    retarget_face_bones(shown(), rigify_face, guess_face_bones(rigify_face))
    assert keyed(rigify_face) == set()
    bpy.context.view_layer.update()
    for bone in rigify_face.pose.bones:
        assert np.abs(np.array(bone.matrix_basis) - np.eye(4)).max() == 0, bone.name


def test_keys_are_written_for_controls_that_move_alone(rigify_face):
    moved(rigify_face, eyeBlinkLeft=0.5)
    assert keyed(rigify_face) == {"lid.T.L.002"}
    assert all(len(curve.keyframe_points) == 3 for curve in actions.fcurves(rigify_face))


def test_a_rig_that_is_scaled_and_turned_behaves_equally(rigify_face):
    values = {"jawOpen": 0.8, "mouthSmileLeft": 0.7, "eyeBlinkRight": 1.0, "eyeLookUpLeft": 1.0}
    names = [bone.name for bone in rigify_face.data.bones if bone.name.startswith("DEF-")]
    plain = moved(rigify_face, *names, **values)
    rigify_face.scale = (3.0, 3.0, 3.0)
    rigify_face.rotation_euler = (0.0, 0.0, 0.7)
    turned = moved(rigify_face, *names, **values)
    R = np.array(rigify_face.rotation_euler.to_matrix())
    np.testing.assert_allclose(turned, 3.0 * plain @ R.T, atol=2e-6)


def test_the_bodys_keys_stay_and_an_unedited_result_is_replaced(rigify_face):
    first = actions.Channels(rigify_face, bpy.data.actions.new("walk"))
    first.write(actions.bone_path("torso", "location"), FRAMES, np.arange(9.0).reshape(3, 3))
    action = retarget_face_bones(
        shown(jawOpen=1.0), rigify_face, guess_face_bones(rigify_face), "talk"
    )
    assert action.name == "rig_talk"
    assert bpy.data.actions["walk"].use_fake_user  # the user's own, kept
    assert {"torso", "jaw_master"} <= keyed(rigify_face)
    again = retarget_face_bones(
        shown(eyeBlinkLeft=1.0), rigify_face, guess_face_bones(rigify_face), "talk"
    )
    assert again.name == "rig_talk"
    assert {action.name for action in bpy.data.actions} == {"walk", "rig_talk"}
    assert keyed(rigify_face) == {"torso", "lid.T.L.002"}


def test_a_map_of_another_rig_is_refused(rigify_face):
    assert has_bone_face(rigify_face)
    with pytest.raises(UsageError, match="'rig' has none of the controls"):
        retarget_face_bones(
            shown(jawOpen=1.0), rigify_face, ExpressionMap({}, {"kiefer": {"up": {"jawOpen": 1.0}}})
        )


def test_expressions_of_a_looped_person_repeat_on_bones_alone(
    rigify_face: bpy.types.Object,
) -> None:
    """What else the rig's action holds keeps how it goes on."""
    rigify_face.pose.bones["head"].keyframe_insert("location", frame=1)
    looped = replace(shown(jawOpen=1.0), repeat=True)
    retarget_face_bones(looped, rigify_face, guess_face_bones(rigify_face))
    curves = actions.fcurves(rigify_face)
    of_head = [
        curve for curve in curves if curve.data_path == actions.bone_path("head", "location")
    ]
    repeating = [c for c in curves if [m.type for m in c.modifiers] == ["CYCLES"]]
    assert of_head
    assert repeating
    assert len(repeating) + len(of_head) == len(curves)
    np.testing.assert_allclose(
        heads(rigify_face, 4, "DEF-lip.B.L"), heads(rigify_face, 2, "DEF-lip.B.L"), atol=1e-5
    )
