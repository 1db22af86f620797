# SPDX-License-Identifier: GPL-3.0-or-later
"""What counts as animated in a scene, so that its frame rate is kept, or the user is told."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from scope.scope_addon.scene.actions import push_to_nla
from scope.scope_addon.scene.build import build_scene
from scope.scope_addon.scene.footage_strip import strips_of
from scope.scope_addon.scene.match_rate import is_animated, other_animation

from ..made_motion import made_motion


def prop():
    mesh = bpy.data.meshes.new("prop")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    obj = bpy.data.objects.new("prop", mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def key_object():
    prop().keyframe_insert("location", frame=1)


def put_strip():
    obj = prop()
    obj.keyframe_insert("location", frame=1)
    push_to_nla(obj)


def key_shape():
    obj = prop()
    obj.shape_key_add(name="Basis")
    obj.shape_key_add(name="Smile").keyframe_insert("value", frame=1)


def key_material():
    material = bpy.data.materials.new("paint")
    material.use_nodes = True
    prop().data.materials.append(material)
    material.node_tree.nodes["Principled BSDF"].inputs[0].keyframe_insert("default_value", frame=1)


def key_nodes_of_modifier():
    group = bpy.data.node_groups.new("grow", "GeometryNodeTree")
    value = group.nodes.new("ShaderNodeValue")
    value.outputs[0].keyframe_insert("default_value", frame=1)
    outer = bpy.data.node_groups.new("outer", "GeometryNodeTree")
    outer.nodes.new("GeometryNodeGroup").node_tree = group
    prop().modifiers.new("nodes", "NODES").node_group = outer


def key_light():
    light = bpy.data.lights.new("sun", "SUN")
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("sun", light))
    light.keyframe_insert("energy", frame=1)


def key_world():
    world = bpy.data.worlds.new("sky")
    bpy.context.scene.world = world
    world.keyframe_insert("color", frame=1)


def key_scene():
    bpy.context.scene.keyframe_insert("gravity", frame=1)


def cut_film():
    scene = bpy.context.scene
    path = bpy.utils.user_resource("SCRIPTS")
    strips_of(scene.sequence_editor_create()).new_image("shot", path, 1, 1)


KINDS = [
    key_object,
    put_strip,
    key_shape,
    key_material,
    key_nodes_of_modifier,
    key_light,
    key_world,
    key_scene,
    cut_film,
]


@pytest.mark.parametrize("animate", KINDS)
def test_every_kind_of_animation_counts(animate):
    scene = bpy.context.scene
    prop()
    assert not is_animated(scene)
    assert not other_animation(scene, [], [])
    animate()
    assert is_animated(scene)
    assert other_animation(scene, [], [])


def test_a_capture_is_animated_but_is_no_other_animation(body):
    poses = np.zeros((5, 3 * (body.K + 1)))
    built = build_scene([made_motion(body, poses, np.zeros((5, 3)), 25.0)], body)
    scene = bpy.context.scene
    assert is_animated(scene)
    assert not other_animation(scene, [built.people[0].armature], [])
