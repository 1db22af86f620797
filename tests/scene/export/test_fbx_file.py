# SPDX-License-Identifier: GPL-3.0-or-later
"""FBX: no scale anywhere and no leaf bones, read by Blender's parser and importer."""

import numpy as np
import pytest
from scope.scope_addon.scene.export.export import ExportOptions, export_motions

from ...required import package
from ..exported import read_back


def test_fbx_objects_have_unit_scale_and_no_leaf_bones(body, make_motion, tmp_path, blender):
    path = tmp_path / "walk.fbx"
    export_motions([make_motion(body, 2)], body, path)
    read_back(path)
    armature = blender.only("ARMATURE")
    assert len(armature.data.bones) == len(body.joint_names)


def test_fbx_is_in_centimetres_without_any_scaling(body, make_motion, tmp_path):
    """Read with Blender's parser. Unreal interprets lengths as centimetres, whatever unit the file
    states.
    """
    parser = package("io_scene_fbx.parse_fbx")
    path = tmp_path / "walk.fbx"
    motion = make_motion(body, 4)
    export_motions([motion], body, path, export_options=ExportOptions(camera=True))
    root, version = parser.parse(str(path))
    assert version == 7400

    def below(elem, *names):
        return [e for e in elem.elems if e.id.decode() in names]

    def properties(elem):
        return {
            p.props[0].decode(): p.props[4:]
            for block in below(elem, "Properties70")
            for p in block.elems
        }

    assert properties(below(root, "GlobalSettings")[0])["UnitScaleFactor"] == [1.0]
    objects = below(root, "Objects")[0]
    models = {e.props[1].split(b"\0")[0].decode(): properties(e) for e in below(objects, "Model")}
    for name, values in models.items():
        np.testing.assert_allclose(
            values.get("Lcl Scaling", [1, 1, 1]), 1.0, atol=1e-4, err_msg=name
        )
    joints = body.rest_joints(motion.betas)
    knee, hip = (body.joint_names.index(f"left_{part}") for part in ("knee", "hip"))
    shin = np.linalg.norm(models["left_knee"]["Lcl Translation"])
    assert shin == pytest.approx(100 * np.linalg.norm(joints[knee] - joints[hip]), rel=1e-4)
    mesh = next(e for e in below(objects, "Geometry") if e.props[2] == b"Mesh")
    heights = np.reshape(below(mesh, "Vertices")[0].props[0], (-1, 3))
    assert 100 < np.ptp(heights, axis=0).max() < 250
    shapes = [e for e in below(objects, "Geometry") if e.props[2] == b"Shape"]
    largest = max(np.abs(below(e, "Vertices")[0].props[0]).max() for e in shapes)
    assert largest == pytest.approx(100 * np.abs(body.shapedirs).max(), rel=1e-3)
    places = [
        below(n, "Matrix")[0].props[0][12:15]
        for e in below(objects, "Pose")
        for n in below(e, "PoseNode")
    ]
    assert np.abs(places).max() > 50
    camera = next(properties(e) for e in below(objects, "NodeAttribute") if e.props[2] == b"Camera")
    assert camera["FarPlane"] == [pytest.approx(100 * 1000.0)]
