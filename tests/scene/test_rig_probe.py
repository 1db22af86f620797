# SPDX-License-Identifier: GPL-3.0-or-later
"""How bones of a small armature move together, with and without constraints that its hierarchy does
not show.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from scope.scope_addon.scene.rig_probe import at_rest, probe

HEADS = {  # of bones that point up by 0.2 m
    "hips": (0, 0, 0.9),
    "spine": (0, 0, 1.2),
    "head": (0, 0, 1.5),
    "prop": (0.5, 0, 1.0),
}
PARENTS = {"spine": "hips", "head": "spine"}
PARTS = {"head": "head", "spine": "spine1", "hips": "pelvis", "prop": "left_hand"}


@pytest.fixture
def rig():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    armature = bpy.data.armatures.new("rig")
    obj = bpy.data.objects.new("rig", armature)
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    for name, head in HEADS.items():
        bone = armature.edit_bones.new(name)
        bone.head = head
        bone.tail = (head[0], head[1], head[2] + 0.2)
    for name, parent in PARENTS.items():
        armature.edit_bones[name].parent = armature.edit_bones[parent]
    bpy.ops.object.mode_set(mode="OBJECT")
    return obj


def parents(skeleton) -> dict[str, str | None]:
    return {
        name: skeleton.names[parent] if parent >= 0 else None
        for name, parent in zip(skeleton.names, skeleton.parents.tolist(), strict=True)
    }


def test_parents_come_before_their_children_and_places_are_those_at_rest(rig):
    with at_rest(rig):
        skeleton = probe(rig, PARTS)
    assert parents(skeleton) == {"hips": None, "spine": "hips", "head": "spine", "prop": None}
    assert (
        skeleton.names.index("hips") < skeleton.names.index("spine") < skeleton.names.index("head")
    )
    np.testing.assert_allclose(skeleton.heads, [HEADS[name] for name in skeleton.names], atol=1e-6)
    assert all(np.allclose(rig.pose.bones[name].matrix_basis, np.eye(4)) for name in HEADS)


def test_a_bone_that_a_constraint_makes_follow_another_is_its_child(rig):
    child_of = rig.pose.bones["prop"].constraints.new("CHILD_OF")
    child_of.target = rig
    child_of.subtarget = "spine"
    child_of.inverse_matrix = (rig.matrix_world @ rig.pose.bones["spine"].matrix).inverted()
    with at_rest(rig):
        assert parents(probe(rig, PARTS))["prop"] == "spine"
