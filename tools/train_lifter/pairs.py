# SPDX-License-Identifier: GPL-3.0-or-later
"""Read the file of ``render_pairs``."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

MIN_PRESENCE, MIN_SPREAD, MAX_DISAGREEMENT = 0.9, 0.38, 0.2  # otherwise the tracker would reject the detection


def load_pairs(path: Path) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return points, rays, confidences and world landmarks of the pairs that a tracker would accept."""
    with np.load(path) as data:
        good = (data["presence"] >= MIN_PRESENCE) & (data["spread"] >= MIN_SPREAD)
        good &= data["disagreement"] <= MAX_DISAGREEMENT
        return data["points"][good], data["rays"][good], data["confidence"][good], data["world"][good]
