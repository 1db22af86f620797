# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracks of exact keypoints and world landmarks, as of a network that makes no errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from scope.scope_addon.capture.fitting.keypoint_offsets import with_keypoint_offsets
from scope.scope_addon.capture.perception.landmark_network import HIPS, KEYPOINT_NAMES
from scope.scope_addon.capture.tracking.track import Track
from scope.solver import Body


def network_points(
    body: Body, R: np.ndarray, t: np.ndarray, betas: np.ndarray | None = None
) -> np.ndarray:
    """(..., 33, 3) where the landmark network places its keypoints on a body whose parts have the
    rotations R (..., K+1, 3, 3) and positions t (..., K+1, 3).
    """
    at = body.keypoint_set("blazepose")
    betas = np.zeros(body.P) if betas is None else betas
    points = with_keypoint_offsets(body).keypoints(R, t, betas)
    return points[..., [at[name] for name in KEYPOINT_NAMES], :]


def pixels_of(points: np.ndarray, K: np.ndarray) -> np.ndarray:
    """(..., 2) pixels of points (..., 3) in camera axes."""
    projected = points @ K.T
    return projected[..., :2] / projected[..., 2:]


def centred(points: np.ndarray) -> np.ndarray:
    """World landmarks of points (..., 33, 3): the middle of the hips is at 0."""
    return points - points[..., HIPS, :].mean(axis=-2, keepdims=True)


def track_of_points(points: np.ndarray, K: np.ndarray, rate: float = 30.0, **given: Any) -> Track:
    """The track of keypoints (T, 33, 3), metres, camera axes.

    :param given: fields of the track that are others.
    """
    frames = np.arange(len(points))
    exact: dict[str, Any] = {
        "frames": frames,
        "times": frames / rate,
        "seen": np.ones(len(points), bool),
        "keypoints_px": pixels_of(points, K),
        "confidence": np.ones(points.shape[:2]),
        "world_landmarks": centred(points),
        "acquired": frames == 0,
    }
    return Track(**exact | given)
