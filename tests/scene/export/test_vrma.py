# SPDX-License-Identifier: GPL-3.0-or-later
"""VRM animations: the fields that the specification requires, and the motion that Blender reads."""

import shutil
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from scope.scope_addon.retarget.rig_source import check_gltf
from scope.scope_addon.scene.export.without_scene import write_without_scene
from scope.solver import load_body

from ..exported import glb_values, read_glb

# Of VRM 1.0's humanoid; its other bones may be left out.
REQUIRED = ["hips", "spine", "head"] + [
    f"{side}{part}"
    for side in ("left", "right")
    for part in ("UpperLeg", "LowerLeg", "Foot", "UpperArm", "LowerArm", "Hand")
]
JOINTS = {"hips": "pelvis", "head": "head", "leftHand": "left_wrist", "rightFoot": "right_ankle"}
JOINTS |= {"leftLowerLeg": "left_knee", "rightLowerArm": "right_elbow", "upperChest": "spine3"}


def written(motion, body, folder: Path) -> Path:
    (path,) = write_without_scene(folder / "walk.vrma", [motion], [body])
    return path


@pytest.mark.parametrize("name", ["scope", "scope_h"])
def test_the_fields_of_the_specification(make_motion, tmp_path, name):
    body = load_body(name)
    gltf, _ = read_glb(written(make_motion(body, 5), body, tmp_path))
    extension = gltf["extensions"]["VRMC_vrm_animation"]
    assert gltf["extensionsUsed"] == ["VRMC_vrm_animation"]
    assert extension["specVersion"] == "1.0"
    bones = extension["humanoid"]["humanBones"]
    assert set(REQUIRED) <= bones.keys()
    assert len({bone["node"] for bone in bones.values()}) == len(bones) == len(gltf["nodes"])
    assert ("leftThumbMetacarpal" in bones) == ("leftLittleDistal" in bones) == (name == "scope_h")
    for channel in gltf["animations"][0]["channels"]:
        target = channel["target"]
        assert target["path"] == "rotation" or target["node"] == bones["hips"]["node"]
    hips = gltf["nodes"][bones["hips"]["node"]]
    assert 0.7 < hips["translation"][1] < 1.2


def test_blender_reads_the_motion(body, make_motion, joints_world, tmp_path):
    motion = make_motion(body, 6)
    path = written(motion, body, tmp_path)
    copy = tmp_path / "walk.glb"
    shutil.copy(path, copy)
    check_gltf(copy)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = 30
    bpy.ops.import_scene.gltf(filepath=str(copy))
    wanted = joints_world(motion)
    for row in range(len(motion)):
        bpy.context.scene.frame_set(row)
        bpy.context.view_layer.update()
        for node, joint in JOINTS.items():
            place = bpy.data.objects[node].matrix_world.translation
            np.testing.assert_allclose(place, wanted[row, body.joint_names.index(joint)], atol=1e-4)


def test_times_are_those_of_the_frames_and_begin_at_zero(body, make_motion, tmp_path):
    motion = make_motion(body, 4)
    motion = replace(motion, timestamps=np.array([2.0, 2.1, 2.25, 2.3]))
    gltf, binary = read_glb(written(motion, body, tmp_path))
    assert gltf["buffers"] == [{"byteLength": len(binary)}]
    samplers = gltf["animations"][0]["samplers"]
    accessor = gltf["accessors"][samplers[0]["input"]]
    times = glb_values(gltf, binary, samplers[0]["input"])
    np.testing.assert_allclose(times, [0.0, 0.1, 0.25, 0.3], atol=1e-6)
    assert accessor["min"] == [0.0]
    assert accessor["max"] == [pytest.approx(0.3)]
    for rotation in samplers[1:]:
        quaternions = glb_values(gltf, binary, rotation["output"]).reshape(4, 4)
        np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1.0, atol=1e-6)
        assert ((quaternions[1:] * quaternions[:-1]).sum(axis=1) >= 0.0).all()


def test_somebody_who_enters_later_begins_to_move_later(body, make_motion, tmp_path):
    motion = make_motion(body, 4)
    motion = replace(motion, timestamps=motion.timestamps + 2.0)
    late = replace(motion, timestamps=motion.timestamps + 5.0)
    paths = write_without_scene(tmp_path / "walk.vrma", [late, motion], [body] * 2)
    for path, begins in zip(paths, (5.0, 0.0), strict=True):
        gltf, _ = read_glb(path)
        times = gltf["accessors"][gltf["animations"][0]["samplers"][0]["input"]]
        assert (times["min"], times["max"]) == ([begins], [pytest.approx(begins + 0.1)])
