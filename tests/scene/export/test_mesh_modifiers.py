# SPDX-License-Identifier: GPL-3.0-or-later
"""The modifiers of a rig's meshes in exported files."""

import bpy
import numpy as np
import pytest
from scope.scope_addon.scene.actions import Channels
from scope.scope_addon.scene.export.export import ExportOptions
from scope.scope_addon.scene.export.export import export as write
from scope.scope_addon.scene.rig_file import export_rig

from ..exported import read_back
from ..made_rigs import build_rig

RATE = 24.0
LAST = 3  # frame


def half_a_face(*modifiers):
    """Return a rig that moves, and its cube with one keyed shape key and these modifiers."""
    rig, bone_of = build_rig("mixamo")
    bpy.ops.mesh.primitive_cube_add()
    skin = bpy.context.object
    skin.vertex_groups.new(name=bone_of["pelvis"]).add(range(8), 1.0, "REPLACE")
    for kind in modifiers:
        skin.modifiers.new(kind.title(), kind)
    skin.modifiers.new("Armature", "ARMATURE").object = skin.parent = rig
    skin.data.vertices[0].co.x -= 0.2
    skin.shape_key_add(name="Basis")
    key = skin.shape_key_add(name="mouth")
    for point in list(key.data)[:2]:
        point.co.y += 1.0
    pelvis = rig.pose.bones[bone_of["pelvis"]]
    for frame, value in ((1, 0.0), (LAST, 1.0)):
        pelvis.location = (value, 0.0, 0.0)
        pelvis.keyframe_insert("location", frame=frame)
        key.value = value
        key.keyframe_insert("value", frame=frame)
    return rig, skin


def corners(obj, frame):
    """Return the vertices (V, 3) of an object at a frame, world frame."""
    bpy.context.scene.frame_set(frame)
    evaluated = obj.evaluated_get(bpy.context.evaluated_depsgraph_get())
    return np.array([evaluated.matrix_world @ v.co for v in evaluated.to_mesh().vertices])


def export(path, rig):
    """Export a rig; return the warnings."""
    warnings = []
    export_rig(path, rig, ExportOptions(warn=warnings.append))
    return [str(warning) for warning in warnings]


def assert_shows(path, shown):
    """Check that the mesh in a file has these vertices at the first and the last frame; return
    it.
    """
    first = round(read_back(path, RATE))
    (read,) = (obj for obj in bpy.data.objects if obj.type == "MESH")
    for vertices, frame in zip(shown, (1, LAST), strict=True):
        found = corners(read, first + frame - (0 if path.suffix == ".usdc" else 1))
        apart = np.linalg.norm(found[:, None] - vertices, axis=2)
        assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-4
    return read.data


@pytest.mark.parametrize("suffix", [".glb", ".fbx", ".usdc"])
def test_modifiers_and_the_shape_keys_under_them_are_in_the_file(tmp_path, suffix):
    rig, skin = half_a_face("MIRROR", "SUBSURF")
    shown = [corners(skin, frame) for frame in (1, LAST)]
    counts = [len(getattr(bpy.data, kind)) for kind in ("objects", "meshes", "actions")]
    assert export(tmp_path / f"rig{suffix}", rig) == []
    assert [len(getattr(bpy.data, kind)) for kind in ("objects", "meshes", "actions")] == counts
    assert (skin.data.name, skin.data.shape_keys.key_blocks.keys()) == ("Cube", ["Basis", "mouth"])
    assert all(m.show_viewport and m.show_render for m in skin.modifiers)
    assert_shows(tmp_path / f"rig{suffix}", shown)


def test_a_modifier_that_moves_by_itself_is_said(tmp_path):
    rig, skin = half_a_face("SUBSURF", "LATTICE")
    shown = [corners(skin, frame) for frame in (1, LAST)]
    (warning,) = export(tmp_path / "rig.fbx", rig)
    assert warning.startswith("rig.fbx does not show 'Cube' as its modifiers do: 'Lattice'; ")
    assert "mouth" in assert_shows(tmp_path / "rig.fbx", shown).shape_keys.key_blocks


def test_bones_that_bend_are_said(tmp_path):
    rig, skin = half_a_face()
    skin.shape_key_clear()
    (bone,) = (b for b in rig.data.bones if b.name == skin.vertex_groups[0].name)
    bone.bbone_segments = 4
    (warning,) = export(tmp_path / "rig.fbx", rig)
    assert warning.startswith(f"rig.fbx lacks the bends of these bones of '{rig.name}'")
    assert f"'{bone.name}'" in warning
    bone.bbone_segments = 1
    assert export(tmp_path / "rig.fbx", rig) == []
    bone.bbone_segments = 4
    bone.use_deform = False
    assert export(tmp_path / "rig.fbx", rig) == []


def test_of_separate_files_each_is_said_to_lack_the_bends_of_its_own_rig(tmp_path):
    collection = bpy.data.collections.new("people")
    bpy.context.scene.collection.children.link(collection)
    rigs = []
    for _ in range(2):
        rig, skin = half_a_face()
        rig.data.bones[skin.vertex_groups[0].name].bbone_segments = 4
        collection.objects.link(rig)
        rigs.append(rig)
    said = []
    options = ExportOptions(separate=True, warn=said.append)
    written = write(tmp_path / "rig.fbx", [collection], options=options)
    of = [(note.values["file"], note.values["rig"]) for note in said]
    assert of == [(path.name, rig.name) for path, rig in zip(written, rigs, strict=True)]


def test_a_mirrored_rig_is_said_of_the_format_that_blender_shows_wrongly(tmp_path):
    rig, skin = half_a_face()
    skin.shape_key_clear()
    assert export(tmp_path / "rig.glb", rig) == []
    rig.scale.x *= -1.0
    bpy.context.view_layer.update()
    (warning,) = export(tmp_path / "rig.glb", rig)
    assert warning.startswith(f"rig.glb holds '{rig.name}' mirrored")
    assert export(tmp_path / "rig.fbx", rig) == []


def _moving(skin, how):
    """Give the skin a modifier of which the file shows one frame alone."""
    kind = "MIRROR" if how == "after the armature" else "DISPLACE"
    modifier = skin.modifiers.new("Odd", kind)
    if kind == "DISPLACE":
        skin.modifiers.move(1, 0)
    if how in ("keyed", "in the NLA"):
        for frame in (1, LAST):
            modifier.strength = 0.3 * frame
            modifier.keyframe_insert("strength", frame=frame)
    if how == "in the NLA":
        animation = skin.animation_data
        lost = 'modifiers["Odd"].a_property_of_another_kind'
        Channels(skin, animation.action).write(lost, np.arange(2.0), np.eye(2)[:, :1])
        animation.nla_tracks.new().strips.new("own", 1, animation.action)
        animation.action = None
    elif how == "driven":
        variable = modifier.driver_add("strength").driver.variables.new()
        variable.type = "TRANSFORMS"
        variable.targets[0].id = skin.parent
        variable.targets[0].bone_target = skin.vertex_groups[0].name
        skin.animation_data.drivers[0].driver.type = "SUM"


@pytest.mark.parametrize(
    ("how", "is_said"),
    [
        *[("keyed", True), ("in the NLA", True), ("driven", True), ("after the armature", True)],
        ("still", False),
    ],
)
def test_a_modifier_whose_effect_changes_with_the_motion_is_said(tmp_path, how, is_said):
    rig, skin = half_a_face()
    skin.shape_key_clear()
    _moving(skin, how)
    bpy.context.scene.frame_set(1)
    shown = [corners(skin, frame) for frame in (1, LAST)]
    warnings = export(tmp_path / "rig.fbx", rig)
    assert ["'Odd'" in each for each in warnings] == [True] * is_said
    if not is_said:
        assert_shows(tmp_path / "rig.fbx", shown)


@pytest.mark.parametrize(("suffix", "has_other_key"), [(".glb", True), (".fbx", False)])
def test_a_shape_key_with_which_modifiers_make_other_faces_is_left_out(
    tmp_path, suffix, has_other_key
):
    """The mirror merges a corner at its plane, which the key moves away."""
    rig, skin = half_a_face("MIRROR")
    blocks = skin.data.shape_keys.key_blocks
    if has_other_key:
        brow = skin.shape_key_add(name="brow", from_mix=False)
        brow.data[7].co.z += 0.5
        for frame, value in ((1, 1.0), (LAST, 0.5)):
            brow.value = value
            brow.keyframe_insert("value", frame=frame)
    for block in blocks:
        block.data[0].co.x = 0.1 if block.name == "mouth" else 0.0
    blocks["mouth"].mute = True
    shown = [corners(skin, frame) for frame in (1, LAST)]
    (warning,) = export(tmp_path / f"rig{suffix}", rig)
    assert warning.startswith(f"rig{suffix} lacks these shape keys of 'Cube', with which ")
    assert ": 'mouth'; " in warning
    keys = assert_shows(tmp_path / f"rig{suffix}", shown).shape_keys
    kept = keys.key_blocks.keys()[1:] if keys is not None else []
    assert kept == (["brow"] if has_other_key else [])


def test_a_decimated_mesh_is_written_without_a_shape_key_that_changes_its_edges(tmp_path):
    """A decimation by 0.9 keeps other edges under the shape key."""
    rig, skin = half_a_face("SUBSURF", "DECIMATE")
    skin.modifiers["Decimate"].ratio = 0.9
    skin.data.shape_keys.key_blocks["mouth"].mute = True
    shown = [corners(skin, frame) for frame in (1, LAST)]
    (warning,) = export(tmp_path / "rig.fbx", rig)
    assert ": 'mouth'; " in warning
    assert assert_shows(tmp_path / "rig.fbx", shown).shape_keys is None
