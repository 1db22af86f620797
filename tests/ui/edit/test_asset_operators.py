# SPDX-License-Identifier: GPL-3.0-or-later
"""Marking captured motion as an asset: picture, metadata, catalog."""

import os
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from scope.scope_addon.ui.action_operators import SCOPE_OT_mark_asset

from ...edit.walking import motion_of, walk
from ...scene.made_rigs import build_rig, captured, captured_with


@pytest.fixture
def motion():
    """A walk whose first ten frames were not seen."""
    motion = motion_of(walk(1.0))
    motion.valid[:10] = False
    return motion


@pytest.fixture
def rig(motion):
    return captured_with(motion)


def picture(action):
    """(256, 256, 4); the first row is the lowest one."""
    assert tuple(action.preview.image_size) == (256, 256)
    return np.array(action.preview.image_pixels_float[:]).reshape(256, 256, 4)


def test_the_action_becomes_an_asset_with_picture_tags_and_details(rig):
    scene = bpy.context.scene
    scene.frame_set(7)
    assert bpy.ops.scope.mark_asset(author="Ada") == {"FINISHED"}
    data = rig.animation_data.action.asset_data
    assert sorted(tag.name for tag in data.tags) == ["mocap", "scope"]
    assert (data.author, data.description) == ("Ada", "Captured from walk.mp4, 1.0 s")
    assert scene.frame_current == 7
    seen = picture(rig.animation_data.action)
    alpha = seen[..., 3] > 0.5
    rows, columns = (np.flatnonzero(alpha.any(axis=axis)) for axis in (1, 0))
    assert np.ptp(rows) > 0.8 * 256  # a standing person spans most of the height
    assert np.ptp(columns) < 0.7 * 256
    red, blue = ((seen[..., c] > 0.4) & (seen[..., 2 - c] < 0.4) & alpha for c in (0, 2))
    assert min(red.sum(), blue.sum()) > 500  # limbs of both sides, in their colours


def test_the_picture_of_a_hidden_capture_is_of_its_own_frame(rig):
    action = rig.animation_data.action
    bpy.context.scene.frame_set(29)
    bpy.ops.scope.mark_asset(current_pose=True)
    shown = picture(action)
    bpy.context.scene.frame_set(11)
    rig.users_collection[0].hide_viewport = True
    bpy.context.scene.frame_set(29)
    bpy.ops.scope.mark_asset(current_pose=True)
    np.testing.assert_array_equal(picture(action), shown)


def test_a_lost_motion_still_gives_an_asset(rig):
    del rig["scope_motion"]
    bpy.ops.scope.mark_asset(description_text="A walk")
    assert rig.animation_data.action.asset_data.description == "A walk"
    assert picture(rig.animation_data.action)[..., 3].max() == 1.0


def test_the_picture_of_a_retargeted_rig_is_of_its_own_bones(rig):
    own, _ = build_rig("mixamo")
    bpy.context.scene.scope_retarget.rig = own
    bpy.context.view_layer.objects.active = rig
    bpy.ops.scope.retarget()
    bpy.context.view_layer.objects.active = own
    bpy.ops.scope.mark_asset()
    assert rig.animation_data.action.asset_data is None
    assert own.animation_data.action.asset_data is not None
    assert (picture(own.animation_data.action)[..., 3] > 0.5).sum() > 3000


def test_a_catalog_of_the_file_is_assigned_and_an_unknown_one_changes_nothing(rig, tmp_path):
    uid = "d1f81597-d27c-42fd-8386-3a3def6c9200"
    (tmp_path / "blender_assets.cats.txt").write_text(
        "# comment\nVERSION "
        f"1\n\n{uid}:Motions/Walks:Motions-Walks\n{uid[:-1]}x:Motions/Runs:Motions-Runs\n"
    )
    with pytest.raises(RuntimeError, match="no asset catalog 'Motions/Walks'"):
        bpy.ops.scope.mark_asset(catalog="Motions/Walks")  # the file has no folder yet
    assert rig.animation_data.action.asset_data is None
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "walks.blend"))
    for unknown in ("Runs", "Motions/Runs"):  # of which the latter's id is damaged
        with pytest.raises(
            RuntimeError, match=f"no asset catalog '{unknown}'; there are Motions/Walks$"
        ):
            bpy.ops.scope.mark_asset(catalog=unknown)
    bpy.ops.scope.mark_asset(catalog="Motions/Walks")
    assert rig.animation_data.action.asset_data.catalog_id == uid
    other = captured(motion_of(walk(1.0, speed=0.5)))
    assert suggested(other) == ""
    assert suggested(rig) == "Motions/Walks"


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such pipes")
def test_a_pipe_in_the_place_of_the_catalogs_is_not_waited_for(rig, tmp_path):
    os.mkfifo(tmp_path / "blender_assets.cats.txt")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "walks.blend"))
    assert suggested(rig) == ""


def suggested(rig):
    """Return the catalog that the dialog suggests for an armature, after it was used for another
    one.
    """
    bpy.context.view_layer.objects.active = rig
    operator = SimpleNamespace(catalog="Motions/Runs")
    context = SimpleNamespace(
        scene=bpy.context.scene,
        view_layer=bpy.context.view_layer,
        window_manager=SimpleNamespace(invoke_props_dialog=lambda _: {"RUNNING_MODAL"}),
    )
    assert SCOPE_OT_mark_asset.invoke(operator, context, None) == {"RUNNING_MODAL"}
    return operator.catalog
