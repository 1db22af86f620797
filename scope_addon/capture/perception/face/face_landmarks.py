# SPDX-License-Identifier: GPL-3.0-or-later
"""The face landmark network: from a region of the image to 478 landmarks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from ..execution import Execution
from ..region import Region
from ..sessions import network_path, open_session
from .face_region import region_from_landmarks

INPUT_SIZE = 256
FACE_POINTS = 478  # the mesh of 468 points, then the right and the left iris, five points each


@dataclass(frozen=True)
class FaceEstimate:
    """The network's estimate for one region.

    ``landmarks`` (478, 3): image pixels, and depth in pixels in the region's axes, away from the camera; ``presence``:
    probability that there is a face; ``region``: the input region; ``eye_light``: see `eye_light`; of faces only.
    """

    landmarks: NDArray[np.float64]
    presence: float
    region: Region
    eye_light: float = 1.0

    @cached_property
    def next_region(self) -> Region:
        """The region to look at in the next frame."""
        return region_from_landmarks(self.landmarks[:, :2])


class FaceNetwork:
    """The landmark network; stateless between calls.

    :raises SetupError: the network has not been built.
    :raises ModelFileError: its file is damaged.
    """

    def __init__(self, threads: int, execution: Execution | None = None) -> None:
        self._session = open_session(network_path("face_landmark"), threads, execution)

    def estimate(self, image_rgb: NDArray[np.uint8], region: Region) -> FaceEstimate:
        """Estimate the face in a region of an (H, W, 3) uint8 RGB image."""
        blob = cv2.dnn.blobFromImage(region.cut(image_rgb, INPUT_SIZE), 1 / 255.0)
        landmarks, presence = self._session.run(["landmarks", "presence"], {"input": blob})
        points = landmarks.reshape(FACE_POINTS, 3).astype(float) / INPUT_SIZE
        depth = region.side_px * points[:, 2:]
        placed = np.concatenate([region.image_from_crop(points[:, :2]), depth], axis=1)
        return FaceEstimate(
            landmarks=placed,
            presence=float(1.0 / (1.0 + np.exp(-presence.item()))),
            region=region,
        )
