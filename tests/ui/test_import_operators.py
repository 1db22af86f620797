# SPDX-License-Identifier: GPL-3.0-or-later
"""Importing motion files in Blender: built, listed with its assumptions, stored, or refused in one
sentence.
"""

import shutil
from dataclasses import replace

import bpy
import numpy as np
import pytest
from scope.scope_addon.scene.packed_motion import stored_motion
from scope.scope_addon.ui.captured_person import captured_armature
from scope.scope_addon.ui.comparison import cameras_of

from ..edit.walking import motion_of, walk
from ..made_motion import made_views
from .conftest import inventory

MOTION = motion_of(walk(1.0))


@pytest.fixture
def amass(tmp_path):
    """An AMASS-style file at 120 frames per second."""
    path = tmp_path / "walk_poses.npz"
    np.savez(
        path,
        poses=MOTION.poses,
        trans=MOTION.trans,
        betas=np.ones(16),
        mocap_framerate=np.array(120.0),
    )
    return path


def test_a_motion_of_another_tool_is_built_and_listed(amass, capfd):
    scene = bpy.context.scene
    scene.render.fps = 24
    scene.scope.start_frame = 1
    assert bpy.ops.scope.import_motion(filepath=str(amass)) == {"FINISHED"}
    result = scene.scope.result
    assert (result.collection.name, result.people, result.frames) == ("walk_poses", 1, len(MOTION))
    assert "Scope's own body" in result.warnings[0].text
    assert "keeps its 24 frames/s, the motion has 120" in result.warnings[1].text
    said = capfd.readouterr().out  # The status bar shows it too.
    assert all(warning.text[1:] in said for warning in result.warnings[:2])
    button = bpy.ops.scope.match_frame_rate.get_rna_type().name
    assert button in result.warnings[1].text
    assert "footage" not in result.warnings[1].text.lower()  # there is none
    armature = captured_armature(bpy.context)
    assert scene.render.fps == 24
    assert armature.animation_data.action.frame_range[1] == pytest.approx(
        1 + 24 * (len(MOTION) - 1) / 120, abs=0.01
    )
    np.testing.assert_allclose(stored_motion(armature).poses, MOTION.poses, atol=1e-5)
    assert not any(obj.type == "CAMERA" for obj in bpy.data.objects)
    for strength in (0.0, 2.5):
        assert bpy.ops.scope.smooth(strength=strength) == {"FINISHED"}
    assert bpy.ops.scope.export(filepath=str(amass.with_name("again.npz")), format="NPZ") == {
        "FINISHED"
    }


def test_the_scenes_frame_rate_is_set_on_request(amass):
    # dropped into a viewport
    bpy.ops.scope.import_motion("INVOKE_DEFAULT", filepath=str(amass), set_rate=True)
    assert bpy.context.scene.render.fps == 120
    assert not any(
        "frames/s" in warning.text for warning in bpy.context.scene.scope.result.warnings
    )


def test_our_own_file_has_its_camera_and_footage(footage):
    own = motion_of(walk(1.0))
    own.source = footage.name
    own.save(footage.with_name("own.npz"))
    bpy.ops.scope.import_motion(filepath=str(footage.with_name("own.npz")), set_rate=True)
    camera = next(obj for obj in bpy.data.objects if obj.type == "CAMERA")
    assert len(camera.data.background_images) == 1
    assert bpy.context.scene.scope.result.footage == str(footage)
    assert len(bpy.context.scene.scope.result.warnings) == 0


def test_a_footage_name_that_no_file_can_have_is_no_footage(tmp_path):
    replace(motion_of(walk(0.3)), source="x" * 300 + ".mp4").save(tmp_path / "own.npz")
    assert bpy.ops.scope.import_motion(filepath=str(tmp_path / "own.npz")) == {"FINISHED"}


def test_a_file_of_several_cameras_brings_all_with_the_footage_beside_it(footage):
    own = replace(motion_of(walk(0.3)), source=footage.name)
    sources = np.array([f"second{footage.suffix}", "gone.mp4"])
    own = replace(own, views=made_views(0.5, -0.2) | {"view_sources": sources})
    shutil.copy(footage, footage.with_name(str(sources[0])))
    own.save(footage.with_name("own.npz"))
    bpy.ops.scope.import_motion(filepath=str(footage.with_name("own.npz")))
    shown = [
        [background.image.name for background in camera.data.background_images]
        for camera in cameras_of(bpy.context.scene)
    ]
    assert shown == [[footage.name], [str(sources[0])], []]


def test_several_files_become_several_captures(amass, tmp_path):
    MOTION.save(tmp_path / "own.npz")
    files = [{"name": "own.npz"}, {"name": amass.name}]
    assert bpy.ops.scope.import_motion(directory=str(tmp_path), files=files) == {"FINISHED"}
    assert {c.name for c in bpy.data.collections if "scope_capture" in c} == {"own", "walk_poses"}


@pytest.mark.parametrize("what", ["missing", "empty", "text", "pickled", "nan", "body", "folder"])
def test_a_file_that_cannot_be_used_changes_nothing(amass, tmp_path, what):
    bad = tmp_path / "bad.npz"
    if what in ("empty", "text"):
        bad.write_bytes(b"" if what == "empty" else b"poses" * 99)
    elif what == "pickled":
        np.savez(bad, poses=np.array([{}], object))
    elif what == "nan":
        np.savez(bad, poses=MOTION.poses * np.nan)
    before = inventory()
    arguments = {"directory": str(tmp_path), "files": [{"name": amass.name}, {"name": "bad.npz"}]}
    if what in ("body", "folder"):
        arguments = (
            {"filepath": str(tmp_path)}
            if what == "folder"
            else {"filepath": str(amass), "body": "FILE"}
        )
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.scope.import_motion(**arguments)
    assert "Traceback" not in str(caught.value)
    assert inventory() == before
