# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known exactly about the sample clip: camera, shape, pose and joints of every frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...solver.body import Body
from ...solver.frames import transform_points, world_from_level_camera
from ...solver.rotations import log
from .choreography import standing_feet

FPS = 30
SIZE = (640, 480)
INTRINSICS = np.array([[940.0, 0.0, 319.5], [0.0, 940.0, 239.5], [0.0, 0.0, 1.0]])
BETAS = np.zeros(10)
_TILT = np.radians(6.3)  # the camera looks down a little
_HEIGHT, _DISTANCE = 1.45, 4.9

WORLD_FROM_CAMERA = world_from_level_camera(np.array([0.0, -np.cos(_TILT), -np.sin(_TILT)]), _HEIGHT)
WORLD_FROM_CAMERA[1, 3] = -_DISTANCE

# The twelve limb joints by the names that keypoint data sets use, and ours.
LIMBS = {"Shoulder": "shoulder", "Elbow": "elbow", "Wrist": "wrist", "Hip": "hip", "Knee": "knee", "Ankle": "ankle"}


def write_truth(path: Path, body: Body, rotations: np.ndarray, trans: np.ndarray) -> None:
    """Write the truth as plain arrays.

    Keys of the motion file: poses (T, 3(K+1)), trans, betas, joints_cam (T, K+1, 3), intrinsics, dist,
    world_from_camera. Beside them frame_index (T,), fps, size, joint_names, standing (T, 2: left, right foot flat on
    the floor); and joints (T, 12, 3), names (12,), uv (T, 12, 2): the limbs as data sets with keypoints have them.
    """
    _, t_world = body.forward_kinematics(rotations, trans, BETAS)
    joints_cam = transform_points(np.linalg.inv(WORLD_FROM_CAMERA), t_world)
    index = {name: i for i, name in enumerate(body.joint_names)}
    limbs = {s[0].upper() + k: index[f"{s}_{v}"] for k, v in LIMBS.items() for s in ("left", "right")}
    joints = joints_cam[:, list(limbs.values())]
    homogeneous = joints @ INTRINSICS.T
    np.savez_compressed(
        path,
        poses=log(rotations).reshape(len(trans), -1).astype(np.float32),
        trans=trans.astype(np.float32),
        betas=BETAS.astype(np.float32),
        body_model=body.name,
        joints_cam=joints_cam.astype(np.float32),
        joint_names=np.array(body.joint_names),
        intrinsics=INTRINSICS,
        dist=np.zeros(5),
        world_from_camera=WORLD_FROM_CAMERA,
        frame_index=np.arange(len(trans)),
        fps=float(FPS),
        size=np.array(SIZE),
        standing=standing_feet(np.arange(len(trans)) / FPS),
        joints=joints.astype(np.float32),
        names=np.array(list(limbs)),
        uv=(homogeneous[..., :2] / homogeneous[..., 2:]).astype(np.float32),
    )
