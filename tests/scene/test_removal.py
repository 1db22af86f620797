# SPDX-License-Identifier: GPL-3.0-or-later
"""No scene's dependency graph keeps objects that were removed while the window showed another
scene.
"""

import bpy
import numpy as np
import pytest
from scope.scope_addon.scene.character.root_object import parent_to_root_object, remove_root_object
from scope.scope_addon.scene.datablocks import remove_blocks
from scope.scope_addon.scene.live_body import LiveBody
from scope.scope_addon.scene.transaction import all_or_nothing


def in_graph(scene):
    """Return how many datablocks the dependency graph of a scene has; the names of removed ones
    cannot be read.
    """
    return len(scene.view_layers[0].depsgraph.ids)


def show_another_scene():
    bpy.context.window_manager.windows[0].scene = bpy.data.scenes.new("other")


@pytest.fixture
def scene():
    """The window's scene, evaluated while it is empty."""
    bpy.context.view_layer.update()
    return bpy.context.scene


@pytest.fixture
def rig(scene):
    rig = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    scene.collection.objects.link(rig)
    bpy.context.view_layer.update()
    return rig


def test_objects_of_a_hidden_scene(scene):
    before = in_graph(scene)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.collection.objects.link(camera)
    bpy.context.view_layer.update()
    assert in_graph(scene) == before + 2
    show_another_scene()
    remove_blocks([camera, camera.data])
    assert in_graph(scene) == before


def test_objects_of_several_scenes(scene, rig):
    show_another_scene()
    other = bpy.context.scene
    other.collection.objects.link(rig)
    bpy.context.view_layer.update()
    before = in_graph(scene), in_graph(other)
    remove_blocks([rig])
    assert in_graph(scene) < before[0]
    assert in_graph(other) < before[1]


def test_the_body_of_a_live_capture(scene, body):
    empty = in_graph(scene)
    live = LiveBody(scene, "Live", body)
    live.show(np.tile([1.0, 0.0, 0.0, 0.0], (24, 1)), np.zeros(3), np.zeros(body.P))
    bpy.context.view_layer.update()
    assert in_graph(scene) > empty
    show_another_scene()
    live.remove()
    assert in_graph(scene) == empty


def test_a_root_object_that_another_scene_has_too(scene, rig):
    before = in_graph(scene)
    one = np.ones(1)
    empty = parent_to_root_object(rig, one, np.zeros((1, 3)), one)
    if not empty.users_scene:
        scene.collection.objects.link(empty)
    bpy.context.view_layer.update()
    assert in_graph(scene) > before
    show_another_scene()
    remove_root_object(rig)
    assert in_graph(scene) == before


def fail_in(scene):
    """Add an object, show another scene, and fail."""
    with all_or_nothing(scene):
        scene.collection.objects.link(bpy.data.objects.new("new", None))
        bpy.context.view_layer.update()
        show_another_scene()
        raise MemoryError


def test_what_a_failure_has_left(scene):
    before = in_graph(scene)
    with pytest.raises(MemoryError):
        fail_in(scene)
    assert in_graph(scene) == before
