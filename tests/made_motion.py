# SPDX-License-Identifier: GPL-3.0-or-later
"""A motion as a capture gives it, of which a test says what matters to it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scope.scope_addon.kinematics.face import EXPRESSIONS
from scope.scope_addon.motion import _SCHEMA, Motion
from scope.solver.body import Body


def made_motion(
    body: Body, poses: np.ndarray, trans: np.ndarray, rate: float = 30.0, **given
) -> Motion:
    """Poses (T, 3(K+1)) or (T, K+1, 3) and trans (T, 3) of the mean shape, seen in every frame by a
    VGA camera.

    :param given: other fields of `Motion`, in place of what stands below.
    """
    T = len(poses)
    K1 = body.K + 1
    poses = poses.reshape(T, 3 * K1)
    fields: dict[str, Any] = {
        "poses": poses,
        "trans": trans,
        "poses_raw": poses,
        "trans_raw": trans,
        "betas": np.zeros(body.P),
        "body_model": body.name,
        "gender": "neutral",
        "mocap_framerate": rate,
        "frames": np.arange(T),
        "timestamps": np.arange(T) / rate,
        "valid": np.ones(T, bool),
        "joints_cam": np.zeros((T, K1, 3)),
        "keypoints2d": np.zeros((T, 1, 3)),
        "keypoints2d_names": np.array(["nose"]),
        "intrinsics": np.array([[600.0, 0, 320], [0, 600.0, 240], [0, 0, 1]]),
        "dist": np.zeros(5),
        "joint_confidence": np.ones((T, K1)),
        "world_from_camera": level_camera(T),
        "foot_contact": np.zeros((T, 4)),
        "residual_px": np.zeros(T),
        "image_size": np.array([640, 480]),
        "source": "walk.mp4",
    }
    return Motion(**(fields | given))


def rows_of(motion: Motion, rows: slice) -> Motion:
    """Some rows of a motion of one scene."""
    names = [name for name, (shape, _) in _SCHEMA.items() if shape[:1] == ("T",)]
    return replace(
        motion,
        scene_starts=np.zeros(0, np.int64),
        **{name: getattr(motion, name)[rows] for name in names},
    )


def made_face(T: int, **weights: np.ndarray | float) -> dict[str, np.ndarray]:
    """The arrays of a face that is seen in T frames and looks ahead; ``weights`` of expressions,
    others are 0.
    """
    expressions = np.zeros((T, len(EXPRESSIONS)))
    for name, values in weights.items():
        expressions[:, EXPRESSIONS.index(name)] = values
    return {
        "expressions": expressions,
        "expression_names": np.array(EXPRESSIONS),
        "expression_confidence": np.ones(T),
        "gaze": np.tile([0.0, 0.0, 1.0], (T, 2, 1)),
        "face_points": np.full((T, 3, 2), 50.0),
        "face_landmarks": np.array([1, 33, 263]),
    }


def made_views(*offsets_s: float, turn: float = 1.0) -> dict[str, np.ndarray]:
    """The arrays of further cameras, each turned by an angle more about the vertical through a
    point 4 m before the first one.
    """
    T_view_camera = np.tile(np.eye(4), (len(offsets_s), 1, 1))
    for k, T in enumerate(T_view_camera, 1):
        c = np.cos(k * turn)
        s = np.sin(k * turn)
        T[:3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
        T[:3, 3] = [-4.0 * s, 0.0, 4.0 - 4.0 * c]
    V = len(offsets_s)
    return {
        "view_sources": np.array([f"walk{k + 2}.mp4" for k in range(V)]),
        "view_intrinsics": np.tile([[500.0, 0, 300], [0, 510.0, 210], [0, 0, 1]], (V, 1, 1)),
        "view_dist": np.zeros((V, 5)),
        "view_image_sizes": np.tile([600, 400], (V, 1)),
        "view_frame_rates": np.full(V, 60.0),
        "view_from_camera": T_view_camera,
        "view_offsets_s": np.array(offsets_s),
    }


def level_camera(T: int) -> np.ndarray:
    """(T, 4, 4) world_from_camera of a camera at (0, -4, 1) that looks along y."""
    out = np.tile(np.eye(4), (T, 1, 1))
    out[:, :3] = [[1, 0, 0, 0], [0, 0, 1, -4], [0, -1, 0, 1]]
    return out
