# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures with the bones of other skeletons: the same motion, and names that tools know."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from scope.scope_addon.errors import UsageError
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.scene.export import formats
from scope.scope_addon.scene.export.export import ExportOptions, export
from scope.scope_addon.scene.rig_retarget import guess_bone_map

from ...edit.walking import NAMES, motion_of, walk
from ..made_rigs import seen, truth

# As Mixamo, Unreal, VRM and Unity document them.
DOCUMENTED = {
    "mixamo": {"mixamorig:Hips", "mixamorig:Spine2", "mixamorig:LeftUpLeg",
               "mixamorig:RightForeArm"},
    "ue5": {"pelvis", "spine_03", "thigh_l", "lowerarm_r", "ball_l"},
    "vrm": {"hips", "upperChest", "leftUpperLeg", "rightLowerArm", "leftToes"},
    "unity": {"Hips", "UpperChest", "LeftUpperLeg", "RightLowerArm", "LeftToes"},
}  # fmt: skip
MOTION = motion_of(walk(0.5))


def export_as(skeleton, body, path):
    """Write a capture with the names of a skeleton."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = 30
    built = build_scene([MOTION], body, None, BuildOptions(start_frame=1.0))
    export(path, [built.collection], options=ExportOptions(skeleton=skeleton))
    bones = built.people[0].armature.data.bones
    assert {bone.name for bone in bones} == set(NAMES)  # Of the capture itself, as before.


def test_the_bones_of_an_exported_skeleton_have_known_names(body, tmp_path):
    for skeleton, documented in DOCUMENTED.items():
        export_as(skeleton, body, tmp_path / "out.bvh")
        assert documented <= set((tmp_path / "out.bvh").read_text().split())


def test_an_exported_skeleton_has_the_captured_motion(body, tmp_path):
    export_as("ue5", body, tmp_path / "out.glb")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = 30
    with formats.quiet():
        bpy.ops.import_scene.gltf(filepath=str(tmp_path / "out.glb"))
    (rig,) = (each for each in bpy.context.scene.objects if each.type == "ARMATURE")
    assert set(rig.data.bones.keys()) >= DOCUMENTED["ue5"]
    bone_map = guess_bone_map(rig)
    for part in ("pelvis", "left_knee", "right_wrist", "head"):
        at = seen(rig, [bone_map.bone(part)], [0, 8])[:, 0]
        np.testing.assert_allclose(at, truth(MOTION)[[0, 8], NAMES.index(part)], atol=2e-3)


def test_an_unknown_skeleton_is_refused():
    with pytest.raises(UsageError, match="skeleton must be one of scope, mixamo"):
        ExportOptions(skeleton="biped")
