# SPDX-License-Identifier: GPL-3.0-or-later
"""The view from the side: a quarter turn around the person."""

from __future__ import annotations

import numpy as np
from scope.benchmarks.page.shots import side_view, turned_camera
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL
from scope.solver.rotations import log

from ...made_motion import level_camera, made_motion


def test_the_camera_goes_around_the_target_and_looks_at_it():
    target = np.array([0.0, 0.0, 1.0])  # 4 m before the camera at (0, -4, 1), which looks along y
    R, eye = turned_camera(level_camera(1)[0], target)
    assert np.allclose(eye, [4, 0, 1])
    assert np.allclose(R @ (target - eye), [0, 0, 4])
    assert np.allclose(R @ [0, 0, 1], [0, -1, 0])  # up is up: OpenCV's y points down
    assert np.allclose(R @ R.T, np.eye(3))
    assert np.linalg.det(R) > 0


def test_a_person_in_t_pose_is_narrow_from_the_side(body):
    poses = np.zeros((1, body.K + 1, 3))
    poses[0, 0] = log(R_WORLD_MODEL)
    trans = np.array([[0, 0, 0.95]]) - body.rest_joints()[0]
    motion = made_motion(body, poses, trans)
    drawn = np.ptp(side_view([motion], body, 0).astype(int), axis=2) > 10
    rows = np.flatnonzero(drawn.any(axis=1))
    columns = np.flatnonzero(drawn.any(axis=0))
    assert np.ptp(rows) > 200  # 1.7 of 2.4 m in 360 pixels
    assert np.ptp(columns) < 90  # the arms point at the camera


def test_everybody_is_in_the_view_from_the_side(body):
    poses = np.zeros((1, 3 * (body.K + 1)))
    apart = np.array([[0.0, 4.0, 0.0]])
    one, other = (made_motion(body, poses, trans) for trans in (np.zeros((1, 3)), apart))
    alone = np.ptp(side_view([one], body, 0).astype(int), axis=2) > 10
    drawn = np.ptp(side_view([one, other], body, 0).astype(int), axis=2) > 10
    columns = drawn.any(axis=0)
    assert np.flatnonzero(np.diff(columns.astype(int))).size == 4  # two people, next to each other
    assert not drawn[[0, -1]].any()
    assert not drawn[:, [0, -1]].any()
    assert drawn.sum() < 2 * alone.sum()
