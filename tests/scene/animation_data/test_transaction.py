# SPDX-License-Identifier: GPL-3.0-or-later
"""A failure in a transaction leaves no new datablocks and restores the others."""

import bpy
import numpy as np
import pytest
from scope.scope_addon.scene.animation_data.actions import (
    Channels,
    fcurves,
    read_keys,
    rewrite_keys,
)
from scope.scope_addon.scene.animation_data.transaction import all_or_nothing
from scope.scope_addon.scene.build import BuildOptions, build_scene


@pytest.fixture
def person(body, make_motion):
    return build_scene(
        [make_motion(body, 12)], body, None, BuildOptions(start_frame=1.0, shape="per_frame")
    ).people[0]


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


def test_success_keeps_the_changes_and_leaves_no_copies(person):
    actions = {action.name for action in bpy.data.actions}
    with all_or_nothing(bpy.context.scene, person.armature):
        shuffle(person)
    assert {action.name for action in bpy.data.actions} == actions | {"Trajectory"}
    assert person.armature["scope_start"] == 99.0
    assert bpy.context.scene.frame_end == 6
