# SPDX-License-Identifier: GPL-3.0-or-later
"""Ground truth of a rendered clip: camera, shape, pose and joints of every frame; and the sample
clip's.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.kinematics.axes import transform_points, world_from_level_camera
from ...solver.body import Body
from ...solver.rotations import log
from .choreography import standing_feet

FPS = 30
SIZE = (640, 480)
INTRINSICS = np.array([[940.0, 0.0, 319.5], [0.0, 940.0, 239.5], [0.0, 0.0, 1.0]])
BETAS = np.zeros(10)
_TILT = np.radians(6.3)  # the camera looks slightly down
_HEIGHT = 1.45
_DISTANCE = 4.9

WORLD_FROM_CAMERA = world_from_level_camera(
    np.array([0.0, -np.cos(_TILT), -np.sin(_TILT)]), _HEIGHT
)
WORLD_FROM_CAMERA[1, 3] = -_DISTANCE

# The twelve limb joints by their names in keypoint data sets and in the body; and points of the
# feet's skin.
LIMBS = {
    "Shoulder": "shoulder",
    "Elbow": "elbow",
    "Wrist": "wrist",
    "Hip": "hip",
    "Knee": "knee",
    "Ankle": "ankle",
}
FEET = {"Heel": "heel", "BigToe": "foot_index"}
_SIDES = ("left", "right")


@dataclass(frozen=True)
class Shot:
    """A moving body in front of a static camera."""

    rotations: NDArray[np.float64]  # (T, K+1, 3, 3) joint states, row 0 the root in the world
    trans: NDArray[np.float64]  # (T, 3) metres, world
    betas: NDArray[np.float64]  # (P,)
    intrinsics: NDArray[np.float64]  # (3, 3) pixels
    world_from_camera: NDArray[np.float64]  # (4, 4)
    size: tuple[int, int]  # width, height
    fps: float
    standing: NDArray[np.bool_]  # (T, 2) bool: left, right foot on the floor and at rest

    def __len__(self) -> int:
        return len(self.trans)

    def to_camera(self, points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """Transform points (..., N, 3) to the camera frame, metres."""
        return transform_points(np.linalg.inv(self.world_from_camera), points_world)

    def project(self, points_camera: NDArray[np.float64]) -> NDArray[np.float64]:
        """Project points (..., N, 3) to pixels (..., N, 2), without distortion."""
        return project(points_camera, self.intrinsics)

    def vertices_world(self, body: Body, frame: int) -> NDArray[np.float64]:
        """Return the skin's vertices (V, 3) in one frame, world, metres."""
        return body.skin(
            *body.forward_kinematics(self.rotations[frame], self.trans[frame], self.betas),
            self.betas,
        )


def project(
    points_camera: NDArray[np.float64], intrinsics: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Project points (..., 3) to pixels (..., 2) with intrinsics (3, 3), without distortion."""
    homogeneous = points_camera @ intrinsics.T
    pixels: NDArray[np.float64] = homogeneous[..., :2] / homogeneous[..., 2:]
    return pixels


def sample_shot(rotations: NDArray[np.float64], trans: NDArray[np.float64]) -> Shot:
    """Return the shot of the sample clip with this motion."""
    standing = standing_feet(np.arange(len(trans)) / FPS)
    return Shot(rotations, trans, BETAS, INTRINSICS, WORLD_FROM_CAMERA, SIZE, FPS, standing)


def write_truth(path: Path, body: Body, shot: Shot) -> None:
    """Write the ground truth as plain arrays.

    Keys of the motion file: poses (T, 3(K+1)), trans, betas, joints_cam (T, K+1, 3), intrinsics,
    dist, world_from_camera. In addition frame_index (T,), fps, size, joint_names, standing (T, 2:
    left, right foot flat on the floor); and joints (T, 16, 3), names (16,), uv (T, 16, 2): limbs,
    heels and toes as in keypoint data sets.
    """
    R_world, t_world = body.forward_kinematics(shot.rotations, shot.trans, shot.betas)
    joints_cam = shot.to_camera(t_world)
    skin_cam = shot.to_camera(body.keypoints(R_world, t_world, shot.betas))
    joint = body.joint_names.index
    point = body.keypoint_set("blazepose")
    named = {
        s[0].upper() + k: joints_cam[:, joint(f"{s}_{v}")] for k, v in LIMBS.items() for s in _SIDES
    }
    named |= {
        s[0].upper() + k: skin_cam[:, point[f"{s}_{v}"]] for k, v in FEET.items() for s in _SIDES
    }
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
