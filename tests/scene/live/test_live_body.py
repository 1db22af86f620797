# SPDX-License-Identifier: GPL-3.0-or-later
"""The posed body is SMPL's for every pose and shape, survives what undo does, and leaves nothing
behind.
"""

import bpy
import numpy as np
import pytest
from scope.scope_addon.errors import UsageError
from scope.scope_addon.scene.live_body import LiveBody
from scope.solver.rotations import exp, quaternion_from_matrix

KINDS = ("objects", "meshes", "armatures", "collections", "materials", "shape_keys", "actions")


def blocks():
    return {kind: sorted(block.name for block in getattr(bpy.data, kind)) for kind in KINDS}


@pytest.fixture
def live(body):
    return LiveBody(bpy.context.scene, "Live", body)


def pose(seed):
    rng = np.random.default_rng(seed)
    return exp(0.4 * rng.normal(size=(24, 3))), rng.normal(size=3)


def shown(live):
    """Vertices (V, 3) as Blender deforms them."""
    bpy.context.view_layer.update()
    mesh = next(child for child in live.armature.children if child.type == "MESH")
    posed = mesh.evaluated_get(bpy.context.evaluated_depsgraph_get())
    points = np.empty(3 * len(posed.data.vertices), np.float32)
    posed.to_mesh().vertices.foreach_get("co", points)
    return points.reshape(-1, 3)


def truth(body, rotations, pelvis, betas):
    R, t = body.forward_kinematics(rotations, pelvis - body.rest_joints(betas)[0], betas)
    return body.skin(R, t, betas)


def test_every_pose_and_shape_is_that_of_smpl(live, body):
    rng = np.random.default_rng(5)
    for seed in range(4):
        betas = rng.normal(size=body.P)
        (rotations, pelvis) = pose(seed)
        created = live.show(quaternion_from_matrix(rotations), pelvis, betas)
        assert created == (seed == 0)
        np.testing.assert_allclose(shown(live), truth(body, rotations, pelvis, betas), atol=1e-4)


def test_the_rest_pose_becomes_that_of_the_last_shape(live, body):
    (rotations, pelvis) = pose(1)
    betas = np.linspace(-1, 1, body.P)
    live.show(quaternion_from_matrix(rotations), pelvis, np.zeros(body.P))
    live.show(quaternion_from_matrix(rotations), pelvis, betas)
    names = sorted(obj.name for obj in bpy.data.objects)
    live.armature.select_set(True)
    live.rest_at_shape()
    assert bpy.context.view_layer.objects.active == live.armature
    assert live.armature.select_get()
    assert sorted(obj.name for obj in bpy.data.objects) == names
    for bone in list(live.armature.pose.bones)[1:]:
        assert bone.location.length < 1e-6
    np.testing.assert_allclose(shown(live), truth(body, rotations, pelvis, betas), atol=1e-4)


@pytest.mark.parametrize("change", ["show", "rest"])
def test_a_body_without_its_scene_is_an_error_that_keeps_what_is_there(live, body, change):
    """The body is also in another scene, and its mesh was deleted, so that it has to be created
    again.
    """
    (rotations, pelvis) = pose(2)
    betas = np.zeros(body.P)
    live.show(quaternion_from_matrix(rotations), pelvis, betas)
    mine = bpy.context.scene
    other = bpy.data.scenes.new("other")
    other.collection.children.link(live.armature.users_collection[0])
    bpy.data.scenes.remove(mine)
    if change == "show":
        bpy.data.objects.remove(
            next(child for child in live.armature.children if child.type == "MESH")
        )
    before = blocks()
    with pytest.raises(UsageError, match="the scene was removed during the live capture"):
        live.rest_at_shape() if change == "rest" else live.show(
            quaternion_from_matrix(rotations), pelvis, betas
        )
    assert blocks() == before


def test_a_removed_body_is_created_again_and_cancelling_leaves_nothing(live, body):
    before = blocks()
    (rotations, pelvis) = pose(2)
    betas = np.zeros(body.P)
    live.show(quaternion_from_matrix(rotations), pelvis, betas)
    after = blocks()
    bpy.data.objects.remove(live.armature)
    assert live.armature is None
    assert live.show(quaternion_from_matrix(rotations), pelvis, betas)
    assert blocks() == after
    live.remove()
    assert blocks() == before


def test_coefficients_that_blender_cannot_show_are_limited(live, body):
    rotations, pelvis = pose(3)
    live.show(quaternion_from_matrix(rotations), pelvis, np.full(body.P, 30.0))
    assert np.isfinite(shown(live)).all()
    assert live.betas.max() == 10.0


def test_a_body_that_the_user_edits_waits_and_is_created_again_if_it_lost_bones(live, body):
    rotations, pelvis = pose(4)
    q = quaternion_from_matrix(rotations)
    betas = np.zeros(body.P)
    live.show(q, pelvis, betas)
    bpy.context.view_layer.objects.active = live.armature
    bpy.ops.object.mode_set(mode="EDIT")
    assert not live.show(q, pelvis, betas)
    bones = live.armature.data.edit_bones
    bones.remove(bones["head"])
    bpy.ops.object.mode_set(mode="OBJECT")
    assert live.show(q, pelvis, betas)
    mesh = next(child for child in live.armature.children if child.type == "MESH")
    mesh.shape_key_clear()
    assert not live.show(q, pelvis, np.ones(body.P))
