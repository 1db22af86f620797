# SPDX-License-Identifier: GPL-3.0-or-later
"""A .blend file that carries its motions: saved, appended, linked, duplicated, renamed, deleted,
undone, hostile.

Nothing is added to a scene that is linked from another file.
"""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import bpy
import numpy as np
import pytest
import scope
from scope.scope_addon.errors import MotionFileError, UsageError
from scope.scope_addon.motion import Motion
from scope.scope_addon.scene import packed_motion
from scope.scope_addon.scene.build import build_scene
from scope.scope_addon.scene.export.export import export_motions
from scope.scope_addon.scene.footage_strip import add_footage_strips
from scope.scope_addon.scene.packed_motion import MOTION, pack_motion, stored_motion
from scope.scope_addon.scene.transaction import all_or_nothing

from .conftest import dance


@pytest.fixture(scope="module")
def motions(body):
    return [dance(body), dance(body, count=7)]


@pytest.fixture
def people(motions):
    """Two armatures, each with a motion."""
    found = []
    for motion in motions:
        armature = bpy.data.objects.new("person", bpy.data.armatures.new("person"))
        bpy.context.scene.collection.objects.link(armature)
        pack_motion(armature, motion.to_bytes())
        found.append((armature, motion))
    return found


def assert_same(got: Motion, expected: Motion) -> None:
    for name, value in vars(expected).items():
        np.testing.assert_array_equal(getattr(got, name), value, err_msg=name)


def saved(tmp_path) -> str:
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return path


def load(path, names, *, link):
    with bpy.data.libraries.load(path, link=link) as (_, wanted):
        wanted.objects = list(names)
    return wanted.objects


def test_everyone_has_their_own_motion_after_saving_and_opening(people, tmp_path):
    expected = {armature.name: motion for armature, motion in people}
    bpy.ops.wm.open_mainfile(filepath=saved(tmp_path))
    assert len(bpy.data.texts) == len(expected) == 2
    for name, motion in expected.items():
        assert_same(stored_motion(bpy.data.objects[name]), motion)


@pytest.mark.parametrize("link", [False, True])
def test_append_and_link_bring_the_motion_along(people, tmp_path, link):
    armature, motion = people[0]
    name = armature.name
    (got,) = load(saved(tmp_path), [name], link=link)
    assert (got.library is not None) == link
    assert_same(stored_motion(got), motion)


def test_a_library_override_reads_the_motion_of_its_library(people, tmp_path):
    name = people[0][0].name
    motion = people[0][1]
    (linked,) = load(saved(tmp_path), [name], link=True)
    override = linked.override_create()
    assert override.override_library is not None
    assert_same(stored_motion(override), motion)


def test_duplicates_share_the_motion_and_keep_it(people, tmp_path):
    armature, motion = people[0]
    copy = armature.copy()
    bpy.context.scene.collection.objects.link(copy)
    assert len(bpy.data.texts) == 2
    armature.name = "renamed"
    copy.name = "copied"
    assert_same(stored_motion(copy), motion)
    pack_motion(armature, people[1][1].to_bytes())
    assert_same(stored_motion(copy), motion)
    assert_same(stored_motion(armature), people[1][1])
    bpy.data.objects.remove(armature)
    bpy.ops.wm.open_mainfile(filepath=saved(tmp_path))
    assert_same(stored_motion(bpy.data.objects["copied"]), motion)


def test_the_motion_is_deleted_with_the_last_armature(people, tmp_path):
    for armature, _ in people:
        bpy.data.objects.remove(armature)
    bpy.ops.wm.open_mainfile(filepath=saved(tmp_path))
    assert len(bpy.data.texts) == 0


def test_the_former_motion_is_not_saved(people, tmp_path):
    armature = people[0][0]
    motion = people[1][1]
    name = armature.name
    pack_motion(armature, motion.to_bytes())
    bpy.ops.wm.open_mainfile(filepath=saved(tmp_path))
    assert len(bpy.data.texts) == 2
    assert_same(stored_motion(bpy.data.objects[name]), motion)


def test_an_operator_that_fails_restores_the_former_motion(people):
    armature, motion = people[0]

    def fail() -> None:
        with all_or_nothing(bpy.context.scene, armature):
            pack_motion(armature, people[1][1].to_bytes())
            raise UsageError("no")

    with pytest.raises(UsageError, match="no"):
        fail()
    assert_same(stored_motion(armature), motion)
    assert len(bpy.data.texts) == 2


def test_undo_restores_the_former_motion(people):
    name = people[0][0].name
    motion = people[0][1]
    other = people[1][1]
    bpy.ops.ed.undo_push(message="before")
    pack_motion(bpy.data.objects[name], other.to_bytes())
    bpy.ops.ed.undo_push(message="after")
    bpy.ops.ed.undo()
    assert_same(stored_motion(bpy.data.objects[name]), motion)
    bpy.ops.ed.redo()
    assert_same(stored_motion(bpy.data.objects[name]), other)


def test_a_blend_file_from_the_shell_carries_its_motion(body, tmp_path):
    motion = dance(body)
    export_motions([motion], body, [tmp_path / "walk.blend", tmp_path / "walk.glb"])
    assert len(bpy.data.texts) == 0
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "walk.blend"))
    armature = next(obj for obj in bpy.data.objects if "scope_source" in obj)
    assert_same(stored_motion(armature), motion)


def bomb() -> bytes:
    """An archive that claims to unpack to more than memory holds."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        header = (
            b"\x93NUMPY\x01\x00\x76\x00"
            + b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"
        )
        archive.writestr("poses.npy", header.ljust(127) + b"\n")
    return file.getvalue()


def pickled() -> bytes:
    file = io.BytesIO()
    np.savez(file, poses=np.array([{}], object))
    return file.getvalue()


def test_hostile_content_is_an_error(people):
    armature = people[0][0]
    damaged = (b"", b"PK\x03\x04 no zip", bomb(), pickled())
    for content in (*damaged, "text", 7, [1, 2], {"a": 1}):
        armature[MOTION]["motion"] = content
        with pytest.raises(MotionFileError, match=f"text '{armature.name} motion'"):
            stored_motion(armature)


def test_a_motion_that_is_too_large_is_refused_before_it_is_read(people, monkeypatch):
    armature = people[0][0]
    stored = armature[MOTION]["motion"]
    monkeypatch.setattr(packed_motion, "_LARGEST_BYTES", len(stored))
    assert len(stored_motion(armature)) > 0
    monkeypatch.setattr(packed_motion, "_LARGEST_BYTES", len(stored) - 1)
    with pytest.raises(MotionFileError, match="too much for a motion"):
        stored_motion(armature)


def test_a_removed_text_is_an_error(people):
    armature = people[0][0]
    bpy.data.texts.remove(armature[MOTION])
    with pytest.raises(UsageError, match="import its .npz file"):
        stored_motion(armature)


def test_an_armature_without_a_motion_is_an_error(people, tmp_path):
    """A path of a .blend file of others is none: it may name any file."""
    people[0][1].save(tmp_path / "person1.npz")
    armature = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    with pytest.raises(UsageError, match="capture the footage again"):
        stored_motion(armature)
    for value in (5, [1.0, 2.0], str(tmp_path / "person1.npz")):
        armature[MOTION] = value
        with pytest.raises(UsageError, match="is not stored in"):
            stored_motion(armature)


SAMPLE = Path(scope.__file__).resolve().parent / "assets" / "sample" / "sample.mp4"


@pytest.fixture
def linked(tmp_path):
    """A scene of another file, shown in the window."""
    path = str(tmp_path / "other.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    with bpy.data.libraries.load(path, link=True) as (there, here):
        here.scenes = list(there.scenes)
    bpy.context.window.scene = here.scenes[0]
    return here.scenes[0]


def test_a_motion_is_not_built_in_a_linked_scene(linked, body, make_motion):
    before = [len(blocks) for blocks in (bpy.data.objects, bpy.data.collections, bpy.data.actions)]
    with pytest.raises(UsageError, match=r"the scene is linked from .*other\.blend"):
        build_scene([make_motion(body, 12)], body)
    assert [
        len(blocks) for blocks in (bpy.data.objects, bpy.data.collections, bpy.data.actions)
    ] == before


def test_no_strip_is_added_to_a_linked_scene(linked):
    with pytest.raises(UsageError, match=r"use a scene of this file"):
        add_footage_strips(linked, SAMPLE, 1.0)
