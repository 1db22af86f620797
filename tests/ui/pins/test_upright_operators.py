# SPDX-License-Identifier: GPL-3.0-or-later
"""What is upright, set through Blender's operator."""

from dataclasses import replace

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Matrix, Vector
from scope.scope_addon.edit.corrected_motion import shot_of
from scope.scope_addon.edit.edits import moved_motion
from scope.scope_addon.scene.character.correction_list import listed_corrections
from scope.solver.rotations import exp

from ...edit.walking import BODY, NAMES, motion_of, walk
from ...made_motion import level_camera, made_views
from ...scene import made_rigs
from ...scene.made_rigs import captured_together, captured_with
from .changes import assert_same, everything, kinds, look_through_camera

POST = ((0.4, 1.0, 0.2), (0.4, 1.0, 1.9))
FRAMES = (5, 25, 50)


def rotation(*degrees):
    """(4, 4) about an axis whose length is the angle."""
    out = np.eye(4)
    out[:3, :3] = exp(np.radians(degrees))
    return out


@pytest.fixture(params=["static", "panning"])
def rig(request):
    """A walk captured by a camera whose world is tilted by 8 degrees, and the pixels of an upright
    post.
    """
    motion = motion_of(walk(2.0))
    if request.param == "panning":
        turn = exp(np.linspace(0, 0.1, len(motion))[:, None] * np.array([0.0, 1.0, 0.0]))
        motion.world_from_camera[:, :3, :3] = level_camera(1)[0, :3, :3] @ turn
    line = [tuple(shot_of(motion).project(19, np.array(point))) for point in POST]
    tilt = rotation(0.0, 8.0, 0.0)
    tilted = moved_motion(motion, BODY, tilt)
    armature = captured_with(tilted)
    look_through_camera(20)
    return armature, line


def in_image(rig):
    """(frames, joints, 2) where the scene's camera sees the joints."""
    scene = bpy.context.scene
    found = []
    for frame in FRAMES:
        places = made_rigs.seen(rig, NAMES, [frame])[0]
        found.append(
            [world_to_camera_view(scene, scene.camera, Vector(place))[:2] for place in places]
        )
    return np.array(found)


def tilt_of_camera():
    """Degrees by which the image's horizontal is out of level."""
    right = bpy.context.scene.camera.matrix_world.to_3x3() @ Vector((1, 0, 0))
    return abs(np.degrees(np.arcsin(right.z)))


def test_person_and_camera_turn_together_until_the_line_is_upright(rig):
    armature, line = rig
    before = in_image(armature)
    assert tilt_of_camera() > 7
    bpy.context.scene.frame_set(20)
    bpy.ops.scope.set_upright(start=line[0], end=line[1])
    np.testing.assert_allclose(in_image(armature), before, atol=2e-3)
    assert tilt_of_camera() < 1.5
    bpy.ops.scope.smooth(strength=1.0)  # the motion has turned with its keys
    np.testing.assert_allclose(in_image(armature), before, atol=2e-3)


def pin(armature):
    """Pin the wrist 15 cm away from where it is at frame 20; return where."""
    bpy.context.scene.frame_set(20)
    target = made_rigs.seen(armature, ["left_wrist"], [20])[0, 0] + [0.0, 0.1, 0.1]
    bpy.ops.scope.add_pin(joint="left_wrist", location=target)
    return target


@pytest.mark.parametrize(
    ("rig", "removed"), [("static", [1, 0]), ("panning", [-1])], indirect=["rig"]
)
def test_without_the_line_everything_is_the_same_to_the_bit(rig, removed):
    armature, line = rig
    before = everything(armature)
    bpy.context.scene.frame_set(20)
    bpy.ops.scope.set_upright(start=line[0], end=line[1])
    assert kinds(armature) == ["UPRIGHT"]
    target = pin(armature)
    assert kinds(armature) == ["PIN", "UPRIGHT"]
    assert np.linalg.norm(made_rigs.seen(armature, ["left_wrist"], [20])[0, 0] - target) < 0.01
    for index in removed:
        bpy.ops.scope.remove_correction(index=index)
    assert kinds(armature) == []
    assert tilt_of_camera() > 7
    assert_same(everything(armature), before)


@pytest.mark.parametrize("rig", ["panning"], indirect=True)
def test_a_pin_moves_with_the_line_and_back(rig):
    armature, line = rig
    pin(armature)
    alone = everything(armature)
    seen = in_image(armature)
    bpy.context.scene.frame_set(20)
    bpy.ops.scope.set_upright(start=line[0], end=line[1])
    np.testing.assert_allclose(in_image(armature), seen, atol=2e-3)
    bpy.ops.scope.smooth(strength=2.5)
    bpy.ops.scope.smooth(strength=1.0)
    np.testing.assert_allclose(in_image(armature), seen, atol=2e-3)
    assert [entry["missed"] for entry in listed_corrections(armature)] == ["", ""]
    bpy.ops.scope.remove_correction(index=1)
    assert kinds(armature) == ["PIN"]
    assert_same(everything(armature), alone, atol=2e-6)


@pytest.mark.parametrize("rig", ["static"], indirect=True)
def test_two_lines_are_removed_together(rig):
    armature, line = rig
    before = everything(armature)
    for _ in range(2):
        bpy.context.scene.frame_set(20)
        bpy.ops.scope.set_upright(start=line[0], end=(line[1][0] + 5, line[1][1]))
    assert kinds(armature) == ["UPRIGHT"]
    bpy.ops.scope.remove_correction(index=0)
    assert_same(everything(armature), before)


@pytest.mark.parametrize("rig", ["static"], indirect=True)  # the keys of another camera hold it
def test_a_camera_that_was_moved_by_hand_keeps_that(rig):
    armature, line = rig
    camera = bpy.context.scene.camera
    was = camera.matrix_world.copy()
    bpy.context.scene.frame_set(20)
    bpy.ops.scope.set_upright(start=line[0], end=line[1])
    camera.location.x += 1.0
    bpy.ops.scope.remove_correction(index=0)
    assert 0.9 < (camera.matrix_basis.translation - was.translation).length < 1.1


def test_the_line_of_one_person_is_that_of_everybody_of_the_capture():
    people = captured_together()
    before = [everything(person) for person in people]
    bpy.ops.scope.set_upright(start=(300, 100), end=(320, 300))
    assert [kinds(person) for person in people] == [["UPRIGHT"]] * 2
    bpy.context.view_layer.objects.active = people[1]
    bpy.ops.scope.remove_correction(index=0)
    assert [kinds(person) for person in people] == [[]] * 2
    for person, expected in zip(people, before, strict=True):
        assert_same(everything(person), expected)


@pytest.fixture
def leaning():
    """A walk captured by a camera whose world leans by 8 degrees towards it; the armature is turned
    and moved.
    """
    tilt = rotation(8.0, 0.0, 0.0)
    armature = captured_with(moved_motion(motion_of(walk(2.0)), BODY, tilt))
    place = Matrix.LocRotScale(
        Vector((3.0, 1.0, 0.0)), Matrix.Rotation(0.7, 3, "Z").to_quaternion(), None
    )
    look_through_camera(20)
    for obj in (armature, bpy.context.scene.camera):
        obj.matrix_world = place @ obj.matrix_world
    view = place.to_3x3() @ Vector((1.0, 0.0, 0.0))
    post = [place @ Vector(tilt[:3, :3] @ np.array(point)) for point in POST]
    return armature, {"start": post[0] - 5 * view, "end": post[1] - 5 * view, "direction": view}


def lean_of_camera():
    """Degrees by which the scene's camera looks up or down."""
    ahead = bpy.context.scene.camera.matrix_world.to_3x3() @ Vector((0, 0, -1))
    return abs(np.degrees(np.arcsin(ahead.z)))


def test_a_line_from_the_side_turns_person_and_camera_until_it_is_removed(leaning):
    armature, line = leaning
    before = everything(armature)
    seen = in_image(armature)
    assert lean_of_camera() > 7
    bpy.context.scene.frame_set(20)
    bpy.ops.scope.set_upright_in_view(**line)
    assert kinds(armature) == ["UPRIGHT"]
    assert lean_of_camera() < 0.1
    np.testing.assert_allclose(in_image(armature), seen, atol=2e-3)
    for strength in (2.5, 1.0):
        bpy.ops.scope.smooth(strength=strength)
    np.testing.assert_allclose(in_image(armature), seen, atol=2e-3)
    bpy.ops.scope.remove_correction(index=0)
    assert_same(everything(armature), before, atol=1e-6)


def test_a_line_in_a_view_from_above_is_refused(leaning):
    armature, line = leaning
    before = in_image(armature)
    bpy.context.scene.frame_set(20)
    with pytest.raises(RuntimeError, match="from a side"):
        bpy.ops.scope.set_upright_in_view(**(line | {"direction": (0.0, 0.0, -1.0)}))
    with pytest.raises(RuntimeError, match="from a side"):
        bpy.ops.scope.set_upright_in_view(**(line | {"direction": (0.0, 0.0, 0.0)}))
    np.testing.assert_array_equal(in_image(armature), before)


@pytest.mark.parametrize("rig", ["static"], indirect=True)
def test_a_refused_line_changes_nothing(rig):
    armature, _ = rig
    before = in_image(armature)
    stored = armature["scope_motion"]
    bpy.context.scene.frame_set(20)
    with pytest.raises(RuntimeError, match="from upright"):
        bpy.ops.scope.set_upright(start=(10, 10), end=(200, 12))
    bpy.ops.scope.root_motion(mode="OBJECT")
    with pytest.raises(RuntimeError, match="In Bones"):
        bpy.ops.scope.set_upright(start=(10, 10), end=(10, 200))
    bpy.ops.scope.root_motion(mode="BONES")
    assert armature["scope_motion"] == stored
    np.testing.assert_allclose(in_image(armature), before, atol=1e-4)


def test_all_cameras_of_a_capture_in_two_collections_turn_together():
    motion = motion_of(walk(1.0))
    line = [tuple(shot_of(motion).project(19, np.array(point))) for point in POST]
    tilt = rotation(0.0, 8.0, 0.0)
    tilted = replace(moved_motion(motion, BODY, tilt), views=made_views(0.5, -0.2))
    armature = captured_with(tilted)
    scene = bpy.context.scene
    cameras = [o for o in scene.objects if o.type == "CAMERA"]
    assert len(cameras) == 3
    crowd = bpy.data.collections.new("Crowd")
    scene.collection.children.link(crowd)
    for obj in (armature, *cameras):
        crowd.objects.link(obj)
    scene.camera = cameras[0]
    scene.frame_set(20)

    def places():
        bpy.context.view_layer.update()
        return [np.array(camera.matrix_world) for camera in cameras]

    before = places()
    bpy.ops.scope.set_upright(start=line[0], end=line[1])
    after = places()
    assert tilt_of_camera() < 1.0
    for was, now in zip(before[1:], after[1:], strict=True):
        relative = np.linalg.inv(before[0]) @ was
        np.testing.assert_allclose(np.linalg.inv(after[0]) @ now, relative, atol=1e-4)
