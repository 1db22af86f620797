# SPDX-License-Identifier: GPL-3.0-or-later
"""BVH: axes, units and offsets, read from the text."""

import numpy as np
import pytest
from scope.scope_addon.errors import UsageError
from scope.scope_addon.scene.export.export import ExportOptions, export_motions
from scope.scope_addon.scene.rigs.rig_export import export_rig

from ..exported import read_back
from ..made_rigs import build_rig


@pytest.mark.parametrize(("unit", "per_metre"), [(None, 100.0), ("cm", 100.0), ("m", 1.0)])
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
