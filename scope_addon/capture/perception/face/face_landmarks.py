# SPDX-License-Identifier: GPL-3.0-or-later
"""The face networks: from a region of the image to 478 landmarks, and from these to the weights of 52 expressions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from .....solver.names import EXPRESSIONS
from ..execution import Execution
from ..region import Region
from ..sessions import network_path, open_session
from .eye_light import eye_light
from .face_region import region_from_landmarks

INPUT_SIZE = 256
FACE_POINTS = 478  # the mesh of 468 points, then the right and the left iris, five points each
# The landmarks that the expression network was trained on, in its order.
EXPRESSION_POINTS = (
    0, 1, 4, 5, 6, 7, 8, 10, 13, 14, 17, 21, 33, 37, 39, 40, 46, 52, 53, 54, 55, 58, 61, 63, 65, 66, 67, 70, 78, 80, 81,
    82, 84, 87, 88, 91, 93, 95, 103, 105, 107, 109, 127, 132, 133, 136, 144, 145, 146, 148, 149, 150, 152, 153, 154,
    155, 157, 158, 159, 160, 161, 162, 163, 168, 172, 173, 176, 178, 181, 185, 191, 195, 197, 234, 246, 249, 251, 263,
    267, 269, 270, 276, 282, 283, 284, 285, 288, 291, 293, 295, 296, 297, 300, 308, 310, 311, 312, 314, 317, 318, 321,
    323, 324, 332, 334, 336, 338, 356, 361, 362, 365, 373, 374, 375, 377, 378, 379, 380, 381, 382, 384, 385, 386, 387,
    388, 389, 390, 397, 398, 400, 402, 405, 409, 415, 454, 466, 468, 469, 470, 471, 472, 473, 474, 475, 476, 477,
)  # fmt: skip
# The expression network's outputs: a weight of the neutral face, then these. It knows nothing of the tongue.
_OF_NETWORK = [k for k, name in enumerate(EXPRESSIONS) if name != "tongueOut"]


@dataclass(frozen=True)
class FaceEstimate:
    """The networks' estimate for one region.

    ``landmarks`` (478, 3): image pixels, and depth in pixels in the region's axes, away from the camera; ``presence``:
    probability that there is a face; ``region``: the input region; ``eye_light``: see `eye_light`.
    """

    landmarks: NDArray[np.float64]
    presence: float
    region: Region
    eye_light: float = 1.0

    @property
    def next_region(self) -> Region:
        """The region to look at in the next frame."""
        return region_from_landmarks(self.landmarks[:, :2])


class FaceNetwork:
    """The landmark and the expression network; stateless between calls.

    :raises SetupError: a network has not been built.
    :raises ModelFileError: a file is damaged.
    """

    def __init__(self, threads: int, folder: Path | None = None, execution: Execution | None = None) -> None:
        self._landmarks = open_session(network_path("face_landmark", folder), threads, execution)
        # It takes a millisecond, which further threads would make longer.
        self._expression = open_session(network_path("face_expression", folder), 1, execution)

    def estimate(self, image_rgb: NDArray[np.uint8], region: Region) -> FaceEstimate:
        """Estimate the face in a region of an (H, W, 3) uint8 RGB image."""
        blob = cv2.dnn.blobFromImage(region.cut(image_rgb, INPUT_SIZE), 1 / 255.0)
        landmarks, presence = self._landmarks.run(["landmarks", "presence"], {"input": blob})
        points = landmarks.reshape(FACE_POINTS, 3).astype(float) / INPUT_SIZE
        depth = region.side_px * points[:, 2:]
        placed = np.concatenate([region.image_from_crop(points[:, :2]), depth], axis=1)
        return FaceEstimate(
            landmarks=placed,
            presence=float(1.0 / (1.0 + np.exp(-presence.item()))),
            region=region,
            eye_light=eye_light(image_rgb, placed) if np.isfinite(placed).all() else 1.0,
        )

    def expression(self, estimate: FaceEstimate) -> NDArray[np.float64]:
        """Estimate the weights (52,) 0..1 of the expressions in the order of `EXPRESSIONS`; 0 of the tongue."""
        points = estimate.landmarks[EXPRESSION_POINTS, :2].astype(np.float32)
        (found,) = self._expression.run(["weights"], {"input": points[None]})
        weights = np.zeros(len(EXPRESSIONS))
        weights[_OF_NETWORK] = found[0, 1:]
        return weights
