# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracklets of people who are at known places."""

from __future__ import annotations

import numpy as np
from scope.scope_addon.capture.tracking.appearance import SIZE
from scope.scope_addon.capture.tracking.track import Tracklet


def seen_at(
    xs: list[float] | np.ndarray,
    first: int = 0,
    side_px: float = 200.0,
    appearance: np.ndarray | None = None,
) -> Tracklet:
    """A tracklet of a body that moves with the hips at these places, one in each frame."""
    body = np.random.default_rng(1).normal(scale=40.0, size=(33, 2))
    return Tracklet(
        rows=list(range(first, first + len(xs))),
        values=[np.pad(body + [x, 200.0], ((0, 0), (0, 4))).astype(np.float32) for x in xs],
        centers_px=[np.array([x, 200.0]) for x in xs],
        sides_px=[side_px] * len(xs),
        appearance=np.zeros(SIZE) if appearance is None else appearance,
    )
