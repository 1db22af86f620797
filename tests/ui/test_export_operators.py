# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators act on where a capture is linked from another file under the same names."""

import os
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import pytest
from scope.scope_addon.capture.camera.calibration import calibration_text
from scope.scope_addon.capture_report import Report
from scope.scope_addon.errors import UsageError
from scope.scope_addon.scene.build import BuildOptions
from scope.scope_addon.scene.visibility import hide
from scope.scope_addon.ui import export_operators
from scope.scope_addon.ui.capture_job import build_capture
from scope.scope_addon.ui.captured_person import PERSON, captured_armature
from scope.scope_addon.ui.export_operators import SCOPE_OT_export, unused_path
from scope.scope_addon.ui.live_job import live_rig
from scope.solver.body_file import load_body

from ..edit.walking import motion_of, walk
from ..made_motion import made_views
from ..scene.made_rigs import build_rig, captured, captured_with


@pytest.fixture
def both(tmp_path):
    """The armatures of a capture of this file, and of the same one linked from another file."""
    own = captured_with(motion_of(walk(1.0)))
    collection = own.users_collection[0]
    bpy.data.libraries.write(str(tmp_path / "läuferin.blend"), {collection})
    with bpy.data.libraries.load(str(tmp_path / "läuferin.blend"), link=True) as (_, there):
        there.collections = [collection.name]
    bpy.context.scene.collection.children.link(there.collections[0])
    linked = next(obj for obj in there.collections[0].objects if obj.type == "ARMATURE")
    assert linked.name == own.name
    return own, linked


@pytest.mark.parametrize("which", [0, 1])
def test_only_the_active_capture_is_written(both, tmp_path, which):
    bpy.context.view_layer.objects.active = both[which]
    (tmp_path / "out").mkdir()
    bpy.ops.scope.export(filepath=str(tmp_path / "out" / "é ☃.npz"), format="NPZ", which="ACTIVE")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["é ☃.npz"]


@pytest.mark.parametrize("name", ["a.npz", "a.BVH", "a.trc", "a.glb"])
def test_the_suffix_that_is_typed_decides_the_format(tmp_path, name):
    captured_with(motion_of(walk(0.2)))
    (tmp_path / "out").mkdir()
    bpy.ops.scope.export(filepath=str(tmp_path / "out" / name))
    (path,) = (tmp_path / "out").iterdir()
    assert path.name == name
    starts = {".npz": b"PK", ".bvh": b"HIERARCHY", ".trc": b"PathFileType", ".glb": b"glTF"}
    assert path.read_bytes().startswith(starts[path.suffix.lower()])


@pytest.mark.parametrize(
    ("typed", "path", "form"),
    [
        *[("/a/walk.fbx", "/a/walk.fbx", "FBX"), ("/a/walk.GLB", "/a/walk.GLB", "GLB")],
        *[("/a/walk", "/a/walk.glb", "GLB"), ("/a/walk.v2", "/a/walk.v2.glb", "GLB")],
    ],
)
def test_the_file_browser_keeps_the_suffix_of_another_format_that_is_typed(typed, path, form):
    browsed = SimpleNamespace(filepath=typed, format="GLB")
    browsed.suffix = lambda: SCOPE_OT_export.suffix(browsed)
    assert SCOPE_OT_export.check(browsed, None) == (typed != path or form != "GLB")
    assert (browsed.filepath, browsed.format) == (path, form)


def test_a_dot_in_a_name_is_no_format_and_formats_of_the_command_line_are_refused(tmp_path):
    captured_with(motion_of(walk(0.2)))
    (tmp_path / "out").mkdir()
    with pytest.raises(RuntimeError, match=r"annot write 'a\.blend': its suffix must be one of"):
        bpy.ops.scope.export(filepath=str(tmp_path / "out" / "a.blend"), format="NPZ")
    bpy.ops.scope.export(filepath=str(tmp_path / "out" / "walk.v2"), format="NPZ")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["walk.v2.npz"]


@pytest.mark.parametrize("which", [0, 1])
def test_the_person_of_the_selected_capture_is_found(both, which):
    bpy.context.view_layer.objects.active = None
    bpy.context.scene.scope.capture = both[which].users_collection[0]
    assert captured_armature(bpy.context) == both[which]


@pytest.mark.skipif(os.name == "nt" or sys.platform == "darwin", reason="names there are Unicode")
def test_a_file_whose_name_is_not_utf8_is_written_and_reported(tmp_path, capfd):
    captured_with(motion_of(walk(1.0)))
    name = os.fsdecode(b"l\xe4ufer.npz")
    assert bpy.ops.scope.export(filepath=str(tmp_path / name), format="NPZ") == {"FINISHED"}
    assert (tmp_path / name).is_file()
    assert "Wrote l\ufffdufer.npz" in capfd.readouterr().out


def test_what_a_file_cannot_show_is_reported_last(tmp_path, capfd):
    """Blender's status bar shows the last report alone."""
    captured(motion_of(walk(0.1)))
    rig, _ = build_rig("mixamo")
    bpy.ops.mesh.primitive_cube_add()
    skin = bpy.context.object
    skin.modifiers.new("Lattice", "LATTICE")
    skin.modifiers.new("Armature", "ARMATURE").object = skin.parent = rig
    bpy.context.scene.scope_retarget.rig = rig
    bpy.ops.scope.export(filepath=str(tmp_path / "a.fbx"), format="FBX", which="RIG")
    printed = capfd.readouterr().out
    assert printed.index("Info: Wrote a.fbx") < printed.index("Warning: a.fbx does not show 'Cube'")


@pytest.mark.parametrize("which", [0, 1])
def test_the_person_of_a_rig_is_found(both, which):
    rig = bpy.data.objects.new("rig", None)
    bpy.context.scene.collection.objects.link(rig)
    rig[PERSON] = both[which]
    bpy.context.view_layer.objects.active = rig
    assert captured_armature(bpy.context) == both[which]


@pytest.mark.parametrize("which", [0, 1])
def test_what_the_view_layer_excludes_is_not_taken_for_the_other(both, which):
    context = bpy.context
    (excluded, shown) = both if which == 0 else both[::-1]
    layers = context.view_layer.layer_collection.children
    next(each for each in layers if each.collection == excluded.users_collection[0]).exclude = True
    context.view_layer.update()
    context.view_layer.objects.active = shown
    shown.select_set(True)
    hide(excluded, context.view_layer)
    assert not shown.hide_get()
    context.scene.scope.capture_index = list(bpy.data.collections).index(
        excluded.users_collection[0]
    )
    assert context.view_layer.objects.active == shown
    assert shown.select_get()
    context.scene.scope_retarget.rig = excluded
    assert not bpy.ops.scope.retarget.poll()
    with pytest.raises(UsageError, match="no rig of this scene's view layer is chosen"):
        live_rig(context.scene, load_body("scope"))


@pytest.mark.parametrize(
    ("which", "people", "left"),
    [("SHOWN", 1, (1, 2, 3)), ("SHOWN", 2, (3,)), ("RIG", 2, (1, 2, 3))],
)
def test_files_of_an_earlier_number_of_people_stay_and_are_named(
    standing, tmp_path, capfd, which, people, left
):
    scene = bpy.context.scene
    contents = [(tmp_path / f"{k}.npz", standing.to_bytes()) for k in range(people)]
    result = build_capture(scene, contents, "scope", "", Report(), BuildOptions())
    scene.scope_retarget.rig = result.people[0].armature
    for number in (1, 2, 3):
        (tmp_path / f"walk.person{number}.bvh").write_text("earlier")
    bpy.ops.scope.export(filepath=str(tmp_path / "walk.bvh"), format="BVH", which=which)
    names = ", ".join(f"'walk.person{number}.bvh'" for number in left)
    assert f"not part of this result: {names}; remove" in capfd.readouterr().out
    for number in left:
        assert (tmp_path / f"walk.person{number}.bvh").read_text("utf-8") == "earlier"


def test_no_name_is_proposed_of_which_there_are_files_of_several_people(tmp_path, monkeypatch):
    """The file browser does not ask before they are replaced."""
    capture = captured_with(motion_of(walk(0.1))).users_collection[0]
    capture.name = "walk"
    bpy.context.scene.scope.capture = capture
    monkeypatch.setattr(export_operators.Path, "home", lambda: tmp_path)
    operator = SimpleNamespace(suffix=lambda: ".npz")
    context = MagicMock(scene=bpy.context.scene)

    def proposed():
        SCOPE_OT_export.invoke(operator, context, None)
        return Path(operator.filepath).name

    assert proposed() == "walk.npz"
    (tmp_path / "walk.npz").write_text("earlier")
    assert proposed() == "walk.npz"  # of which the browser asks
    (tmp_path / "walk.person1.npz").write_text("earlier")
    assert proposed() == "walk_2.npz"


def test_two_blenders_that_write_files_of_lists_to_one_folder_take_different_names(
    tmp_path, monkeypatch
):
    capture = captured_with(motion_of(walk(0.1))).users_collection[0]
    capture.name = "walk"
    (tmp_path / "walk.person3.npz").write_text("mine")
    (tmp_path / ".walk_2.npz.lock").mkdir()  # no lock of ours
    with (
        unused_path(tmp_path, capture, "NPZ") as own,
        unused_path(tmp_path, capture, "NPZ") as others,
        unused_path(tmp_path, capture, "TRC") as markers,
    ):
        assert [own.name, others.name, markers.name] == ["walk_3.npz", "walk_4.npz", "walk.trc"]
        own.write_text("own")
    with unused_path(tmp_path, capture, "NPZ") as later:
        assert later.name == "walk_4.npz"
    with monkeypatch.context() as patch:  # where all files are another user's
        patch.setattr(os, "geteuid", lambda: os.stat(tmp_path).st_uid + 1)
        with unused_path(tmp_path, capture, "NPZ") as path:
            assert path.name == "walk_4.npz"
    left = [".walk_2.npz.lock", "walk.person3.npz", "walk_3.npz"]
    assert sorted(path.name for path in tmp_path.iterdir()) == left


def test_the_cameras_of_a_capture_are_saved_as_a_calibration(standing, tmp_path):
    scene = bpy.context.scene
    motion = replace(standing, views=made_views(0.5))
    build_capture(
        scene, [(tmp_path / "a.npz", motion.to_bytes())], "scope", "", Report(), BuildOptions()
    )
    path = tmp_path / "found.toml"
    assert bpy.ops.scope.save_calibration(filepath=str(path)) == {"FINISHED"}
    assert path.read_text("utf-8") == calibration_text(motion)
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.scope.save_calibration(filepath=str(tmp_path / "none" / "found.toml"))
    mirrored = replace(motion, footage_mirrored=True).to_bytes()
    build_capture(scene, [(tmp_path / "b.npz", mirrored)], "scope", "", Report(), BuildOptions())
    with pytest.raises(RuntimeError, match="was mirrored"):
        bpy.ops.scope.save_calibration(filepath=str(tmp_path / "b.toml"))
    assert sorted(each.name for each in tmp_path.glob("*.toml")) == ["found.toml"]


def test_one_camera_has_no_calibration_to_save(standing, tmp_path):
    content = [(tmp_path / "a.npz", standing.to_bytes())]
    build_capture(bpy.context.scene, content, "scope", "", Report(), BuildOptions())
    assert not bpy.ops.scope.save_calibration.poll()
