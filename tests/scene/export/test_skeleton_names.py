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

from ...edit.walking import BODY, NAMES, motion_of, walk
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


@pytest.mark.parametrize("skeleton", DOCUMENTED)
@pytest.mark.parametrize("suffix", [".glb", ".bvh"])
def test_an_exported_skeleton_has_known_names_and_the_captured_motion(tmp_path, skeleton, suffix):
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = 30
    built = build_scene([MOTION], BODY, None, BuildOptions(start_frame=1.0))
    (path,) = export(
        tmp_path / f"out{suffix}", [built.collection], options=ExportOptions(skeleton=skeleton)
    )
    bones = built.people[0].armature.data.bones
    assert {bone.name for bone in bones} == set(NAMES)  # Of the capture itself, as before.
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = 30
    if suffix == ".bvh":
        names = path.read_text().split()
        assert {name.replace(" ", "_") for name in DOCUMENTED[skeleton]} <= set(names)
        return
    with formats.quiet():
        bpy.ops.import_scene.gltf(filepath=str(path))
    (rig,) = (each for each in bpy.context.scene.objects if each.type == "ARMATURE")
    assert set(rig.data.bones.keys()) >= DOCUMENTED[skeleton]
    bone_map = guess_bone_map(rig)
    for part in ("pelvis", "left_knee", "right_wrist", "head"):
        at = seen(rig, [bone_map.bone(part)], [0, 8])[:, 0]
        np.testing.assert_allclose(at, truth(MOTION)[[0, 8], NAMES.index(part)], atol=2e-3)


def test_an_unknown_skeleton_is_refused():
    with pytest.raises(UsageError, match="skeleton must be one of scope, mixamo"):
        ExportOptions(skeleton="biped")
