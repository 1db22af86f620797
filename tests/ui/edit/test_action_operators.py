# SPDX-License-Identifier: GPL-3.0-or-later
"""Renaming a take, and moving its motion to the NLA."""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from scope.scope_addon.errors import UsageError
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.scene.character.root_object import root_object
from scope.scope_addon.scene.face_retarget import captured_expressions

from ...edit.walking import BODY, NAMES, motion_of, walk
from ...made_motion import made_face
from ...scene import made_rigs
from ...scene.made_rigs import captured


@pytest.fixture
def rig():
    return captured(motion_of(walk(1.0)))


def test_pushing_to_the_nla_keeps_the_motion(rig):
    before = made_rigs.seen(rig, NAMES, [1, 9, 20])
    assert bpy.ops.scope.push_to_nla() == {"FINISHED"}
    assert rig.animation_data.action is None
    (track,) = rig.animation_data.nla_tracks
    assert len(track.strips) == 1
    np.testing.assert_allclose(made_rigs.seen(rig, NAMES, [1, 9, 20]), before, atol=1e-4)
    with pytest.raises(RuntimeError, match="has no action"):
        bpy.ops.scope.push_to_nla()


def test_a_strip_has_the_time_of_the_body_the_root_motion_and_the_face():
    clip = walk(1.0)
    jaw = np.linspace(0.0, 0.9, len(clip))
    rig = captured(replace(motion_of(clip), face=made_face(len(clip), jawOpen=jaw)))
    bpy.ops.scope.root_motion(mode="OBJECT")
    (face,) = (child.data.shape_keys for child in rig.children if child.type == "MESH")
    before = made_rigs.seen(rig, NAMES, [1, 9, 20])
    bpy.ops.scope.push_to_nla()
    moved = [
        block for block in (rig, root_object(rig), face) if block.animation_data.action is None
    ]
    for block in moved:
        (strip,) = (strip for track in block.animation_data.nla_tracks for strip in track.strips)
        strip.frame_end += 50
        strip.frame_start += 50
    np.testing.assert_allclose(made_rigs.seen(rig, NAMES, [51, 59, 70]), before, atol=1e-4)
    assert face.key_blocks["jawOpen"].value == pytest.approx(jaw[19], abs=1e-4)
    for edit in (lambda: bpy.ops.scope.refloor(), lambda: captured_expressions(rig)):
        with pytest.raises((RuntimeError, UsageError), match="is animated by the NLA strip"):
            edit()
    rig.animation_data.action = rig.animation_data.nla_tracks[0].strips[0].action
    with pytest.raises(
        RuntimeError, match=f"'{root_object(rig).name}' is animated by the NLA strip"
    ):
        bpy.ops.scope.root_motion(mode="BONES")


def test_renaming_a_take_renames_its_objects_and_actions(rig):
    collection = bpy.context.scene.scope.result.collection
    bpy.ops.scope.rename_take(name="Scene 3, take 2")
    assert collection.name == rig.name == rig.animation_data.action.name == "Scene 3, take 2"
    with pytest.raises(RuntimeError, match="no name"):
        bpy.ops.scope.rename_take(name=" ")


def names_of(collection):
    """Return the names of a capture's objects, their data and their actions."""
    names = set()
    for obj in collection.all_objects:
        for block in filter(None, (obj, obj.data, getattr(obj.data, "shape_keys", None))):
            animation = block.animation_data
            names |= {block.name, *([animation.action.name] if animation else [])}
    return {name for name in names if not name.startswith("Key")}  # Blender's name of shape keys


def test_renaming_a_further_take_of_the_same_footage_renames_all_of_it():
    motions = [motion_of(walk(0.2))] * 2
    first, second = (
        build_scene(motions, BODY, None, BuildOptions(name="walk")).collection for _ in range(2)
    )
    before = names_of(first)
    second.name = "Hero"  # in the Outliner
    bpy.context.scene.scope.capture = second
    bpy.ops.scope.rename_take(name="Take 2")
    assert {name[:6] for name in names_of(second)} == {"Take 2"}
    assert {name[6:] for name in names_of(second)} == {name[4:] for name in before}
    assert names_of(first) == before
    bpy.ops.scope.rename_take(name="Take 3")
    assert {name[:6] for name in names_of(second)} == {"Take 3"}


def test_an_armature_without_size_keeps_its_root_motion(rig):
    rig.scale = (0, 0, 0)
    for mode in ("OBJECT", "IN_PLACE"):
        with pytest.raises(RuntimeError, match="'walk' has the scale 0"):
            bpy.ops.scope.root_motion(mode=mode)
    assert root_object(rig) is None
