# SPDX-License-Identifier: GPL-3.0-or-later
"""An image with three coloured spots at known pixels, regions of it, and what networks must find
there.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from scope.scope_addon.capture.perception.adapters.description import COCO_17
from scope.scope_addon.capture.perception.adapters.keypoint_network import KeypointNetwork
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from scope.scope_addon.capture.perception.region import Region

# (x, y) of the red, green and blue spot in an image of odd size
SPOTS = np.array([[140.0, 77.0], [171.0, 201.0], [211.0, 133.0]])
REGIONS = {
    "larger": Region((170.3, 141.8), 301.0, 0.0),
    "enlarged": Region((176.0, 138.0), 190.0, 0.0),
    "turned": Region((170.3, 141.8), 340.0, 0.6),
    "over the edge": Region((160.0, 100.0), 330.0, 0.0),
}
SIZES = [(192, 256), (288, 384)]  # of the networks


def spots(sigma: float = 5.0) -> np.ndarray:
    y, x = np.mgrid[:281, :357]
    near = [np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * sigma**2)) for u, v in SPOTS]
    return np.round(255 * np.stack(near, axis=-1)).astype(np.uint8)


def unit_colours(path: Path, **more: object) -> None:
    """Write a JSON that scales pixels to 0..1, as the small graphs need."""
    path.with_suffix(".json").write_text(json.dumps({"mean": 0, "std": 255, **more}))


def assert_finds_the_spots(path: Path, atol: float) -> None:
    unit_colours(path)
    network = KeypointNetwork(path, threads=1)
    assert network.keypoint_set.name == "coco17"
    for where, region in REGIONS.items():
        (seen,) = network.estimate(spots(), [region])
        for k, name in enumerate(COCO_17):
            j = KEYPOINT_NAMES.index(name)
            np.testing.assert_allclose(
                seen.keypoints_px[j], SPOTS[k % 3], atol=atol, err_msg=f"{name}, {where}"
            )
            assert seen.keypoints_confidence[j] > 0.4
        assert seen.presence == 1.0
        assert not seen.world_landmarks.any()
        assert seen.disagreement == 0.0
