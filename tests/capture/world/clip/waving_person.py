# SPDX-License-Identifier: GPL-3.0-or-later
"""Somebody who waves an arm, and what a camera and the lifting network see of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scope.scope_addon.capture.camera.intrinsics import choose_camera
from scope.scope_addon.capture.fitting.frame_sequence import FittedTrack
from scope.scope_addon.capture.fitting.prepared_track import PreparedTrack, prepare_track
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.lifter import Lifted
from scope.scope_addon.capture.tracking.track import Track
from scope.scope_addon.capture.world.camera_path import CameraPath
from scope.scope_addon.capture.world.clip_fit import fit_clip
from scope.solver import load_body
from scope.solver.rotations import exp

from ...exact_tracks import network_points, track_of_points

FPS = 30.0
FRAMES = 24
BODY = load_body("scope")
CAMERA = choose_camera(1080, 1920)
JOINTS = len(KEYPOINT_NAMES)
ARM = [
    KEYPOINT_NAMES.index(f"left_{name}") for name in ("elbow", "wrist", "pinky", "index", "thumb")
]
LEG = [KEYPOINT_NAMES.index(f"right_{name}") for name in ("knee", "ankle", "heel", "foot_index")]


def person(frames: int = FRAMES, path: CameraPath | None = None) -> tuple[Track, FittedTrack]:
    """Somebody upright, 4 m away, one leg bent, who waves an arm up and down once a second.

    :param path: of the camera; by default it is static.
    :return: what the camera sees, and the true states in the first frame's axes.
    """
    rotations = np.tile(np.eye(3), (frames, BODY.K + 1, 1, 1))
    rotations[:, 0] = np.diag([1.0, -1.0, -1.0])  # body y up, OpenCV y down
    for joint, angle in (("right_hip", 0.3), ("right_knee", 0.9)):
        rotations[:, BODY.joint_names.index(joint)] = exp(np.array([angle, 0.0, 0.0]))
    wave = 0.5 * np.sin(2 * np.pi * np.arange(frames) / FPS)
    rotations[:, BODY.joint_names.index("left_shoulder")] = exp(wave[:, None] * [0.0, 0.0, 1.0])
    root = np.tile([0.0, 0.0, 4.0], (frames, 1))
    points = keypoints(rotations, root)
    if path is not None:
        points = path.points_to_frames(points)
    track = track_of_points(points, CAMERA.intrinsics, FPS)
    seen = np.ones((frames, BODY.K + 1))
    return track, FittedTrack(rotations, root, np.zeros(BODY.P), np.ones(frames, bool), seen, 1.0)


def moving_path(frames: int = FRAMES) -> CameraPath:
    """The path of a camera that turns to and fro while it travels."""
    angle = 0.1 * np.sin(np.arange(frames) / 5.0)
    center = np.outer(np.arange(frames), [0.02, 0.0, 0.01])
    return CameraPath(exp(angle[:, None] * [0.0, 1.0, 0.0]), center)


def keypoints(rotations: np.ndarray, root: np.ndarray) -> np.ndarray:
    """The network's keypoints (T, J, 3) of states, in their axes."""
    return network_points(BODY, *BODY.forward_kinematics(rotations, root - BODY.rest_joints()[0]))


def prepare(
    track: Track, lifted_m: np.ndarray | None = None, sigma_m: np.ndarray | float = 0.1
) -> PreparedTrack:
    """The track with lifted points and their deviation; by default those of the track, which are
    exact.
    """
    sigma = np.broadcast_to(sigma_m, (len(track), JOINTS)).copy()
    points = track.world_landmarks if lifted_m is None else lifted_m
    return replace(prepare_track(BODY, track, CAMERA), lifted=Lifted(points, sigma, sigma))


def fit(prepared: PreparedTrack, start: FittedTrack, path: CameraPath | None = None) -> FittedTrack:
    return fit_clip(prepared, start, path or CameraPath.static(len(start.valid)), lambda *_: None)


def joints(fitted: FittedTrack) -> np.ndarray:
    """The joints (T, K+1, 3) in each frame's camera."""
    return BODY.forward_kinematics(
        fitted.rotations, fitted.t_camera_root - BODY.rest_joints(fitted.betas)[0], fitted.betas
    )[1]
