# SPDX-License-Identifier: GPL-3.0-or-later
"""Two people in motions whose contact with the floor is known, as a static camera would see them.

Each is (body with contact points, rotations (T, K+1, 3, 3), root (T, 3), a function from both to
part rotations, joints and contact points, T_world_camera (4, 4), times (T,)), metres, camera frame.
"""

import numpy as np
from scope.scope_addon.kinematics.axes import transform_points, world_from_level_camera
from scope.scope_addon.kinematics.contact_points import contact_point_positions, with_contact_points
from scope.solver import rotations
from scope.solver.body_file import load_body

FPS = 30.0


def placing(body):
    """Return the body with contact points, and what both people's `place` is."""
    supported = with_contact_points(body, np.zeros(body.P))

    def place(local, root):
        R, t = body.forward_kinematics(local, root)
        return R, t, contact_point_positions(supported, R, t)

    return supported, place


def stepping_person():
    """Return a person who raises the left foot for a second, 4 m from a camera 1.5 m high.

    Both knees are always bent a little: straight legs turn far for any change of their length.
    """
    body = load_body("scope")
    T = 90
    times = np.arange(T) / FPS
    T_world_camera = world_from_level_camera(np.array([0.0, -1.0, -0.2]), height=1.5)
    R_camera_world = T_world_camera[:3, :3].T
    lift = np.clip(np.sin((times - 1.0) * np.pi), 0, 1)  # 1 s to 2 s
    omega = np.tile(np.eye(3), (T, body.K + 1, 1, 1))
    names = body.joint_names
    x = np.array([1.0, 0, 0])
    for side, raised in (("left", lift[:, None]), ("right", 0.0 * lift[:, None])):
        omega[:, names.index(f"{side}_hip")] = rotations.exp((-0.06 - 0.97 * raised) * x)
        omega[:, names.index(f"{side}_knee")] = rotations.exp((0.12 + 1.27 * raised) * x)
        omega[:, names.index(f"{side}_ankle")] = rotations.exp(-0.06 * x)
    facing = rotations.exp(np.array([np.pi / 2, 0, 0]))  # model y up to world z up
    omega[:, 0] = R_camera_world @ facing
    supported, place = placing(body)
    root_world = np.tile([0.0, 4.0, 0.0], (T, 1))
    lowest = place(omega, np.zeros((T, 3)))[2][:, 2:4] @ T_world_camera[2, :3]
    root_world[:, 2] = -lowest.min(1)
    root = transform_points(np.linalg.inv(T_world_camera), root_world)
    return supported, omega, root, place, T_world_camera, times


def plank_person():
    """A person on toes and palms for two seconds, seen from the side, 4 m from a camera 1.5 m
    high.
    """
    body = load_body("scope")
    supported, place = placing(body)
    times = np.arange(60) / FPS
    T_world_camera = world_from_level_camera(np.array([0.0, -1.0, -0.2]), height=1.5)
    omega = np.tile(np.eye(3), (body.K + 1, 1, 1))
    for side, sign in (("left", 1), ("right", -1)):
        omega[body.joint_names.index(f"{side}_shoulder")] = rotations.exp([0, -sign * np.pi / 2, 0])
        omega[body.joint_names.index(f"{side}_wrist")] = rotations.exp([0, 0, sign * np.pi / 2])
        omega[body.joint_names.index(f"{side}_ankle")] = rotations.exp([0.5, 0, 0])
    down = rotations.exp(np.array([np.pi, 0, 0]))  # model z down
    pitch = 0.0
    for _ in range(30):  # until toes and palms are level
        omega[0] = (
            rotations.exp(np.array([0, 0, np.pi / 2]))
            @ rotations.exp(np.array([pitch, 0, 0]))
            @ down
        )
        points = place(omega[None], np.zeros((1, 3)))[2][0]
        toes = points[[1, 3]].mean(0)
        palms = points[4:].mean(0)
        pitch += 0.5 * (palms - toes)[2] / np.linalg.norm(palms - toes)
    assert abs((palms - toes)[2]) < 1e-3
    root = np.array([0.0, 4.0, -toes[2]]) - [*points.mean(0)[:2], 0.0]
    camera = np.linalg.inv(T_world_camera)
    root = transform_points(camera, root[None])[0]
    omega[0] = camera[:3, :3] @ omega[0]
    omega, root = (np.repeat(each[None], len(times), axis=0) for each in (omega, root))
    return supported, omega, root, place, T_world_camera, times
