# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes in Blender: the person is drawn where the ground truth says, and nothing hides people or
the camera.
"""

from __future__ import annotations

import bpy
import cv2
import numpy as np
from scope.benchmarks.scenes.draw import look_at
from scope.benchmarks.scenes.people import Person
from scope.benchmarks.scenes.scene import OUTDOORS, STATIC, TEST, Block, Scene
from scope.benchmarks.scenes.surroundings import build_scene, move_camera
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL
from scope.tools.render_sample.stage import pose_person, render_to

SIZE = (128, 96)


def scene_of(body, surroundings, seed=0):
    rotations = np.tile(np.eye(3), (1, body.K + 1, 1, 1))
    rotations[:, 0] = R_WORLD_MODEL
    trans = np.array([[0.2, 0.0, 0.93]]) - body.rest_joints(np.zeros(body.P))[0]
    person = Person("stands", rotations, trans, np.zeros(body.P), 1.0, 1.0, 0.0, 0.0, 5)
    K = np.array([[110.0, 0, 63.5], [0, 110, 47.5], [0, 0, 1]])
    pose = look_at(np.array([-1.0, -3.0, 1.3]), np.array([0.0, 0.0, 0.9]))
    block = Block(np.array([-1.4, 0.5, 0.0]), np.array([-0.9, 1.0, 0.5]))
    return Scene(1, TEST, (person,), K, pose[None], SIZE, 30.0, STATIC, surroundings, block, seed)


def test_the_person_is_drawn_where_the_ground_truth_says(body, tmp_path):
    scene = scene_of(body, OUTDOORS)
    (mesh,), _ = build_scene(scene, body)
    bpy.context.scene.cycles.samples = 1
    skin = scene.people[0].skin(body, 0)
    pose_person(mesh, skin)
    move_camera(scene.world_from_camera[0])
    pictures = []
    for hidden in (False, True):
        mesh.hide_render = hidden
        mesh.visible_shadow = False
        render_to(tmp_path / "picture.png")
        pictures.append(cv2.imread(str(tmp_path / "picture.png")).astype(int))
    drawn = np.abs(pictures[0] - pictures[1]).max(axis=-1) > 25
    rows = np.flatnonzero(drawn.any(axis=1))
    columns = np.flatnonzero(drawn.any(axis=0))
    pixels = scene.project(scene.to_camera(skin[None]))[0]
    low = pixels.min(axis=0)
    high = pixels.max(axis=0)
    found = [columns[0], rows[0], columns[-1], rows[-1]]
    np.testing.assert_allclose(found, [*low, *high], atol=3.0)
