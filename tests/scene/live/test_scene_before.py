# SPDX-License-Identifier: GPL-3.0-or-later
"""Selection, mode and hidden objects are as they were."""

import bpy
from scope.scope_addon.scene.live.scene_before import SceneBefore


def test_what_changed_is_restored_and_what_is_gone_is_left_out():
    for name in ("a", "b", "c"):
        bpy.ops.object.armature_add()
        bpy.context.object.name = name
    objects = bpy.data.objects
    objects["b"].select_set(True)
    objects["a"].hide_set(True)
    bpy.ops.object.mode_set(mode="POSE")  # of c, which is active
    before = SceneBefore()
    bpy.ops.object.mode_set(mode="OBJECT")
    objects["a"].hide_set(False)
    objects["c"].select_set(False)
    bpy.context.view_layer.objects.active = objects["a"]
    bpy.data.objects.remove(objects["b"])
    before.restore()
    assert bpy.context.view_layer.objects.active.name == "c"
    assert bpy.context.object.mode == "POSE"
    assert objects["a"].hide_get()
    assert objects["c"].select_get()


def test_another_scene_is_left_alone():
    first = bpy.context.scene
    other = bpy.data.scenes.new("other")
    before = SceneBefore()
    window = bpy.context.window_manager.windows[0]
    hidden = bpy.data.objects.new("hidden", None)
    other.collection.objects.link(hidden)
    hidden.hide_set(True, view_layer=other.view_layers[0])
    with bpy.context.temp_override(window=window):
        window.scene = other
        before.restore()
        assert hidden.hide_get(view_layer=other.view_layers[0])
        window.scene = first
