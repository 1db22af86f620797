# SPDX-License-Identifier: GPL-3.0-or-later
"""From a motion in the camera frame to the finished one: world, contact, confidence."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from ....solver import rotations
from ....solver.body import Body
from ...kinematics.contact_points import SOLES
from ...kinematics.frame_blocks import by_blocks
from ...kinematics.smoothing import gaussian_smooth
from ...kinematics.standing import along_sight
from ...motion import Motion
from ..camera.intrinsics import Camera
from ..camera.line_segments import Lines
from ..fitting.hand_measurements import HAND_KEYPOINT_NAMES
from ..fitting.track_fit import FittedTrack, Stance
from ..perception.landmark_network import KEYPOINT_NAMES
from ..tracking.track import Track
from .balance import turn_over_feet
from .camera_path import CameraPath
from .foot_lock import stand_on_floor
from .ground_plane import correct_depth, on_floor
from .placement import PlacedTrack, raw_motion
from .world_frame import estimate_world

STANDING_CUTOFF_HZ = 1.0  # a leg that the floor begins or ceases to bend must not jerk


def corrected_stance(
    placed: PlacedTrack, T_floor_camera: np.ndarray | None, lines: Lines | None, balanced: bool
) -> Stance:
    """What floor, feet and balance say of how far away and how upright a body is, in the first frame's camera axes.

    :param T_floor_camera: (4, 4) the floor at z = 0; None: it is found from this person alone.
    :param balanced: whether weight has to be over feet that stand.
    """
    root = placed.root
    T = T_floor_camera
    if T is None:
        T = estimate_world(placed, lines)
    contact = placed.contact(T[2, :3])
    away = correct_depth(root - placed.center, placed.supports, contact, T, placed.times)
    shift = away[:, None] * along_sight(root - placed.center)
    turn = np.broadcast_to(np.eye(3), (len(root), 3, 3))
    if balanced:
        turn, pivot = turn_over_feet(placed, contact, T[2, :3])
        root = pivot + np.einsum("tij,tj->ti", turn, root - pivot)
    height = (placed.supports + shift[:, None]) @ T[2, :3] + T[2, 3]
    standing = gaussian_smooth(contact * on_floor(height), placed.times, STANDING_CUTOFF_HZ)
    T_frames = np.broadcast_to(T, (len(root), 4, 4))
    return Stance(root + shift, turn, T_frames[:, 2, :3], -T_frames[:, 2, 3], standing)


def assemble_motion(
    body: Body,
    track: Track,
    fitted: FittedTrack,
    placed: PlacedTrack,
    camera: Camera,
    *,
    fps: Fraction,
    image_size: tuple[int, int],
    source: str,
    smoothing: bool,
    seen: Body | None = None,
    hold_feet: bool = True,
    T_world_camera: np.ndarray | None = None,
    floor_m: float = 0.0,
    path: CameraPath | None = None,
    lines: Lines | None = None,
) -> Motion:
    """The motion file's content for one person, from ``fitted`` and the same as ``placed``.

    ``seen``: the body with its keypoints where the network sees them (None: at its own), for what is left over in the
    picture.  ``path``: where each frame's camera was (None: on a stand); "the camera" below is the first frame's.
    ``lines``: of the background, in its axes.

    ``T_world_camera`` (4, 4): the world that several people share, and ``floor_m``, the height in it of what this
    person stands on; None: the world is found from this person alone.

    Rotations relative to the parent do not depend on the world; the root is smoothed in the camera frame, where image
    position and depth have their own noise, and then moved into the world: R_world_root = R_world_camera R_camera_root
    and trans = T_world_camera t_camera_root − J_0(β).
    """
    times, valid, betas = placed.times, placed.valid, placed.betas
    path = path or CameraPath.on_a_stand(len(track))
    local, root = placed.rotations, placed.root
    if T_world_camera is None:
        T_world_camera = estimate_world(placed, lines)
    T_floor_camera = T_world_camera.copy()
    T_floor_camera[2, 3] -= floor_m
    R_world_camera, t_world_camera = T_world_camera[:3, :3], T_world_camera[:3, 3]
    contact = placed.contact(R_world_camera[2])
    J0 = body.rest_joints(betas)[0]

    def in_world(rotation: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        poses = rotations.log(rotation)
        poses[:, 0] = rotations.log(R_world_camera @ rotation[:, 0])
        trans = position @ R_world_camera.T + t_world_camera - J0
        return poses.reshape(len(poses), -1).astype(np.float32), trans

    poses_raw, trans_raw = by_blocks(in_world, *raw_motion(track, fitted, path))
    if smoothing and hold_feet:
        local, root = stand_on_floor(
            placed.body, local, root, betas, lambda *m: placed.place(*m)[1], contact, T_floor_camera, times,
            placed.center,
        )  # fmt: skip
    poses, trans = by_blocks(in_world, local, root)
    joints_cam = path.points_to_frames(placed.place(local, root)[0]).astype(np.float32, copy=False)
    return Motion(
        poses=poses,
        trans=trans,
        poses_raw=poses_raw,
        trans_raw=trans_raw,
        betas=betas,
        body_model=body.name,
        gender=body.gender,
        mocap_framerate=float(fps),
        frames=track.frames,
        timestamps=times,
        valid=valid,
        joints_cam=joints_cam,
        keypoints2d=_keypoints2d(track),
        keypoints2d_names=np.array(KEYPOINT_NAMES if track.hands is None else KEYPOINT_NAMES + HAND_KEYPOINT_NAMES),
        intrinsics=camera.intrinsics,
        dist=camera.dist,
        joint_confidence=fitted.joint_confidence,
        world_from_camera=path.world_from_frames(T_world_camera),
        foot_contact=contact[:, : len(SOLES)],
        residual_px=reprojection_error(seen or body, local, root, betas, track, camera, valid, path),
        image_size=np.array(image_size),
        source=source,
    )


def _keypoints2d(track: Track) -> np.ndarray:
    """(T, J, 3) pixels and confidence of the body's keypoints, and of the hands' where they were looked for."""
    body = np.concatenate([track.keypoints_px, track.confidence[..., None]], axis=-1)
    if track.hands is None:
        return body
    return np.concatenate([body, track.hands[..., :3].reshape(len(track), -1, 3)], axis=1)


def reprojection_error(
    body: Body,
    rotation: np.ndarray,
    root: np.ndarray,
    betas: np.ndarray,
    track: Track,
    camera: Camera,
    valid: np.ndarray,
    path: CameraPath,
) -> np.ndarray:
    """(T,) median distance in pixels between the confident keypoints and the body's own; 0 where nobody was seen.

    :param rotation, root: (T, K+1, 3, 3), (T, 3) the body in the first frame's camera axes.
    """
    at = body.keypoint_set("blazepose")
    order = [at[name] for name in KEYPOINT_NAMES]
    K, J0 = camera.intrinsics, body.rest_joints(betas)[0]

    def error(
        rotation: np.ndarray,
        root: np.ndarray,
        keypoints_px: np.ndarray,
        confidence: np.ndarray,
        valid: np.ndarray,
        R_first_camera: np.ndarray,
        center: np.ndarray,
    ) -> tuple[np.ndarray]:
        points = body.keypoints(*body.forward_kinematics(rotation, root - J0, betas), betas, order)
        points = CameraPath(R_first_camera, center).points_to_frames(points)
        depth = np.maximum(points[..., 2:], 1e-3)
        projected = points[..., :2] / depth * [K[0, 0], K[1, 1]] + K[:2, 2]
        distance = np.linalg.norm(projected - camera.undistort(keypoints_px), axis=-1)
        distance[confidence < 0.5] = np.nan
        known = valid & np.isfinite(distance).any(1)
        median = np.zeros(len(root))
        median[known] = np.nanmedian(distance[known], axis=1)
        return (median,)

    each = (rotation, root, track.keypoints_px, track.confidence, valid, path.R_first_camera, path.center)
    return by_blocks(error, *each)[0]
