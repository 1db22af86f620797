# SPDX-License-Identifier: GPL-3.0-or-later
"""The empty that carries an armature's root motion: where it stands, what it stores, and that it
goes without trace.
"""

from __future__ import annotations

from dataclasses import replace

import bpy
import numpy as np
import pytest
from mathutils import Matrix
from scope.scope_addon.scene.character.keys import read_clip
from scope.scope_addon.scene.character.root_object import (
    move_root_motion_to_object,
    parent_to_root_object,
    parent_transform,
    remove_root_object,
    removed_root_motion,
    root_object,
)
from scope.scope_addon.scene.packed_motion import pack_motion
from scope.scope_addon.scene.timing import scene_rate
from scope.solver.rotations import exp

from ...edit.walking import BODY, motion_of, walk
from ..made_rigs import captured

FRAMES = np.array([1.0, 11.0, 21.0])
POSITIONS = np.array([[1.0, 2.0, 0.5], [2.0, 2.0, 0.5], [2.0, 4.0, 0.5]])
ANGLES = np.array([0.0, 0.5, 1.5])


@pytest.fixture(autouse=True)
def empty_file():
    bpy.ops.wm.read_factory_settings(use_empty=True)


def made(
    name: str, kind: str = "ARMATURE", parent: bpy.types.Object | None = None
) -> bpy.types.Object:
    obj = bpy.data.objects.new(name, bpy.data.armatures.new(name) if kind == "ARMATURE" else None)
    bpy.context.scene.collection.objects.link(obj)
    obj.parent = parent
    return obj


def place(obj: bpy.types.Object, frame: int) -> np.ndarray:
    bpy.context.scene.frame_set(frame)
    return np.array(obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world)


def expected(row: int) -> np.ndarray:
    return np.array(Matrix.Translation(POSITIONS[row]) @ Matrix.Rotation(ANGLES[row], 4, "Z"))


def test_the_armature_follows_the_trajectory_and_its_parent():
    group = made("group", "EMPTY")
    group.location = (0.0, 0.0, 10.0)
    armature = made("hero", parent=group)
    armature.location = (0.0, 0.3, 0.0)
    empty = parent_to_root_object(armature, FRAMES, POSITIONS, ANGLES, below_parent=True)
    assert root_object(armature) == empty
    assert (empty.name, empty.parent) == ("hero_root", group)
    for row, frame in enumerate((1, 11, 21)):
        wanted = (
            np.array(Matrix.Translation((0, 0, 10)))
            @ expected(row)
            @ np.array(Matrix.Translation((0, 0.3, 0)))
        )
        np.testing.assert_allclose(place(armature, frame), wanted, atol=1e-5)
    np.testing.assert_allclose(np.array(parent_transform(armature)), place(empty, 21), atol=1e-5)
    actions = len(bpy.data.actions)
    remove_root_object(armature)
    assert (root_object(armature), armature.parent) == (None, group)
    assert "hero_root" not in bpy.data.objects
    assert len(bpy.data.actions) == actions - 1


def test_the_heading_of_one_scene_has_nothing_of_the_next():
    """In place, a person faces ahead up to the cut, although the next scene faces another way."""
    still = walk(2.0, speed=0.0)
    still.rotations[30:, 0] = exp(np.array([0.0, 0.0, 1.5])) @ still.rotations[0, 0]
    motion = replace(motion_of(still), scene_starts=[30])
    armature = captured(motion)
    pack_motion(armature, motion.to_bytes())
    rate = scene_rate(bpy.context.scene)
    move_root_motion_to_object(armature, BODY, rate, in_place=True, heading=True)
    clip = read_clip(armature, BODY, rate)[0]
    expected = np.tile(still.rotations[0, 0], (len(clip), 1, 1))
    np.testing.assert_allclose(clip.rotations[:, 0], expected, atol=1e-4)


@pytest.mark.parametrize("in_place", [False, True])
def test_the_trajectory_is_read_back_between_its_keys_too(in_place):
    armature = made("hero")
    empty = parent_to_root_object(armature, FRAMES, POSITIONS, ANGLES, in_place=in_place)
    positions, angles = removed_root_motion(armature, np.array([1.0, 6.0, 21.0]))
    np.testing.assert_allclose(
        positions, [[1.0, 2.0, 0.5], [1.5, 2.0, 0.5], [2.0, 4.0, 0.5]], atol=1e-6
    )
    np.testing.assert_allclose(angles, [0.0, 0.25, 1.5], atol=1e-6)
    assert (empty.animation_data is None) == in_place
    np.testing.assert_allclose(place(armature, 21), expected(0 if in_place else 2), atol=1e-5)


def test_a_new_root_object_takes_over_what_is_parented_to_the_former():
    armature = made("hero")
    former = parent_to_root_object(armature, FRAMES, POSITIONS, ANGLES)
    prop = made("prop", "EMPTY", parent=former)
    prop.location = (0.0, 1.0, 0.0)
    seen = place(prop, 11)
    empty = parent_to_root_object(armature, FRAMES, POSITIONS, ANGLES)
    assert prop.parent == empty
    np.testing.assert_allclose(place(prop, 11), seen, atol=1e-6)
    assert [obj.name for obj in bpy.data.objects if obj.type == "EMPTY"] == ["hero_root", "prop"]


def test_a_removed_root_object_stays_for_what_is_parented_to_it():
    armature = made("hero")
    empty = parent_to_root_object(armature, FRAMES, POSITIONS, ANGLES)
    prop = made("prop", "EMPTY", parent=empty)
    seen = place(prop, 11)
    remove_root_object(armature)
    assert (armature.parent, prop.parent) == (None, empty)
    np.testing.assert_allclose(place(prop, 11), seen, atol=1e-6)


@pytest.mark.parametrize("replaced", [False, True])
def test_a_duplicate_that_shares_the_root_object_does_not_lose_it(replaced):
    armature = made("hero")
    shared = parent_to_root_object(armature, FRAMES, POSITIONS, ANGLES)
    duplicate = made("hero.001", parent=shared)
    if replaced:
        assert parent_to_root_object(armature, FRAMES, POSITIONS, ANGLES) == armature.parent
    else:
        remove_root_object(armature)
    assert armature.parent != shared
    assert duplicate.parent == shared
    np.testing.assert_allclose(place(duplicate, 21), expected(2), atol=1e-5)
