# SPDX-License-Identifier: GPL-3.0-or-later
"""The content of one person's motion file, from a motion in the camera frame and the world."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver import rotations
from ....solver.body import Body
from ...arrays import Float32Array, Float64Array, FloatArray
from ...footage_view import AS_IN_FILE, FootageView
from ...kinematics.contact_points import SOLES
from ...kinematics.frame_blocks import by_blocks
from ...motion import Motion
from ..camera.intrinsics import Camera
from ..camera.line_segments import Lines
from ..camera.odometry import Odometry
from ..fitting.hand_measurements import HAND_KEYPOINT_NAMES
from ..perception.landmark_network import KEYPOINT_NAMES
from ..tracking.expression_motion import expression_motion
from ..tracking.track import Track
from .camera_path import CameraPath
from .placement import (
    PlacedTrack,
    RawMotion,
    joints_and_contact_points,
    rotation_vectors_of_joints,
)

MIN_CONFIDENCE = 0.5  # of keypoints that count in the reprojection error
MIN_DEPTH_M = 1e-3


def assemble_motion(
    shot: Shot,
    track: Track,
    body: Body,
    raw: RawMotion,
    placed: PlacedTrack,
    contact: FloatArray,
    T_world_camera: Float64Array,
) -> Motion:
    """Transform a person's motion to the world, and add what else is known of each frame.

    Rotations relative to the parent do not depend on the world; R_world_root = R_world_camera
    R_camera_root and trans = T_world_camera t_camera_root − J_0(β).

    :param track: with the expressions of its face.
    :param body: with its keypoints where the network places them, for the reprojection error.
    :param raw: the motion of which every frame was fitted alone.
    :param placed: the final motion: its rotations and root, in the first frame's camera axes.
    :param contact: (T, 6) probability that each sole point and palm rests on something.
    :param T_world_camera: (4, 4) the first frame's camera to the world that all people share.
    """
    betas = placed.betas
    path = shot.path
    J0 = shot.body.rest_joints(betas)[0]
    poses_raw, trans_raw = _to_world(
        T_world_camera, J0, raw.R_first_root, raw.t_first_root, raw.joints
    )
    poses, trans = _to_world(
        T_world_camera,
        J0,
        placed.rotations[:, 0],
        placed.root,
        rotation_vectors_of_joints(placed.rotations),
    )
    joints, _ = joints_and_contact_points(placed.body, betas, placed.rotations, placed.root)
    seen = track.as_seen(shot.camera)
    keypoints = np.concatenate([seen.keypoints_px, seen.confidence[..., None]], axis=-1)
    names: tuple[str, ...] = KEYPOINT_NAMES
    if seen.hands is not None:
        keypoints = np.concatenate(
            [keypoints, seen.hands[..., :3].reshape(len(track), -1, 3)], axis=1
        )
        names += HAND_KEYPOINT_NAMES
    sigma = raw.joint_sigma_m
    face = {}
    if track.face is not None:
        face = expression_motion(track.face, placed.times, shot.smoothing)
    return Motion(
        poses=poses,
        trans=trans,
        poses_raw=poses_raw,
        trans_raw=trans_raw,
        betas=betas,
        body_model=shot.body.name,
        gender=shot.body.gender,
        mocap_framerate=float(shot.fps),
        frames=track.frames,
        timestamps=placed.times,
        valid=placed.valid,
        joints_cam=path.points_to_frames(joints).astype(np.float32, copy=False),
        keypoints2d=keypoints,
        keypoints2d_names=np.array(names),
        intrinsics=shot.camera.intrinsics,
        dist=shot.camera.dist,
        joint_confidence=raw.joint_confidence,
        world_from_camera=path.world_from_frames(T_world_camera),
        foot_contact=contact[:, : len(SOLES)],
        residual_px=reprojection_error(shot, track, body, placed),
        image_size=np.array(shot.image_size),
        source=shot.source,
        joint_sigma_m=None
        if sigma is None
        else np.sqrt((sigma[..., 0] ** 2 + 2.0 * sigma[..., 1] ** 2) / 3.0),
        joint_sigma_depth_m=None if sigma is None else sigma[..., 0],
        height_sigma_m=raw.height_sigma_m,
        uneven_ground=shot.uneven_ground,
        footage_rotation=shot.view.clockwise_deg,
        footage_mirrored=shot.view.is_mirrored,
        footage_speed=shot.speed,
        zoom=track.zoom,
        face=face,
    )


def _to_world(
    T_world_camera: Float64Array,
    J0: Float64Array,
    R_root: FloatArray,
    t_root: FloatArray,
    joints: Float32Array,
) -> tuple[Float32Array, Float64Array]:
    """Return poses (T, 3 (K+1)) and trans (T, 3) of a root and the rotation vectors (T, K, 3) of
    its joints.
    """
    R_world_camera = T_world_camera[:3, :3]
    t_world_camera = T_world_camera[:3, 3]

    def to_world(
        R: NDArray[Any], t: NDArray[Any], joints: NDArray[Any]
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        root = rotations.log(R_world_camera @ R).astype(np.float32)
        poses = np.concatenate([root[:, None], joints], axis=1)
        return poses.reshape(len(poses), -1), t @ R_world_camera.T + t_world_camera - J0

    poses, trans = by_blocks(to_world, R_root, t_root, joints)
    return poses, trans


def reprojection_error(shot: Shot, track: Track, body: Body, placed: PlacedTrack) -> Float64Array:
    """Return the (T,) median reprojection error of confident keypoints, in pixels; 0 where the
    person was not seen.

    :param placed: the motion: its rotations and root, in the first frame's camera axes.
    """
    betas = placed.betas
    camera = shot.camera
    at = body.keypoint_set("blazepose")
    order = [at[name] for name in KEYPOINT_NAMES]
    K = camera.intrinsics
    J0 = body.rest_joints(betas)[0]

    def error(rotation: FloatArray, root: FloatArray, *rows: NDArray[Any]) -> tuple[Float64Array]:
        keypoints_px, confidence, valid, R_first_camera, center = rows
        points = body.keypoints(*body.forward_kinematics(rotation, root - J0, betas), betas, order)
        points = CameraPath(R_first_camera, center).points_to_frames(points)
        depth = np.maximum(points[..., 2:], MIN_DEPTH_M)
        projected = points[..., :2] / depth * [K[0, 0], K[1, 1]] + K[:2, 2]
        distance = np.linalg.norm(projected - camera.undistort(keypoints_px), axis=-1)
        distance[confidence < MIN_CONFIDENCE] = np.nan
        known = valid & np.isfinite(distance).any(1)
        median = np.zeros(len(root))
        median[known] = np.nanmedian(distance[known], axis=1)
        return (median,)

    rows = (
        track.keypoints_px,
        track.confidence,
        placed.valid,
        shot.path.R_first_camera,
        shot.path.center,
    )
    error_px: Float64Array = by_blocks(error, placed.rotations, placed.root, *rows)[0]
    return error_px if track.zoom is None else error_px * track.zoom


@dataclass(frozen=True)
class Shot:
    """One continuous recording. Where a motion is in the axes of one camera, this is the first
    frame's camera.
    """

    body: Body  # the one that the motion file names
    camera: Camera
    path: CameraPath  # of the camera, over all frames
    lines: Lines  # of the background, in the first frame's axes
    fps: Fraction
    image_size: tuple[int, int]  # width and height, pixels
    source: str  # name of the footage
    smoothing: bool = True  # False: every frame is fitted alone
    uneven_ground: bool = False  # True: feet rest at any height
    treadmill: bool = False  # people walk in place
    belt_m_s: float = 0.0  # speed with which they travel instead, if it is not 0
    view: FootageView = AS_IN_FILE  # how the footage was turned
    speed: float = 1.0  # how many times as fast as the footage plays everything happened
    travel: Odometry | None = None  # of the camera, up to scale, if the background shows it
    # (n, 3) directions of corners at rest, see `CameraMotion`
    at_rest: Float64Array = field(default_factory=lambda: np.zeros((0, 3)))
    # (3,) of the floor that a travelling camera passes, in the first frame's axes
    floor_up: Float64Array | None = None
    # (4, 4) of the first frame's camera in the world of the path that the user gives; None: no path
    # is given
    T_world_first: Float64Array | None = None
    # What it follows from how far the camera travels, see `ScaledTravel.source`
    travel_source: str | None = None

    @property
    def is_still(self) -> bool:
        """Whether there is only one frame."""
        return len(self.path) == 1
