# SPDX-License-Identifier: GPL-3.0-or-later
"""The modifiers of a rig's meshes in exported files."""

import bpy
import numpy as np
import pytest
from scope.scope_addon.scene.export.export import ExportOptions
from scope.scope_addon.scene.rig_export import export_rig

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


@pytest.mark.parametrize("suffix", [".glb", ".fbx", ".usdc"])
def test_modifiers_and_the_shape_keys_under_them_are_in_the_file(tmp_path, suffix):
    rig, skin = half_a_face("MIRROR", "SUBSURF")
    shown = [corners(skin, frame) for frame in (1, LAST)]
    counts = [len(getattr(bpy.data, kind)) for kind in ("objects", "meshes", "actions")]
    warnings = []
    export_rig(tmp_path / f"rig{suffix}", rig, ExportOptions(warn=warnings.append))
    assert warnings == []
    assert [len(getattr(bpy.data, kind)) for kind in ("objects", "meshes", "actions")] == counts
    assert (skin.data.name, skin.data.shape_keys.key_blocks.keys()) == ("Cube", ["Basis", "mouth"])
    assert all(m.show_viewport and m.show_render for m in skin.modifiers)
    first = round(read_back(tmp_path / f"rig{suffix}", RATE))
    (read,) = (obj for obj in bpy.data.objects if obj.type == "MESH")
    for vertices, frame in zip(shown, (1, LAST), strict=True):
        found = corners(read, first + frame - (0 if suffix == ".usdc" else 1))
        apart = np.linalg.norm(found[:, None] - vertices, axis=2)
        assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-4


@pytest.mark.parametrize("kind", ["DECIMATE", "LATTICE"])
def test_what_a_file_cannot_show_of_a_modifier_is_said(tmp_path, kind):
    """A decimation by 0.9 keeps other edges under the shape key; a lattice moves by itself."""
    rig, skin = half_a_face("SUBSURF", kind)
    if kind == "DECIMATE":
        skin.modifiers[kind.title()].ratio = 0.9
    warnings = []
    export_rig(tmp_path / "rig.fbx", rig, ExportOptions(warn=warnings.append))
    (warning,) = warnings
    assert str(warning).startswith("rig.fbx does not show 'Cube' as its modifiers do: ")
    assert "'Subsurf'" not in str(warning) if kind == "LATTICE" else "'Decimate'" in str(warning)
    read_back(tmp_path / "rig.fbx", RATE)
    (read,) = (obj for obj in bpy.data.objects if obj.type == "MESH")
    assert "mouth" in read.data.shape_keys.key_blocks
