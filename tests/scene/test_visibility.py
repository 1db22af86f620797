# SPDX-License-Identifier: GPL-3.0-or-later
"""Where hidden objects are, of which Blender knows nothing after it has opened their file."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from scope.scope_addon.scene.character.root_object import parent_transform
from scope.scope_addon.scene.export.export_states import unit_of_captures
from scope.scope_addon.scene.visibility import world_matrix

PLACE = np.array(Matrix.Translation((5.0, 0.0, 20.0)) @ Matrix.Scale(100.0, 4))


def hide(collection, armature):
    armature.hide_viewport = True


def hide_collection(collection, armature):
    collection.hide_viewport = True


def exclude(collection, armature):
    bpy.context.view_layer.layer_collection.children[collection.name].exclude = True


@pytest.mark.parametrize("hidden_by", [hide, hide_collection, exclude])
def test_a_hidden_object_has_its_place_in_an_opened_file(tmp_path, hidden_by):
    collection = bpy.data.collections.new("walk")
    bpy.context.scene.collection.children.link(collection)
    parent = bpy.data.objects.new("car", None)
    armature = bpy.data.objects.new("walk", bpy.data.armatures.new("walk"))
    for obj in (parent, armature):
        collection.objects.link(obj)
    parent.keyframe_insert("location", frame=1)
    parent.location.z = 20.0
    parent.keyframe_insert("location", frame=11)
    armature.parent = parent
    armature.location.x = 5.0
    armature.scale = (100.0,) * 3
    hidden_by(collection, armature)
    parent.hide_viewport = armature.hide_viewport
    path = str(tmp_path / "hidden.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    armature = bpy.data.objects["walk"]
    layer = bpy.context.view_layer
    before = list(layer.objects), [each.name for each in armature.users_collection]
    bpy.context.scene.frame_set(11)
    np.testing.assert_allclose(np.array(world_matrix(armature)), PLACE, atol=1e-5)
    np.testing.assert_allclose(
        np.array(parent_transform(armature)), np.array(Matrix.Translation((0, 0, 20))), atol=1e-5
    )
    assert unit_of_captures([armature], 0.01) == pytest.approx(0.01)
    assert (list(layer.objects), [each.name for each in armature.users_collection]) == before
    assert not armature.visible_get(view_layer=layer)
