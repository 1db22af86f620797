# SPDX-License-Identifier: GPL-3.0-or-later
"""What is upright, set through Blender's operator."""

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
from scope.scope_addon.edit.pins.corrected_motion import shot_of
from scope.scope_addon.edit.pins.upright import moved_motion
from scope.scope_addon.motion import Motion
from scope.solver.rotations import exp

from ...edit.walking import BODY, NAMES, motion_of, walk
from ...made_motion import level_camera
from ...scene import made_rigs
from ...scene.made_rigs import captured

POST = ((0.4, 1.0, 0.2), (0.4, 1.0, 1.9))
FRAMES = (5, 25, 50)


@pytest.fixture(params=["static", "panning"])
def rig(tmp_path, request):
    """A walk captured by a camera whose world is tilted by 8 degrees, and the pixels of an upright post."""
    motion = motion_of(walk(2.0))
    if request.param == "panning":
        turn = exp(np.linspace(0, 0.1, len(motion))[:, None] * np.array([0.0, 1.0, 0.0]))
        motion.world_from_camera[:, :3, :3] = level_camera(1)[0, :3, :3] @ turn
    line = [tuple(shot_of(motion).project(19, np.array(point))) for point in POST]
    tilt = np.eye(4)
    tilt[:3, :3] = exp(np.radians([0.0, 8.0, 0.0]))
    tilted = moved_motion(motion, BODY, tilt)
    armature = captured(tilted)
    tilted.save(tmp_path / "person1.npz")
    armature["scope_motion"], armature["scope_body_file"] = str(tmp_path / "person1.npz"), "scope"
    scene = bpy.context.scene
    scene.camera = next(o for o in scene.objects if o.type == "CAMERA")
    scene.render.resolution_x, scene.render.resolution_y = 640, 480
    scene.frame_set(20)
    return armature, line


def in_image(rig):
    """(frames, joints, 2) where the scene's camera sees the joints."""
    scene, found = bpy.context.scene, []
    for frame in FRAMES:
        places = made_rigs.seen(rig, NAMES, [frame])[0]
        found.append([world_to_camera_view(scene, scene.camera, Vector(place))[:2] for place in places])
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


def test_a_refused_line_changes_nothing(rig):
    armature, _ = rig
    before, path = in_image(armature), armature["scope_motion"]
    bpy.context.scene.frame_set(20)
    with pytest.raises(RuntimeError, match="from upright"):
        bpy.ops.scope.set_upright(start=(10, 10), end=(200, 12))
    bpy.ops.scope.root_motion(mode="OBJECT")
    with pytest.raises(RuntimeError, match="In Bones"):
        bpy.ops.scope.set_upright(start=(10, 10), end=(10, 200))
    bpy.ops.scope.root_motion(mode="BONES")
    assert armature["scope_motion"] == path
    assert len(Motion.load(path)) == len(walk(2.0))
    np.testing.assert_allclose(in_image(armature), before, atol=1e-4)
