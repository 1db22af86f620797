# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known exactly about a rendered clip: camera, shape, pose and joints of every frame; and the sample clip's."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...scope_addon.kinematics.axes import transform_points, world_from_level_camera
from ...solver.body import Body
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

# The twelve limb joints by the names that keypoint data sets use, and ours; and points of the feet's skin.
LIMBS = {"Shoulder": "shoulder", "Elbow": "elbow", "Wrist": "wrist", "Hip": "hip", "Knee": "knee", "Ankle": "ankle"}
FEET = {"Heel": "heel", "BigToe": "foot_index"}
_SIDES = ("left", "right")


@dataclass(frozen=True)
class Shot:
    """A body that moves before a camera that stands."""

    rotations: np.ndarray  # (T, K+1, 3, 3) joint states, row 0 the root in the world
    trans: np.ndarray  # (T, 3) metres, world
    betas: np.ndarray  # (P,)
    intrinsics: np.ndarray  # (3, 3) pixels
    world_from_camera: np.ndarray  # (4, 4)
    size: tuple[int, int]  # width, height
    fps: float
    standing: np.ndarray  # (T, 2) bool: left, right foot on the floor and still

    def __len__(self) -> int:
        return len(self.trans)

    def to_camera(self, points_world: np.ndarray) -> np.ndarray:
        """(..., N, 3) points in the camera's frame."""
        return transform_points(np.linalg.inv(self.world_from_camera), points_world)

    def project(self, points_camera: np.ndarray) -> np.ndarray:
        """(..., N, 2) pixels, without distortion."""
        homogeneous = points_camera @ self.intrinsics.T
        return homogeneous[..., :2] / homogeneous[..., 2:]

    def vertices_world(self, body: Body, frame: int) -> np.ndarray:
        """(V, 3) the skin in one frame."""
        return body.skin(*body.forward_kinematics(self.rotations[frame], self.trans[frame], self.betas), self.betas)


def sample_shot(rotations: np.ndarray, trans: np.ndarray) -> Shot:
    """The sample clip with this motion."""
    standing = standing_feet(np.arange(len(trans)) / FPS)
    return Shot(rotations, trans, BETAS, INTRINSICS, WORLD_FROM_CAMERA, SIZE, FPS, standing)


def write_truth(path: Path, body: Body, shot: Shot) -> None:
    """Write the truth as plain arrays.

    Keys of the motion file: poses (T, 3(K+1)), trans, betas, joints_cam (T, K+1, 3), intrinsics, dist,
    world_from_camera. Beside them frame_index (T,), fps, size, joint_names, standing (T, 2: left, right foot flat on
    the floor); and joints (T, 16, 3), names (16,), uv (T, 16, 2): limbs, heels and toes as data sets with keypoints
    have them.
    """
    R_world, t_world = body.forward_kinematics(shot.rotations, shot.trans, shot.betas)
    joints_cam = shot.to_camera(t_world)
    skin_cam = shot.to_camera(body.keypoints(R_world, t_world, shot.betas))
    joint, point = body.joint_names.index, body.keypoint_set("blazepose")
    named = {s[0].upper() + k: joints_cam[:, joint(f"{s}_{v}")] for k, v in LIMBS.items() for s in _SIDES}
    named |= {s[0].upper() + k: skin_cam[:, point[f"{s}_{v}"]] for k, v in FEET.items() for s in _SIDES}
    joints = np.stack(list(named.values()), axis=1)
    np.savez_compressed(
        path,
        poses=log(shot.rotations).reshape(len(shot), -1).astype(np.float32),
        trans=shot.trans.astype(np.float32),
        betas=shot.betas.astype(np.float32),
        body_model=body.name,
        joints_cam=joints_cam.astype(np.float32),
        joint_names=np.array(body.joint_names),
        intrinsics=shot.intrinsics,
        dist=np.zeros(5),
        world_from_camera=shot.world_from_camera,
        frame_index=np.arange(len(shot)),
        fps=float(shot.fps),
        size=np.array(shot.size),
        standing=shot.standing,
        joints=joints.astype(np.float32),
        names=np.array(list(named)),
        uv=shot.project(joints).astype(np.float32),
    )
