# SPDX-License-Identifier: GPL-3.0-or-later
"""The travel of a camera that follows a walking person, from feet with known steps."""

import numpy as np
import pytest
from scope.scope_addon.capture.fitting.frame_sequence import FittedTrack
from scope.scope_addon.capture.fitting.prepared_track import Stance
from scope.scope_addon.capture.world.camera_path import CameraPath, camera_travel
from scope.solver.rotations import exp

UP = np.array([0.0, -1.0, 0.0])  # OpenCV's axes, a level camera
FPS = 30.0
T = 150
TIMES = np.arange(T) / FPS


def steps(speed, period=1.0, duty=0.6):
    """(T, 4, 3) soles of a walk along +x at z = 4 m, 1 m below the camera: each foot is in contact,
    then swings.
    """
    soles = np.zeros((T, 4, 3))
    for foot, shift in ((0, 0.0), (1, 0.0), (2, 0.5), (3, 0.5)):
        phase = TIMES / period + shift
        whole = np.floor(phase)
        share = phase % 1.0
        swing = np.clip((share - duty) / (1 - duty), 0, 1)
        ahead = (whole + swing - shift) * speed * period
        lift = 0.15 * np.sin(np.pi * swing)
        soles[:, foot] = np.stack([ahead + 0.2 * (foot % 2), 1.0 - lift, np.full(T, 4.0)], axis=1)
    return soles


def travel(soles, center, noise=0.0, times=TIMES):
    """The travel found of a camera that is at ``center`` (T, 3) in truth."""
    noise_m = noise * np.random.default_rng(0).standard_normal(soles.shape)
    seen = soles - center[:, None] + noise_m
    return camera_travel(seen, np.ones(len(times), bool), UP, times, uneven_ground=False)


@pytest.mark.parametrize("speed", [0.8, 3.0])
def test_a_camera_that_follows_a_walker(speed):
    center = np.stack([speed * TIMES, 0 * TIMES, 0.1 * TIMES], axis=1)
    found = travel(steps(speed), center, 0.004)
    assert np.linalg.norm(found[-1] - center[-1]) < 0.1 * np.linalg.norm(center[-1])
    np.testing.assert_array_equal(found[0], 0.0)
    assert np.abs(found @ UP).max() < 1e-9  # over the floor, not up


def test_a_camera_that_speeds_up():
    center = np.stack([0.8 * TIMES + 0.1 * TIMES**2, 0 * TIMES, 0 * TIMES], axis=1)
    found = travel(steps(1.2), center)
    assert np.abs(found - center)[:, 0].max() < 0.15 * center[-1, 0]


def test_a_camera_does_not_travel_from_one_scene_into_the_next():
    center = np.stack([1.4 * TIMES, 0 * TIMES, 0 * TIMES], axis=1)
    times = TIMES + np.where(np.arange(T) < T // 2, 0.0, 10.0)
    found = travel(steps(1.4), center, times=times)
    assert np.linalg.norm(np.diff(found, axis=0), axis=1).max() < 2 * 1.4 / FPS
    assert abs(found[-1, 0] - center[-1, 0]) < 0.1 * center[-1, 0]


def test_feet_at_rest_imply_a_static_camera():
    np.testing.assert_array_equal(travel(steps(1.4), np.zeros((T, 3)), 0.004), 0.0)


def test_feet_that_slide_in_all_directions_give_no_travel():
    rng = np.random.default_rng(1)
    soles = np.cumsum(0.05 * rng.standard_normal((T, 4, 3)), axis=0) + [0, 1.0, 4.0]
    np.testing.assert_array_equal(travel(soles, np.zeros((T, 3))), 0.0)
    np.testing.assert_array_equal(travel(soles[:5], np.zeros((5, 3)), times=TIMES[:5]), 0.0)


def test_transforming_along_a_path_and_back():
    rng = np.random.default_rng(2)
    path = CameraPath(exp(0.3 * rng.standard_normal((5, 3))), rng.standard_normal((5, 3)))
    fit = FittedTrack(
        exp(rng.standard_normal((5, 24, 3))),
        rng.standard_normal((5, 3)),
        np.zeros(10),
        np.ones(5, bool),
        np.ones((5, 24)),
        1.0,
    )
    there = path.to_first(fit)
    np.testing.assert_allclose(
        there.t_camera_root[2], path.R_first_camera[2] @ fit.t_camera_root[2] + path.center[2]
    )
    back = path.points_to_frames(there.t_camera_root[:, None])[:, 0]
    np.testing.assert_allclose(back, fit.t_camera_root, atol=1e-12)
    # the same point through each frame's camera and through the first frame's axes ends at the same
    # place in the world
    T_world_first = np.eye(4)
    T_world_first[:3, :3] = exp([0.1, 0.2, 0.3])
    T_world_first[:3, 3] = [1, 2, 3]
    points = rng.standard_normal((5, 7, 3))
    frames = path.world_from_frames(T_world_first)
    local = path.points_to_frames(points)
    through = np.einsum("tij,tkj->tki", frames[:, :3, :3], local) + frames[:, None, :3, 3]
    np.testing.assert_allclose(
        through, points @ T_world_first[:3, :3].T + T_world_first[:3, 3], atol=1e-12
    )
    assert CameraPath.static(3).is_static
    assert not path.is_static


def test_a_stance_is_the_same_in_every_camera():
    """Heights above the floor, the pelvis and rotated directions are the same in all axes."""
    rng = np.random.default_rng(3)
    path = CameraPath(exp(0.3 * rng.standard_normal((5, 3))), rng.standard_normal((5, 3)))
    up = exp([0.1, 0.2, 0.3]) @ [0.0, -1.0, 0.0]
    first = Stance(
        root_cam=rng.standard_normal((5, 3)),
        turn=exp(0.1 * rng.standard_normal((5, 3))),
        floor_normal=np.tile(up, (5, 1)),
        floor_offset=np.full(5, -1.4),
        contact=rng.uniform(size=(5, 4)),
        resting=rng.uniform(size=(5, 4)),
    )
    frames = path.stance_to_frames(first)
    points = rng.standard_normal((5, 1, 3))
    seen = path.points_to_frames(points)[:, 0]
    height = (seen * frames.floor_normal).sum(axis=1) - frames.floor_offset
    np.testing.assert_allclose(height, points[:, 0] @ up + 1.4, atol=1e-12)
    np.testing.assert_allclose(
        path.points_to_frames(first.root_cam[:, None])[:, 0], frames.root_cam
    )
    turned = np.einsum(
        "tij,tj->ti",
        path.R_first_camera,
        np.einsum("tij,tj->ti", frames.turn, seen - frames.root_cam),
    )
    expected = np.einsum("tij,tj->ti", first.turn, points[:, 0] - first.root_cam)
    np.testing.assert_allclose(turned, expected, atol=1e-12)
    np.testing.assert_array_equal(frames.contact, first.contact)
    assert CameraPath.static(5).stance_to_frames(first) is first
