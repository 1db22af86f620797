# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a camera was before its first turn comes from the .blend file, in which anything can be."""

from __future__ import annotations

import json

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from scope.scope_addon.scene.character import upright_scene
from scope.scope_addon.scene.character.upright_scene import turn_camera

TURN = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


@pytest.fixture
def scene():
    """A camera and an armature."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    armature = bpy.data.objects.new("Body", bpy.data.armatures.new("Body"))
    for obj in (camera, armature):
        bpy.context.collection.objects.link(obj)
    camera.location = 1.0, 2.0, 3.0
    return camera, armature


def test_a_place_that_is_none_is_ignored(scene):
    camera, armature = scene
    numbers = ([1, 2], ["x"] * 13, [10**400] * 13, [float("nan")] * 13)
    for before in (3, [], *([each] for each in numbers), [[0] * 13, []], {"0": [0] * 13}):
        turn_camera(camera, armature, TURN, to_captured=False)
        after = json.loads(camera[upright_scene._TURNED])[1]
        camera[upright_scene._TURNED] = json.dumps([before, after])
        turn_camera(camera, armature, np.linalg.inv(TURN), to_captured=True)
        bpy.context.view_layer.update()
        assert np.allclose(camera.matrix_world, Matrix.Translation((1, 2, 3)), atol=1e-5), before
