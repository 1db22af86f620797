# SPDX-License-Identifier: GPL-3.0-or-later
"""From solved body states in the camera to the finished motion: gaps, smoothing, world, contact, confidence."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from ...solver import rotations
from ...solver.body import Body
from ..motion import Motion
from .camera import Camera
from .fitting import FittedTrack
from .grounding import correct_depth, stand_on_floor, standing_probability
from .landmark_network import KEYPOINT_NAMES
from .smoothing import fill_gaps, fill_rotation_gaps, smooth_root, smooth_rotations
from .track import Track
from .world import estimate_world, sole_points, with_soles


def place_in_camera(
    body: Body, track: Track, fitted: FittedTrack, smoothing: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Joints (T, K+1, 3) and soles (T, 4, 3) of the valid frames, camera frame, metres: what a world is found from."""
    times, valid, J0 = track.times, fitted.valid, body.rest_joints(fitted.betas)[0]
    local = fill_rotation_gaps(fitted.rotations, valid, times)
    root = fill_gaps(fitted.t_camera_root, valid, times)
    if smoothing:
        local, root = smooth_rotations(local, times), smooth_root(root, times)
    R, joints = body.forward_kinematics(local, root - J0, fitted.betas)
    soles = sole_points(with_soles(body, fitted.betas), R, joints)
    return joints[valid], soles[valid]


def root_on_floor(
    body: Body, track: Track, fitted: FittedTrack, T_floor_camera: np.ndarray | None = None
) -> np.ndarray:
    """(T, 3) smoothed pelvis positions in the camera frame, their distance corrected by the floor and standing feet.

    ``T_floor_camera`` (4, 4): the floor at z = 0; None: it is found from this person alone.
    """
    times, J0 = track.times, body.rest_joints(fitted.betas)[0]
    local = smooth_rotations(fill_rotation_gaps(fitted.rotations, fitted.valid, times), times)
    root = smooth_root(fill_gaps(fitted.t_camera_root, fitted.valid, times), times)
    R, joints = body.forward_kinematics(local, root - J0, fitted.betas)
    soles = sole_points(with_soles(body, fitted.betas), R, joints)
    T = estimate_world(body, joints[fitted.valid], soles[fitted.valid]) if T_floor_camera is None else T_floor_camera
    contact = standing_probability(soles, T[2, :3], times) * fitted.valid[:, None]
    away = correct_depth(root, soles, contact, T, times)
    return root + away[:, None] * root / np.linalg.norm(root, axis=1, keepdims=True)


def assemble_motion(
    body: Body,
    track: Track,
    fitted: FittedTrack,
    camera: Camera,
    *,
    fps: Fraction,
    image_size: tuple[int, int],
    source: str,
    smoothing: bool,
    hold_feet: bool = True,
    T_world_camera: np.ndarray | None = None,
    floor_m: float = 0.0,
    R_first_camera: np.ndarray | None = None,
) -> Motion:
    """The motion file's content for one person.

    ``fitted`` is in axes that do not turn, the first frame's; ``R_first_camera`` (T, 3, 3) takes each frame's camera
    axes to them (None: the camera stands still), and the camera is that of the first frame below.

    ``T_world_camera`` (4, 4): the world that several people share, and ``floor_m``, the height in it of what this
    person stands on; None: the world is found from this person alone.

    Rotations relative to the parent do not depend on the world; the root is smoothed in the camera frame, where image
    position and depth have their own noise, and then moved into the world: R_world_root = R_world_camera R_camera_root
    and trans = T_world_camera t_camera_root − J_0(β).
    """
    times, valid, betas = track.times, fitted.valid, fitted.betas
    local_raw = fill_rotation_gaps(fitted.rotations, valid, times)
    root_raw = fill_gaps(fitted.t_camera_root, valid, times)
    local, root = local_raw, root_raw
    if smoothing:
        local, root = smooth_rotations(local_raw, times), smooth_root(root_raw, times)

    J0 = body.rest_joints(betas)[0]
    soled = with_soles(body, betas)

    def place(local: np.ndarray, root: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rotations and positions of all parts, and the soles, in the camera frame."""
        R, t = body.forward_kinematics(local, root - J0, betas)
        return R, t, sole_points(soled, R, t)

    _, joints_cam, soles_cam = place(local, root)
    if T_world_camera is None:
        T_world_camera = estimate_world(body, joints_cam[valid], soles_cam[valid])
    T_floor_camera = T_world_camera.copy()
    T_floor_camera[2, 3] -= floor_m
    R_world_camera, t_world_camera = T_world_camera[:3, :3], T_world_camera[:3, 3]
    contact = standing_probability(soles_cam, R_world_camera[2], times) * valid[:, None]
    if smoothing and hold_feet:
        local, root = stand_on_floor(soled, local, root, betas, place, contact, T_floor_camera, times)
    R_cam, joints_cam, soles_cam = place(local, root)

    def in_world(rotation: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        poses = rotation.copy()
        poses[:, 0] = R_world_camera @ rotation[:, 0]
        trans = position @ R_world_camera.T + t_world_camera - J0
        return rotations.log(poses).reshape(len(poses), -1), trans

    T_world_frame = np.tile(T_world_camera, (len(track), 1, 1))
    if R_first_camera is not None:
        R_camera_first = np.swapaxes(R_first_camera, 1, 2)
        T_world_frame[:, :3, :3] = R_world_camera @ R_first_camera
        R_cam = R_camera_first[:, None] @ R_cam
        joints_cam = np.einsum("tij,tkj->tki", R_camera_first, joints_cam)

    poses, trans = in_world(local, root)
    poses_raw, trans_raw = in_world(local_raw, root_raw)
    return Motion(
        poses=poses,
        trans=trans,
        poses_raw=poses_raw,
        trans_raw=trans_raw,
        betas=betas,
        body_model=body.name,
        gender="neutral",
        mocap_framerate=float(fps),
        frames=track.frames,
        timestamps=times,
        valid=valid,
        joints_cam=joints_cam,
        keypoints2d=np.concatenate([track.keypoints_px, track.confidence[..., None]], axis=-1),
        keypoints2d_names=np.array(KEYPOINT_NAMES),
        intrinsics=camera.intrinsics,
        dist=camera.dist,
        joint_confidence=fitted.joint_confidence,
        world_from_camera=T_world_frame,
        foot_contact=contact,
        residual_px=reprojection_error(body, R_cam, joints_cam, betas, track, camera, valid),
        image_size=np.array(image_size),
        source=source,
    )


def reprojection_error(
    body: Body, R: np.ndarray, t: np.ndarray, betas: np.ndarray, track: Track, camera: Camera, valid: np.ndarray
) -> np.ndarray:
    """(T,) median distance in pixels between the confident keypoints and the body's own; 0 where nobody was seen.

    :param R, t: (T, K+1, 3, 3), (T, K+1, 3) part poses in the camera frame.
    """
    at = body.keypoint_set("blazepose")
    points = body.keypoints(R, t, betas)[:, [at[name] for name in KEYPOINT_NAMES]]
    K = camera.intrinsics
    depth = np.maximum(points[..., 2:], 1e-3)
    projected = points[..., :2] / depth * [K[0, 0], K[1, 1]] + K[:2, 2]
    distance = np.linalg.norm(projected - camera.undistort(track.keypoints_px), axis=-1)
    distance[track.confidence < 0.5] = np.nan
    out = np.zeros(len(track))
    for k in np.flatnonzero(valid & np.isfinite(distance).any(1)):
        out[k] = np.nanmedian(distance[k])
    return out
