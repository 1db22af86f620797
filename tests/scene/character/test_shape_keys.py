# SPDX-License-Identifier: GPL-3.0-or-later
import dataclasses

import bpy
import numpy as np
import pytest
from scope.scope_addon.errors import MotionFileError
from scope.scope_addon.scene import actions
from scope.scope_addon.scene.build import BuildOptions, build_scene


def test_names_range_and_values(body, make_motion):
    motion = make_motion(body)
    keys = build_scene([motion], body).people[0].mesh.data.shape_keys.key_blocks
    assert list(keys.keys()) == ["Basis"] + [f"Shape{p:03d}" for p in range(body.P)]
    assert {(k.slider_min, k.slider_max) for k in keys[1:]} == {(-10.0, 10.0)}
    np.testing.assert_allclose([k.value for k in keys[1:]], motion.betas, atol=1e-6)


def test_one_constant_key_each_at_the_first_frame(body, make_motion):
    motion = make_motion(body, timestamps=np.arange(5) / 30 + 2.0)
    mesh = build_scene([motion], body).people[0].mesh
    curves = actions.fcurves(mesh.data.shape_keys)
    assert len(curves) == body.P
    rate = bpy.context.scene.render.fps
    for curve, beta in zip(curves, motion.betas, strict=True):
        np.testing.assert_allclose(actions.read_keys(curve), [[2.0 * rate, beta]], atol=1e-4)
        assert curve.keyframe_points[0].interpolation == "CONSTANT"


def test_betas_beyond_blenders_sliders_are_refused_or_baked(body, make_motion):
    motion = make_motion(body, betas=[0.0, -12.5] + [0.0] * 8)
    with pytest.raises(MotionFileError, match="-12.5"):
        build_scene([motion], body)
    assert build_scene([motion], body, options=BuildOptions(shape="baked")).people


def test_a_body_without_shape(body, make_motion, truth, blender):
    plain = dataclasses.replace(
        body,
        shapedirs=body.shapedirs[:, :, :0],
        J_shapedirs=body.J_shapedirs[:, :, :0],
        keypoint_shapedirs=body.keypoint_shapedirs[:, :, :0],
    )
    motion = make_motion(plain)
    person = build_scene([motion], plain).people[0]
    blender.go_to(person.frames[3])
    np.testing.assert_allclose(
        blender.vertices(person.mesh), truth(plain, motion).vertices(3), atol=1e-4
    )
