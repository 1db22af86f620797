# SPDX-License-Identifier: GPL-3.0-or-later
"""A failure in a transaction leaves no new datablocks and restores the others.

An action that was changed is restored from a copy made before, and stays the same datablock.
"""

import bpy
import numpy as np
import pytest
from scope.scope_addon.scene.actions import (
    Channels,
    add_cycles,
    fcurves,
    has_slots,
    read_keys,
    rewrite_keys,
)
from scope.scope_addon.scene.build import BuildOptions, build_scene
from scope.scope_addon.scene.timing import Retiming, retime_strip, strip_ends
from scope.scope_addon.scene.transaction import all_or_nothing, restore_content


@pytest.fixture
def person(body, make_motion):
    options = BuildOptions(start_frame=1.0)
    return build_scene([make_motion(body, 12)], body, None, options).people[0]


def everything(person):
    """Return the values that must not change."""
    scene = bpy.context.scene
    rig = person.armature
    keys = person.mesh.data.shape_keys
    curves = [
        (c.data_path, c.array_index, read_keys(c).tobytes())
        for c in (*fcurves(rig), *fcurves(keys))
    ]
    action = rig.animation_data.action
    kinds = ("objects", "actions", "meshes", "collections")
    return {
        "curves": sorted(curves),
        "action": (action.name, action.use_fake_user, keys.animation_data.action.name),
        # Not only of the same name: undo crashes on a datablock that no step contains.
        "identities": {b.session_uid for kind in kinds for b in getattr(bpy.data, kind)},
        "place": (
            rig.parent,
            np.array(rig.matrix_basis).tobytes(),
            np.array(rig.matrix_parent_inverse).tobytes(),
        ),
        "properties": ({k: str(rig[k]) for k in rig.keys()}, dict(rig.pose.bones[3].items())),
        "blocks": {kind: sorted(block.name for block in getattr(bpy.data, kind)) for kind in kinds},
        "scene": (
            scene.frame_start,
            scene.frame_end,
            scene.frame_current,
            scene.render.fps,
            scene.camera,
        ),
        "markers": [(m.name, m.frame) for m in scene.timeline_markers],
        "selected": sorted(obj.name for obj in bpy.context.selected_objects),
    }


def shuffle(person):
    """Make the changes of edits and retargeting, and others."""
    scene = bpy.context.scene
    rig = person.armature
    for curve in fcurves(rig)[:7]:
        rewrite_keys(curve, np.array([1.0, 2.0]), np.array([0.3, 0.4]))
    empty = bpy.data.objects.new("Root", None)
    scene.collection.objects.link(empty)
    Channels(empty, bpy.data.actions.new("Trajectory")).write(
        "location", np.array([1.0]), np.array([[1.0, 2.0, 3.0]])
    )
    rig.parent = empty
    rig.location = (1, 2, 3)
    rig["new"] = 1.0
    rig["scope_start"] = 99.0
    rig.pose.bones[3]["IK_FK"] = 0.5
    scene.frame_start = 5
    scene.frame_end = 6
    scene.render.fps = 99
    scene.frame_set(6)
    scene.timeline_markers.new("new", frame=3)
    rig.animation_data.action.use_fake_user = False
    rig.select_set(False)


def fail_after(work, *objects):
    """Make the changes, then run out of memory."""
    with all_or_nothing(bpy.context.scene, *objects):
        work()
        raise MemoryError


def another_action(datablock):
    Channels(datablock, bpy.data.actions.new("Other"))


def test_a_failure_changes_nothing(person):
    person.armature.pose.bones[3]["IK_FK"] = 0.25
    before = everything(person)
    with pytest.raises(MemoryError):
        fail_after(lambda: shuffle(person), person.armature)
    assert everything(person) == before


def test_a_new_action_is_removed_by_a_rollback(person):
    before = everything(person)
    action = person.armature.animation_data.action
    with pytest.raises(MemoryError):
        fail_after(lambda: another_action(person.armature), person.armature)
    assert everything(person) == before
    assert person.armature.animation_data.action == action  # the very same, which others may hold


def test_an_object_without_animation_has_none_after_a_rollback(person):
    empty = bpy.data.objects.new("Empty", None)
    with pytest.raises(MemoryError):
        fail_after(lambda: another_action(empty), empty, empty)
    assert empty.animation_data is None


def test_the_zoom_of_a_camera_in_the_nla_is_where_it_was_after_a_rollback():
    lens = bpy.data.cameras.new("camera")
    camera = bpy.data.objects.new("camera", lens)
    bpy.context.scene.collection.objects.link(camera)
    for frame in (10, 50):
        lens.lens = frame
        lens.keyframe_insert("lens", frame=frame)
    animation = lens.animation_data
    strip = animation.nla_tracks.new().strips.new("zoom", 10, animation.action)
    animation.action = None

    def fail():
        with all_or_nothing(bpy.context.scene, camera):
            retime_strip(strip, Retiming(1.0, 2.0))
            assert strip_ends(strip) != [10.0, 50.0, 10.0, 50.0]
            raise MemoryError

    pytest.raises(MemoryError, fail)
    assert strip_ends(strip) == [10.0, 50.0, 10.0, 50.0]


def test_success_keeps_the_changes_and_leaves_no_copies(person):
    actions = {action.name for action in bpy.data.actions}
    with all_or_nothing(bpy.context.scene, person.armature):
        shuffle(person)
    assert {action.name for action in bpy.data.actions} == actions | {"Trajectory"}
    assert person.armature["scope_start"] == 99.0
    assert bpy.context.scene.frame_end == 6


@pytest.fixture
def animated():
    """Return an object with keys that a user has changed by hand."""
    obj = bpy.data.objects.new("Object", None)
    channels = Channels(obj, bpy.data.actions.new("Take"))
    curves = channels.write(
        "location", np.arange(5.0), np.random.default_rng(0).normal(size=(5, 3)), group="Place"
    )
    channels.write("scale", np.arange(3.0), np.ones((3, 3)), "BEZIER")
    point = curves[0].keyframe_points[2]
    point.interpolation = "ELASTIC"
    point.easing = "EASE_OUT"
    point.amplitude = 0.7
    point.period = 3.0
    point.type = "EXTREME"
    point.handle_left_type = point.handle_right_type = "FREE"
    point.handle_left = (1.5, 9.0)
    point.handle_right = (2.5, -9.0)
    curves[0].update()
    curves[1].mute = True
    curves[1].extrapolation = "LINEAR"
    curves[1].color_mode = "CUSTOM"
    noise = curves[2].modifiers.new("NOISE")
    noise.strength = 0.5
    noise.use_restricted_range = True
    noise.frame_start = 2.0
    noise.frame_end = 4.0
    envelope = curves[2].modifiers.new("ENVELOPE")
    envelope.control_points.add(3.0)
    # Blender 5.2 can crash on assigning to one point
    envelope.control_points.foreach_set("min", [-0.5])
    envelope.control_points.foreach_set("max", [0.25])
    generator = curves[2].modifiers.new("GENERATOR")
    generator.poly_order = 2
    generator.coefficients = (1.0, 2.0, 3.0)
    return obj


def values(struct):
    """Return the simple properties of a struct, which Blender's own interface lists."""
    found = {}
    for prop in struct.bl_rna.properties:
        value = getattr(struct, prop.identifier)
        if prop.type == "COLLECTION":
            found[prop.identifier] = [values(each) for each in value]
        elif prop.type != "POINTER":
            found[prop.identifier] = tuple(value) if getattr(prop, "is_array", False) else value
    return found


def content(obj):
    """Return everything that the action holds for an object."""
    curves = {
        (c.data_path, c.array_index): {**values(c), "group": c.group and c.group.name}
        for c in fcurves(obj)
    }
    action = obj.animation_data.action
    return curves, action.use_frame_range, tuple(action.frame_range)


def change_keys(obj):
    for curve in fcurves(obj):
        curve.keyframe_points.clear()
        curve.keyframe_points.insert(7.0, 3.0)


def change_modifiers(obj):
    add_cycles(obj)
    _cycles, noise, envelope, _generator = fcurves(obj)[2].modifiers
    noise.strength = 3.0
    fcurves(obj)[2].modifiers.remove(envelope)


def remove_curves(obj):
    bag = obj.animation_data.action
    if has_slots():
        bag = bag.layers[0].strips[0].channelbag(obj.animation_data.action_slot)
    for curve in list(bag.fcurves)[:5]:
        bag.fcurves.remove(curve)


def add_curves(obj):
    action = obj.animation_data.action
    obj.keyframe_insert("rotation_euler", frame=3)
    action.use_frame_range = True
    action.frame_end = 77.0
    if has_slots():
        other = bpy.data.objects.new("Other", None)
        Channels(other, action).write("location", np.arange(2.0), np.zeros((2, 3)))


@pytest.mark.parametrize("change", [change_keys, change_modifiers, remove_curves, add_curves])
def test_an_action_is_restored_in_place(animated, change):
    action = animated.animation_data.action
    copy = action.copy()
    before = content(animated)
    change(animated)
    assert content(animated) != before
    restore_content(action, copy)
    after = content(animated)
    for key, curve in before[0].items():
        assert after[0][key] == curve
    assert after == before
    assert animated.animation_data.action == action
    if has_slots():
        assert [slot.identifier for slot in action.slots] == ["OBObject"]
