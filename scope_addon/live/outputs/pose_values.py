# SPDX-License-Identifier: GPL-3.0-or-later
"""A pose as JSON values, for clients on a socket and for the panel."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver.rotations import quaternion_from_matrix
from ..pose import LivePose


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
