# SPDX-License-Identifier: GPL-3.0-or-later
"""Custom properties that were changed by hand give a message or nothing, in the operators and in
the panel.
"""

import json
import math
from contextlib import suppress

import bpy
import numpy as np
import pytest
from scope.scope_addon.scene.actions import fcurves, read_keys
from scope.scope_addon.scene.camera import set_resolution
from scope.scope_addon.scene.character.correction_list import listed_corrections
from scope.scope_addon.scene.character.root_object import root_object
from scope.scope_addon.scene.match_rate import change_rate, retimed
from scope.scope_addon.scene.stored_values import parse_spans, spans_text
from scope.scope_addon.scene.timing import Retiming, keyed_rate
from scope.scope_addon.ui.captured_person import captured_armature
from scope.scope_addon.ui.frame_rate_operators import keyed_for

from ..edit.walking import NAMES, motion_of, walk
from ..scene import made_rigs
from ..scene.made_rigs import captured_with

VALUES = {
    "text": "abc",
    "empty": "",
    "list": [1.0, math.nan],
    "group": {"a": 1},
    "bytes": b"\xff",
    "nan": math.nan,
    "huge": 1e300,
    "number": 7,
    "frames": "1 2",
    "many": "9999999999 9999999999 -9999999999 99999999999999999999999",
}
KINDS = ("list", "nan", "number")
PROPERTIES = (
    "scope_start",
    "scope_rate",
    "scope_cycle",
    "scope_smoothing",
    "scope_betas",
    "scope_source",
    "scope_corrections",
    "scope_resampled",
    "scope_hidden",
    "scope_uneven_ground",
    "scope_motion",
)


@pytest.fixture
def rig():
    armature = captured_with(motion_of(walk(1.0)))
    bpy.context.scene.scope.result.footage_rate = 25.0
    bpy.context.scene.frame_set(10)
    return armature


def tried(operator, **arguments):
    """Return what an operator reports; a traceback is a failure of the test."""
    said = ""
    try:
        operator(**arguments)
    except RuntimeError as error:
        said = str(error)
    assert "Traceback" not in said
    return said


def try_all():
    ops = bpy.ops.scope
    tried(ops.smooth, strength=1.5)
    tried(ops.loop)
    tried(ops.smooth, strength=1.0)
    tried(ops.add_pin, joint="left_wrist", location=(0.3, 0.1, 1.0))
    tried(ops.remove_correction)
    tried(ops.root_motion, mode="IN_PLACE")
    tried(ops.root_motion, mode="BONES")
    tried(ops.refloor)
    with suppress(AttributeError):  # in the background, there is nothing to draw the preview with
        tried(ops.mark_asset)
    tried(ops.match_frame_rate)
    keyed_for(bpy.context.scene)
    listed_corrections(bpy.context.object)


@pytest.mark.slow
def test_no_operator_fails_with_a_traceback(rig):
    for name in PROPERTIES:
        before = rig.get(name)
        kept = before.to_list() if hasattr(before, "to_list") else before
        rig[name] = VALUES["group"]
        if name in ("scope_start", "scope_cycle"):
            try_all()
        else:
            tried(bpy.ops.scope.smooth)
            tried(bpy.ops.scope.refloor)
            keyed_for(bpy.context.scene)
            listed_corrections(rig)
            tried(bpy.ops.scope.match_frame_rate)
        rig.pop(name, None)
        if kept is not None:
            rig[name] = kept


@pytest.mark.parametrize("kind", KINDS)
def test_keys_beside_a_changed_start_are_said_and_stay(rig, kind):
    """What is no number counts as frame 0."""
    value = VALUES[kind]
    rig["scope_start"] = value
    captured = "7 to 37" if value == 7 else "0 to 30"
    with pytest.raises(RuntimeError, match=f"1 to 31, .* captured in frames {captured}: put them"):
        bpy.ops.scope.smooth(strength=1.0)
    keys = next(
        read_keys(c) for c in fcurves(rig) if c.data_path == 'pose.bones["pelvis"].location'
    )
    assert keys[0, 0] == 1.0


@pytest.mark.parametrize("kind", ["group", "frames", "many"])
def test_a_changed_cycle_leaves_the_frame_range(rig, kind):
    scene = bpy.context.scene
    scene.frame_start = 3
    scene.frame_end = 20
    rig["scope_cycle"] = VALUES[kind]
    bpy.ops.scope.smooth(strength=1.0)
    assert (scene.frame_start, scene.frame_end) == (3, 20)


def test_a_person_without_a_body_is_said(rig):
    for value in (5, [1.0, 2.0]):
        rig["scope_body"] = value
        assert "does not store which body it is" in tried(bpy.ops.scope.smooth)
    del rig["scope_body"]
    assert "does not store which body it is" in tried(bpy.ops.scope.smooth)


@pytest.mark.parametrize("value", [VALUES["group"], [5.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0]])
def test_a_changed_trajectory_is_said_and_smoothing_restores_the_motion(rig, value):
    before = made_rigs.seen(rig, NAMES, [5, 20])
    bpy.ops.scope.root_motion(mode="IN_PLACE")
    empty = root_object(rig)
    empty["scope_path"] = value
    assert "smooth the motion" in tried(bpy.ops.scope.root_motion, mode="BONES")
    bpy.ops.scope.match_frame_rate()  # which has nothing to move there
    bpy.ops.scope.smooth(strength=1.0)
    change_rate(bpy.context.scene, 30.0, {rig: None}, [])
    np.testing.assert_allclose(made_rigs.seen(rig, NAMES, [5, 20]), before, atol=1e-4)


@pytest.mark.parametrize("value", [VALUES["text"], [0.0] * 16])
@pytest.mark.parametrize("name", ["scope_place", "scope_root"])
def test_a_changed_root_object_goes_with_smoothing(rig, name, value):
    before = made_rigs.seen(rig, NAMES, [5, 20])
    bpy.ops.scope.root_motion(mode="OBJECT")
    root_object(rig)[name] = value
    bpy.ops.scope.root_motion(mode="OBJECT", heading=False)
    bpy.ops.scope.smooth(strength=1.0)
    assert root_object(rig) is None
    np.testing.assert_allclose(made_rigs.seen(rig, NAMES, [5, 20]), before, atol=1e-4)


def test_a_changed_picture_leaves_the_resolution(rig):
    scene = bpy.context.scene
    collection = rig.users_collection[0]
    scene.render.resolution_x = 123
    for value in (*VALUES.values(), [1920.0, 0.0, 1.0, 1.0], [1e300] * 4):
        collection["scope_picture"] = value
        set_resolution(scene, collection)
        assert scene.render.resolution_x == 123


def test_listed_frames_that_no_scene_has_are_left_out(rig):
    entry = {"kind": "PIN", "text": "Left Wrist", "joint": "left_wrist", "first": 5, "last": 5}
    listed = [entry, entry | {"first": 1 << 40}, entry | {"last": -(10**400)}]
    rig["scope_corrections"] = json.dumps(listed)
    assert [each["first"] for each in listed_corrections(rig)] == [5]


def test_a_changed_rate_is_the_scenes(rig):
    scene = bpy.context.scene
    for value in VALUES.values():
        rig["scope_rate"] = value
        assert keyed_rate(rig, scene) == (7.0 if value == 7 else 30.0)


def test_a_changed_person_of_a_rig_is_none(rig, tmp_path):
    own, _ = made_rigs.build_rig("unreal")
    bpy.context.scene.scope_retarget.rig = own
    bpy.context.view_layer.objects.active = rig
    bpy.ops.scope.retarget()
    own["scope_person"] = VALUES["text"]
    assert bpy.ops.scope.export(filepath=str(tmp_path / "a.fbx"), format="FBX", which="RIG") == {
        "FINISHED"
    }
    bpy.context.view_layer.objects.active = own
    assert captured_armature(bpy.context) == rig  # the only person of the scene
    assert tried(bpy.ops.scope.match_frame_rate) == ""


def test_changed_spans_have_no_button():
    texts = ("", "a", "-", "12-", "1-2-3", "9" * 20, "٣", "12-18", "-3--1")
    assert parse_spans(",".join(texts)) == [(12, 18), (-3, -1)]
    moved = retimed(parse_spans(f"a,{'9' * 500},1-11"), Retiming(1.0, 2.0))
    assert spans_text(moved) == "1-21"
