# SPDX-License-Identifier: GPL-3.0-or-later
"""VRM animations: the fields that the specification requires, and the motion that Blender reads."""

import json
import shutil
import struct
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from scope.scope_addon.retarget.rig_source import check_gltf
from scope.scope_addon.scene.export.without_scene import write_without_scene
from scope.solver import load_body

# Of VRM 1.0's humanoid; its other bones may be left out.
REQUIRED = ["hips", "spine", "head"] + [
    f"{side}{part}"
    for side in ("left", "right")
    for part in ("UpperLeg", "LowerLeg", "Foot", "UpperArm", "LowerArm", "Hand")
]
JOINTS = {"hips": "pelvis", "head": "head", "leftHand": "left_wrist", "rightFoot": "right_ankle"}
JOINTS |= {"leftLowerLeg": "left_knee", "rightLowerArm": "right_elbow", "upperChest": "spine3"}


def written(motion, body, folder: Path) -> tuple[Path, dict, bytes]:
    (path,) = write_without_scene(folder / "walk.vrma", [motion], [body])
    return (path, *read(path))


def read(path: Path) -> tuple[dict, bytes]:
    """Return the description and the binary part of a file."""
    content = path.read_bytes()
    magic, version, length, json_bytes, kind = struct.unpack_from("<4sIII4s", content)
    assert (magic, version, length, kind) == (b"glTF", 2, len(content), b"JSON")
    gltf = json.loads(content[20 : 20 + json_bytes])
    binary_bytes, kind = struct.unpack_from("<I4s", content, 20 + json_bytes)
    binary = content[28 + json_bytes :]
    assert kind == b"BIN\0"
    assert binary_bytes == len(binary) == gltf["buffers"][0]["byteLength"]
    return gltf, binary


@pytest.mark.parametrize("name", ["scope", "scope_h"])
def test_the_fields_of_the_specification(make_motion, tmp_path, name):
    body = load_body(name)
    _, gltf, _ = written(make_motion(body, 5), body, tmp_path)
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
    path, _, _ = written(motion, body, tmp_path)
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
    _, gltf, binary = written(motion, body, tmp_path)
    accessor = gltf["accessors"][gltf["animations"][0]["samplers"][0]["input"]]
    view = gltf["bufferViews"][accessor["bufferView"]]
    times = np.frombuffer(binary, "<f4", accessor["count"], view["byteOffset"])
    np.testing.assert_allclose(times, [0.0, 0.1, 0.25, 0.3], atol=1e-6)
    assert accessor["min"] == [0.0]
    assert accessor["max"] == [pytest.approx(0.3)]
    for rotation in gltf["animations"][0]["samplers"][1:]:
        turns = gltf["accessors"][rotation["output"]]
        start = gltf["bufferViews"][turns["bufferView"]]["byteOffset"]
        quaternions = np.frombuffer(binary, "<f4", 16, start).reshape(4, 4)
        np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1.0, atol=1e-6)
        assert ((quaternions[1:] * quaternions[:-1]).sum(axis=1) >= 0.0).all()


def test_somebody_who_enters_later_begins_to_move_later(body, make_motion, tmp_path):
    motion = make_motion(body, 4)
    motion = replace(motion, timestamps=motion.timestamps + 2.0)
    late = replace(motion, timestamps=motion.timestamps + 5.0)
    paths = write_without_scene(tmp_path / "walk.vrma", [late, motion], [body] * 2)
    for path, begins in zip(paths, (5.0, 0.0), strict=True):
        gltf, _ = read(path)
        times = gltf["accessors"][gltf["animations"][0]["samplers"][0]["input"]]
        assert (times["min"], times["max"]) == ([begins], [pytest.approx(begins + 0.1)])
