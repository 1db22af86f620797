# SPDX-License-Identifier: GPL-3.0-or-later
"""The default body walking in front of a camera, and the track of a network without depth."""

from __future__ import annotations

from functools import cache

import numpy as np
from scope.scope_addon.capture.fitting.keypoint_offsets import with_keypoint_offsets
from scope.scope_addon.capture.tracking.track import Track
from scope.solver.body_file import load_body
from scope.solver.rotations import exp


@cache
def someone_walking(
    frames: int, rate: float, heading: float, turn: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """(T, 33, 2) pixels and (T, 33, 3) world landmarks of the walking body, one step of each foot
    per second.
    """
    body = load_body("scope")
    seen = with_keypoint_offsets(body)
    at = list(body.keypoint_set("blazepose").values())
    pixels = []
    world = []
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
        points = seen.keypoints(*body.forward_kinematics(R, np.array([0.3, 0.1, 4.0])))[at]
        world.append(points - points[[23, 24]].mean(axis=0))
        pixels.append(points[:, :2] / points[:, 2:] * 1100.0 + [640.0, 360.0])
    walk = np.array(pixels), np.array(world)
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
