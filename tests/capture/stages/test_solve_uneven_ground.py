# SPDX-License-Identifier: GPL-3.0-or-later
"""Somebody who steps up or down: exact keypoints and world landmarks, solved with one floor and on uneven ground."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import Camera
from scope.scope_addon.capture.camera.line_segments import Lines
from scope.scope_addon.capture.fitting.ablation import Ablation
from scope.scope_addon.capture.fitting.keypoint_offsets import with_keypoint_offsets
from scope.scope_addon.capture.stages.floor_warnings import floor_warnings
from scope.scope_addon.capture.stages.solve import solve
from scope.scope_addon.capture.tracking.track import Track
from scope.scope_addon.capture.world.camera_path import CameraPath
from scope.scope_addon.capture.world.shot import Shot
from scope.scope_addon.kinematics.axes import transform_points, world_from_level_camera
from scope.scope_addon.kinematics.foot_skin import foot_heights, under_floor
from scope.scope_addon.motion import Motion
from scope.solver.loaders.body_file import load_body
from scope.solver.rotations import exp

BODY = load_body("scope")
RATE, STAYS_S, STEPS_S, DEEPER_M = 15.0, 1.5, 0.4, 0.3
STEP_M = 0.2  # a height at which a foot is taken to be on the floor, unless the ground is uneven
K = np.array([[900.0, 0, 640], [0, 900.0, 360], [0, 0, 1]])
T_CAMERA_WORLD = np.linalg.inv(world_from_level_camera(np.array([0.0, -1.0, 0.0]), height=1.3))


def steps(height_m: float) -> Track:
    """Somebody who stands, steps with bent legs onto something that is higher, and stands; 3.5 m from the camera."""
    times = np.arange(round((2 * STAYS_S + STEPS_S) * RATE)) / RATE
    share = np.clip((times - STAYS_S) / STEPS_S, 0.0, 1.0)
    bent, pose = np.sin(np.pi * share), np.zeros((len(times), BODY.K + 1, 3))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        pose[:, BODY.joint_names.index(f"{side}_hip"), 0] = -0.8 * bent
        pose[:, BODY.joint_names.index(f"{side}_knee"), 0] = 1.4 * bent
        pose[:, BODY.joint_names.index(f"{side}_shoulder"), 2] = -1.2 * sign
    rotations = exp(pose)
    facing = exp(np.array([np.pi / 2, 0.0, 0.0])) @ exp(np.array([0.0, 0.7, 0.0]))  # model y up to world z up
    R, t = BODY.forward_kinematics(np.concatenate([facing[None], rotations[0, 1:]]), np.zeros(3))
    standing_m = -BODY.skin(R, t)[:, 2].min()
    trans = np.stack([0.4 * share, 3.5 + DEEPER_M * share, standing_m + height_m * share], axis=1)
    rotations[:, 0] = T_CAMERA_WORLD[:3, :3] @ facing
    pelvis = BODY.rest_joints(np.zeros(BODY.P))[0]
    poses = BODY.forward_kinematics(rotations, transform_points(T_CAMERA_WORLD, trans + pelvis) - pelvis)
    points = with_keypoint_offsets(BODY).keypoints(*poses)[:, list(BODY.keypoint_set("blazepose").values())]
    pixels = points @ K.T
    return Track(
        frames=np.arange(len(times)),
        times=times,
        seen=np.ones(len(times), bool),
        keypoints_px=pixels[..., :2] / pixels[..., 2:],
        confidence=np.full((len(times), 33), 0.9),
        world_landmarks=points - points[:, [23, 24]].mean(axis=1, keepdims=True),
        acquired=np.arange(len(times)) == 0,
    )


@pytest.fixture(scope="module", params=[STEP_M, -STEP_M], ids=["up", "down"])
def height_m(request: pytest.FixtureRequest) -> float:
    return request.param


@pytest.fixture(scope="module", params=[False, True], ids=["one_floor", "uneven"])
def captured(request: pytest.FixtureRequest, height_m: float) -> Motion:
    track = steps(height_m)
    shot = Shot(
        BODY, Camera(K, np.zeros(5), "given"), CameraPath.static(len(track)), Lines.none(), Fraction(int(RATE)),
        (1280, 720), "made", ablation=Ablation(lifter=False), uneven_ground=request.param,
    )  # fmt: skip
    return solve(shot, [track], lambda *_: None, [BODY.stature()]).motions[0]


def test_feet_rest_on_a_step_only_where_the_ground_is_uneven(captured: Motion, height_m: float) -> None:
    heights = foot_heights(captured, BODY)
    stays = round(STAYS_S * RATE) - 4
    rise = (np.median(heights[-stays:]) - np.median(heights[:stays])) / height_m
    if captured.uneven_ground:
        assert rise == pytest.approx(1.0, abs=0.15)
    else:
        assert rise < 0.6
    for part in (heights[:stays], heights[-stays:]):
        assert np.ptp(part, axis=0).max() < 0.01


def test_nothing_is_under_uneven_ground(captured: Motion) -> None:
    sunk = replace(captured, trans=captured.trans - np.array([0.0, 0.0, 0.3], np.float32))
    warned = floor_warnings("made.mp4", BODY, [sunk])
    assert bool(warned) != captured.uneven_ground
    assert under_floor(sunk, BODY).any() != captured.uneven_ground
