# SPDX-License-Identifier: GPL-3.0-or-later
"""FBX: no scale anywhere and no leaf bones, read by Blender's parser and importer.

The key times of a glTF file are those of the footage.

BVH: axes, units and offsets, read from the text.
"""

import numpy as np
import pytest
from scope.scope_addon.errors import UsageError
from scope.scope_addon.scene.export.export import ExportOptions, export_motions
from scope.scope_addon.scene.export.fbx_file import below
from scope.scope_addon.scene.rig_file import export_rig

from ..exported import fbx_models, fbx_objects, fbx_properties, glb_values, read_back, read_glb
from ..made_rigs import build_rig


def test_fbx_is_in_centimetres_without_any_scaling(body, make_motion, tmp_path):
    """Read with Blender's parser. Unreal interprets lengths as centimetres, whatever unit the file
    states.
    """
    path = tmp_path / "walk.fbx"
    motion = make_motion(body, 4)
    export_motions([motion], body, path, export_options=ExportOptions(camera=True))
    objects = fbx_objects(path)
    (settings,) = below(objects[b""][0], b"GlobalSettings")
    assert fbx_properties(settings)["UnitScaleFactor"] == [1.0]
    models = fbx_models(path)
    for name, values in models.items():
        np.testing.assert_allclose(
            values.get("Lcl Scaling", [1, 1, 1]), 1.0, atol=1e-4, err_msg=name
        )
    joints = body.rest_joints(motion.betas)
    knee, hip = (body.joint_names.index(f"left_{part}") for part in ("knee", "hip"))
    shin = np.linalg.norm(models["left_knee"]["Lcl Translation"])
    assert shin == pytest.approx(100 * np.linalg.norm(joints[knee] - joints[hip]), rel=1e-4)
    vertices = {
        kind: [
            np.array(next(below(node, b"Vertices")).props[0])
            for node in objects[b"Geometry"]
            if node.props[2] == kind
        ]
        for kind in (b"Mesh", b"Shape")
    }
    assert 100 < np.ptp(vertices[b"Mesh"][0].reshape(-1, 3), axis=0).max() < 250
    largest = max(np.abs(moved).max() for moved in vertices[b"Shape"])
    assert largest == pytest.approx(100 * np.abs(body.shapedirs).max(), rel=1e-3)
    poses = [node for pose in objects[b"Pose"] for node in below(pose, b"PoseNode")]
    places = [next(below(node, b"Matrix")).props[0][12:15] for node in poses]
    assert np.abs(places).max() > 50
    (camera,) = (node for node in objects[b"NodeAttribute"] if node.props[2] == b"Camera")
    assert fbx_properties(camera)["FarPlane"] == [pytest.approx(100 * 1000.0)]


@pytest.mark.parametrize("rate", [30000 / 1001, 24.449])
def test_glb_key_times_are_those_of_the_footage(body, make_motion, tmp_path, rate):
    """Read from the file itself, because Blender's importer has the same error as its exporter."""
    motion = make_motion(body, 7, rate=rate)
    path = tmp_path / "walk.glb"
    export_motions([motion], body, path, export_options=ExportOptions(camera=True))
    gltf, binary = read_glb(path)
    for index in {sampler["input"] for sampler in gltf["animations"][0]["samplers"]}:
        accessor = gltf["accessors"][index]
        times = glb_values(gltf, binary, index)
        np.testing.assert_allclose(times, motion.timestamps[: len(times)], atol=1e-6)
        assert (accessor["min"], accessor["max"]) == ([times[0]], [times[-1]])
        assert len(times) in (2, 7)  # constant shapes have their ends alone


@pytest.mark.parametrize(("unit", "per_metre"), [(None, 100.0), ("m", 1.0)])
def test_bvh_is_y_up_in_centimetres_and_one_file_a_person(
    body, make_motion, tmp_path, truth, unit, per_metre
):
    motions = [make_motion(body, 3), make_motion(body, 3, seed=1)]
    options = ExportOptions(bvh_unit=unit) if unit else None
    written, _ = export_motions(motions, body, tmp_path / "pair.bvh", export_options=options)
    assert [p.name for p in written] == ["pair.person1.bvh", "pair.person2.bvh"]
    for path, motion in zip(written, motions, strict=True):
        lines = path.read_text("utf-8").splitlines()
        start = lines.index("MOTION")
        assert lines[start + 1] == "Frames: 3"
        rows = np.array([[float(v) for v in line.split()] for line in lines[start + 3 :]])
        pelvis = truth(body, motion).joints[:, 0]
        np.testing.assert_allclose(
            rows[:, :3] / per_metre, pelvis[:, [0, 2, 1]] * [1, 1, -1], atol=1e-5
        )
        offsets = [
            [float(v) for v in line.split()[1:]]
            for line in lines[:start]
            if line.strip().startswith("OFFSET")
        ]
        joints = body.rest_joints(motion.betas)
        knee, hip = (body.joint_names.index(f"left_{part}") for part in ("knee", "hip"))
        thigh = np.linalg.norm(joints[knee] - joints[hip])
        assert np.abs(np.linalg.norm(offsets, axis=1) / per_metre - thigh).min() < 1e-4


def test_every_bone_has_a_name_of_one_word_in_any_script(tmp_path, blender):
    rig, bones = build_rig("biped")
    for part, name in (("left_elbow", "左ひじ"), ("right_elbow", "右ひじ"), ("head", "Bip01_Neck")):
        rig.data.bones[bones[part]].name = name
    rig.keyframe_insert("location", frame=1)
    (path,) = export_rig(tmp_path / "rig.bvh", rig, ExportOptions())
    lines = path.read_text("utf-8").splitlines()
    joints = [line.split() for line in lines if line.strip().startswith(("ROOT", "JOINT"))]
    assert {len(words) for words in joints} == {2}
    names = [name for _, name in joints]
    assert {"左ひじ", "右ひじ", "Bip01_L_UpperArm", "Bip01_Neck", "Bip01_Neck_"} <= set(names)
    assert len(set(names)) == len(names) == len(rig.data.bones)
    read_back(path)
    assert set(blender.only("ARMATURE").data.bones.keys()) == set(names)


def test_an_unknown_unit_of_bvh_is_an_error():
    with pytest.raises(UsageError, match="bvh_unit must be one of cm, m"):
        ExportOptions(bvh_unit="inch")
