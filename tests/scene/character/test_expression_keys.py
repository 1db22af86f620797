# SPDX-License-Identifier: GPL-3.0-or-later
"""The face in Blender: keys with ARKit's names, keyframes for those that move, and morph targets in
files.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from scope.scope_addon.kinematics.face import EXPRESSIONS, expressions_of
from scope.scope_addon.scene import actions
from scope.scope_addon.scene.build import NEW_SCENE, BuildOptions, build_scene
from scope.scope_addon.scene.character.body_mesh import mixed_vertices
from scope.scope_addon.scene.export.export import ExportOptions, export_motions

from ...made_motion import made_face
from ..exported import glb_values, read_glb

JAW = np.array([0.0, 0.3, 0.9, 0.2])


@pytest.fixture
def motion(whole_body, make_motion):
    return replace(make_motion(whole_body, 4), face=made_face(4, jawOpen=JAW, eyeBlinkLeft=0.4))


def test_52_keys_of_which_those_that_move_are_animated(whole_body, motion):
    mesh = build_scene([motion], whole_body, options=NEW_SCENE).people[0].mesh
    blocks = mesh.data.shape_keys.key_blocks
    assert blocks.keys()[-52:] == list(EXPRESSIONS)
    assert {(blocks[n].slider_min, blocks[n].slider_max) for n in EXPRESSIONS} == {(0.0, 1.0)}
    curves = {c.data_path: actions.read_keys(c) for c in actions.fcurves(mesh.data.shape_keys)}
    faces = {path: keys for path, keys in curves.items() if "Shape" not in path}
    assert set(faces) == {'key_blocks["jawOpen"].value', 'key_blocks["eyeBlinkLeft"].value'}
    np.testing.assert_allclose(faces['key_blocks["jawOpen"].value'][:, 1], JAW, atol=1e-6)
    np.testing.assert_allclose(faces['key_blocks["eyeBlinkLeft"].value'][:, 1], [0.4], atol=1e-6)


def test_a_key_moves_the_mesh_as_the_expression_says(whole_body, motion):
    mesh = build_scene([motion], whole_body, options=BuildOptions(shape="baked")).people[0].mesh
    bpy.context.scene.frame_set(0)
    before = mixed_vertices(mesh)
    mesh.data.shape_keys.key_blocks["mouthSmileLeft"].value = 0.5
    smile = next(e for e in expressions_of(whole_body) if e.name == "mouthSmileLeft")
    x, y, z = 0.5 * smile.offsets.T
    moved = mixed_vertices(mesh) - before
    np.testing.assert_allclose(moved[smile.vertices], np.stack([x, -z, y], axis=1), atol=1e-5)
    assert np.count_nonzero(np.abs(moved).max(axis=1) > 1e-6) <= len(smile.vertices)


def test_a_body_without_expressions_says_so(body, make_motion):
    built = build_scene([replace(make_motion(body, 4), face=made_face(4, jawOpen=JAW))], body)
    assert "has no expressions" in str(built.warnings[0])
    assert built.people[0].mesh.data.shape_keys.key_blocks.keys()[-1] == f"Shape{body.P - 1:03d}"


def test_teeth_and_tongue_come_with_the_face(whole_body, motion, make_motion):
    """As vertices after the body's, which deform with the head, in materials of their own."""
    mesh = build_scene([motion], whole_body, options=NEW_SCENE).people[0].mesh
    plain = build_scene([make_motion(whole_body, 4)], whole_body, options=NEW_SCENE).people[0].mesh
    assert len(plain.data.vertices) == len(whole_body.v_template)
    assert not {"teeth", "gums", "tongue"} & {
        m.name.partition(".")[0] for m in plain.data.materials
    }
    slots = [m.name.partition(".")[0] for m in mesh.data.materials]
    inside = [
        p for p in mesh.data.polygons if slots[p.material_index] in ("teeth", "gums", "tongue")
    ]
    vertices = {v for polygon in inside for v in polygon.vertices}
    assert vertices == set(range(len(plain.data.vertices), len(mesh.data.vertices)))
    head = mesh.vertex_groups["head"].index
    for v in vertices:
        assert [(g.group, g.weight) for g in mesh.data.vertices[v].groups] == [(head, 1.0)]
    # the body's own vertices are the same
    for name, before in plain.data.shape_keys.key_blocks.items():
        same = mesh.data.shape_keys.key_blocks[name].data
        assert all(same[v].co == before.data[v].co for v in range(0, len(plain.data.vertices), 97))


def morph_animation(path: Path) -> dict[str, np.ndarray]:
    """The (T,) animated weights of a .glb by target, read without Blender: the file is JSON and
    float32 arrays.
    """
    gltf, binary = read_glb(path)
    (mesh,) = [m for m in gltf["meshes"] if "extras" in m]
    (animation,) = gltf["animations"]
    (sampler,) = [
        animation["samplers"][c["sampler"]]
        for c in animation["channels"]
        if c["target"]["path"] == "weights"
    ]
    values = glb_values(gltf, binary, sampler["output"])
    names = mesh["extras"]["targetNames"]
    return dict(zip(names, values.reshape(-1, len(names)).T, strict=True))


@pytest.mark.slow
def test_a_glb_of_a_baked_shape_has_the_expressions_as_animated_morph_targets(
    whole_body, motion, tmp_path
):
    """``test_export_states`` exports one with keys."""
    path = tmp_path / "talk.glb"
    export_motions([motion], whole_body, path, export_options=ExportOptions(shape="baked"))
    weights = morph_animation(path)
    assert list(weights)[-52:] == list(EXPRESSIONS)
    assert "Shape000" not in weights
    np.testing.assert_allclose(weights["jawOpen"], JAW, atol=1e-5)
    np.testing.assert_allclose(weights["eyeBlinkLeft"], 0.4, atol=1e-5)
    assert not weights["mouthSmileLeft"].any()
    kinds = [len(getattr(bpy.data, kind)) for kind in ("meshes", "shape_keys", "actions")]
    assert kinds == [0, 0, 0]  # nothing of what was baked is left behind
