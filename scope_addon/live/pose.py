# SPDX-License-Identifier: GPL-3.0-or-later
"""A pose of a live capture, and its JSON values for clients on a socket and for the panel."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver.rotations import quaternion_from_matrix
from ..arrays import Float64Array, FloatArray


class Presence(Enum):
    """Whether the person is seen."""

    SEEN = "seen"
    HELD = "held"  # not seen for a moment: the last pose is repeated
    LOST = "lost"  # not seen for longer, or never yet


@dataclass(frozen=True)
class LivePose:
    """The body in one frame; lengths in metres. Before somebody was seen, the rest pose in front of
    the camera.

    ``rotations`` (K+1, 3, 3): row 0 R_camera_root, the others relative to their parents;
    ``root_cam`` (3,) the pelvis; ``joints`` (K+1, 3) world; ``contact`` (4,) probability that each
    point of the soles rests on the floor; ``raw_rotations`` and ``raw_root_cam``: before smoothing
    and foot locking; ``keypoints`` (33, 3) pixels and confidence, zeros where the person is not
    seen; ``is_settled``: whether size, focal length and floor have been estimated from enough
    frames.
    """

    index: int  # of the source's frame
    timestamp_s: float  # of the source's frame
    presence: Presence
    is_settled: bool
    betas: FloatArray  # (P,)
    rotations: FloatArray
    root_cam: FloatArray
    T_world_camera: Float64Array  # (4, 4)
    joints: FloatArray
    contact: FloatArray
    raw_rotations: FloatArray
    raw_root_cam: FloatArray
    keypoints: FloatArray
    joint_confidence: FloatArray  # (K+1,)
    is_known: bool = True  # whether somebody was seen in this frame or before
    person: int = 0  # which of the people this is, see `LivePeople`

    @property
    def R_world_root(self) -> Float64Array:
        """Rotation (3, 3) of the pelvis."""
        return self.T_world_camera[:3, :3] @ self.rotations[0]


def values(pose: LivePose, latency_ms: float) -> dict[str, Any]:
    """Return a pose as JSON values; without a body before somebody was seen."""
    start = {
        "person": pose.person,
        "frame": pose.index,
        "time_s": round(pose.timestamp_s, 4),
        "latency_ms": round(latency_ms, 1),
        "presence": pose.presence.value,
        "settled": pose.is_settled,
    }
    if not pose.is_known:
        return start
    rotations = np.concatenate([pose.R_world_root[None], pose.rotations[1:]])
    return start | {
        "rotations": _rounded(quaternion_from_matrix(rotations), 5),
        "positions": _rounded(pose.joints, 4),
        "contact": _rounded(pose.contact, 2),
        "betas": _rounded(pose.betas, 3),
    }


def _rounded(array: NDArray[Any], digits: int) -> Any:
    return np.round(np.asarray(array, float), digits).tolist()
