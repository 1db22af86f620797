# SPDX-License-Identifier: GPL-3.0-or-later
"""The default body walking in front of a camera, and the track of a network without depth."""

from __future__ import annotations

from functools import cache

import numpy as np
from scope.scope_addon.capture.tracking.track import Track
from scope.solver.body_file import load_body
from scope.solver.rotations import exp

from .exact_tracks import centred, network_points, pixels_of

K = np.array([[1100.0, 0, 640], [0, 1100.0, 360], [0, 0, 1]])


@cache
def someone_walking(
    frames: int, rate: float, heading: float, turn: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """(T, 33, 2) pixels and (T, 33, 3) world landmarks of the walking body, one step of each foot
    per second.
    """
    body = load_body("scope")
    poses = []
    for k in range(frames):
        swing = 0.5 * np.sin(2 * np.pi * k / rate)
        pose = np.zeros((body.K + 1, 3))
        for name, axis, angle in (
            ("left_hip", 0, -swing),
            ("right_hip", 0, swing),
            ("left_knee", 0, 0.4),
            ("right_knee", 0, 0.4),
            ("left_shoulder", 2, -1.2),
            ("right_shoulder", 2, 1.2),
            ("left_elbow", 1, -0.5 + 0.4 * swing),
            ("right_elbow", 1, 0.5 + 0.4 * swing),
        ):
            pose[body.joint_names.index(name), axis] += angle
        R = exp(pose)
        R[0] = np.diag([1.0, -1.0, -1.0]) @ exp(np.array([0, heading + turn * k / rate, 0])) @ R[0]
        poses.append(R)
    pelvis = np.tile([0.3, 0.1, 4.0], (frames, 1))
    points = network_points(body, *body.forward_kinematics(np.array(poses), pelvis))
    walk = pixels_of(points, K), centred(points)
    for values in walk:
        values.setflags(write=False)  # the next test gets them, too
    return walk


def track_without_depth(
    pixels: np.ndarray, rate: float, references: dict[int, np.ndarray]
) -> Track:
    count = len(pixels)
    return Track(
        frames=np.arange(count),
        times=np.arange(count) / rate,
        seen=np.ones(count, bool),
        keypoints_px=pixels,
        confidence=np.tile(np.where(np.arange(33) % 2 == 0, 0.9, 0.8), (count, 1)),
        world_landmarks=np.zeros((count, 33, 3)),
        acquired=np.arange(count) == 0,
        reference_rows=np.array(list(references), np.int64),
        reference_landmarks=np.array(list(references.values())).reshape(-1, 33, 3),
    )
