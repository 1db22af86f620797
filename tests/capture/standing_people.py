# SPDX-License-Identifier: GPL-3.0-or-later
"""People who stand, and may step up or down, as exact keypoints and world landmarks of a network;
for tests with `exact_lifting`.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from scope.scope_addon.capture.camera.intrinsics import Camera
from scope.scope_addon.capture.camera.line_segments import Lines
from scope.scope_addon.capture.tracking.track import Track
from scope.scope_addon.capture.world.assemble import Shot
from scope.scope_addon.capture.world.camera_path import CameraPath
from scope.scope_addon.kinematics.axes import transform_points, world_from_level_camera
from scope.solver.body_file import load_body
from scope.solver.rotations import exp

from .exact_tracks import network_points, track_of_points

BODY = load_body("scope")
RATE = 15.0
STAYS_S = 1.5
STEPS_S = 0.4
DEEPER_M = 0.3
K = np.array([[900.0, 0, 640], [0, 900.0, 360], [0, 0, 1]])
T_CAMERA_WORLD = np.linalg.inv(world_from_level_camera(np.array([0.0, -1.0, 0.0]), height=1.3))


def steps(
    height_m: float,
    betas: np.ndarray | None = None,
    right_m: float = 0.0,
    T_camera_world: np.ndarray = T_CAMERA_WORLD,
) -> Track:
    """Return the track of a person 3.5 m from the camera who stands, steps up by ``height_m``, and
    stands again.

    :param T_camera_world: (4, 4), or (T, 4, 4) of a camera that moves.
    """
    betas = np.zeros(BODY.P) if betas is None else betas
    times = np.arange(round((2 * STAYS_S + STEPS_S) * RATE)) / RATE
    share = np.clip((times - STAYS_S) / STEPS_S, 0.0, 1.0)
    bent = np.sin(np.pi * share)
    pose = np.zeros((len(times), BODY.K + 1, 3))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        pose[:, BODY.joint_names.index(f"{side}_hip"), 0] = -0.8 * bent
        pose[:, BODY.joint_names.index(f"{side}_knee"), 0] = 1.4 * bent
        pose[:, BODY.joint_names.index(f"{side}_shoulder"), 2] = -1.2 * sign
    rotations = exp(pose)
    # model y up to world z up
    facing = exp(np.array([np.pi / 2, 0.0, 0.0])) @ exp(np.array([0.0, 0.7, 0.0]))
    R, t = BODY.forward_kinematics(
        np.concatenate([facing[None], rotations[0, 1:]]), np.zeros(3), betas
    )
    standing_m = -BODY.skin(R, t, betas)[:, 2].min()
    trans = np.stack(
        [right_m + 0.4 * share, 3.5 + DEEPER_M * share, standing_m + height_m * share], axis=1
    )
    return track_of(rotations, facing, trans, betas, T_camera_world)


def track_of(
    rotations: np.ndarray,
    facing: np.ndarray,
    trans: np.ndarray,
    betas: np.ndarray,
    T_camera_world: np.ndarray = T_CAMERA_WORLD,
) -> Track:
    """Return the exact track of a body whose root (3, 3) keeps its direction in the world.

    :param rotations: (T, K + 1, 3, 3), of which the root's are replaced.
    :param trans: (T, 3) in the world, as SMPL means it.
    """
    rotations = rotations.copy()
    rotations[:, 0] = T_camera_world[..., :3, :3] @ facing
    pelvis = BODY.rest_joints(betas)[0]
    root = transform_points(T_camera_world, (trans + pelvis)[:, None])[:, 0]
    poses = BODY.forward_kinematics(rotations, root - pelvis, betas)
    points = network_points(BODY, *poses, betas)
    return track_of_points(points, K, RATE, confidence=np.full(points.shape[:2], 0.9))


def seen(track: Track, uneven_ground: bool = False) -> Shot:
    """What is known of the footage: a static camera without background, whose intrinsics are
    given.
    """
    return Shot(
        BODY,
        Camera(K, np.zeros(5), "given"),
        CameraPath.static(len(track)),
        Lines.none(),
        Fraction(int(RATE)),
        (1280, 720),
        "made",
        uneven_ground=uneven_ground,
    )
