# SPDX-License-Identifier: GPL-3.0-or-later
"""The hand landmark network: 21 keypoints of one hand in a region of the image; and the palm detector."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .execution import Execution
from .hand_region import region_from_landmarks, region_from_palm
from .landmark_network import disagreement
from .person_detector import decode, make_anchors, merge_overlapping
from .region import Region
from .sessions import network_path, open_session

INPUT_SIZE = 224
HAND_NAMES = (
    "wrist", "thumb_cmc", "thumb_mcp", "thumb_ip", "thumb_tip",
    "index_finger_mcp", "index_finger_pip", "index_finger_dip", "index_finger_tip",
    "middle_finger_mcp", "middle_finger_pip", "middle_finger_dip", "middle_finger_tip",
    "ring_finger_mcp", "ring_finger_pip", "ring_finger_dip", "ring_finger_tip",
    "pinky_mcp", "pinky_pip", "pinky_dip", "pinky_tip",
)  # fmt: skip
HAND_POINTS = len(HAND_NAMES)
_OUTPUTS = ["landmarks", "presence", "handedness", "world"]
PALM_INPUT_SIZE = 192  # of the palm detector
PALM_THRESHOLD = 0.5
_LAYERS = ((8, 2), (16, 6))  # stride, anchors per cell; the three stride-16 layers are combined


@dataclass(frozen=True)
class HandEstimate:
    """The network's estimate for one region.

    ``keypoints_px`` (21, 2) image pixels; ``world_landmarks`` (21, 3) metres in camera axes (x right, y down,
    z forward), the hand's centre at 0; ``presence``: probability that there is a hand; ``left``: probability that it is
    a left hand; ``region``: the input region. Order: `HAND_NAMES`.
    """

    keypoints_px: NDArray[np.float64]
    world_landmarks: NDArray[np.float64]
    presence: float
    left: float
    region: Region

    @property
    def next_region(self) -> Region:
        """The region to look at in the next frame."""
        return region_from_landmarks(self.keypoints_px)

    @property
    def disagreement(self) -> float:
        """Inconsistency of the keypoints in the image and in space, see `PoseEstimate.disagreement`.

        0.08..0.2 for visible hands; up to 0.5 for occluded ones, which the network guesses.
        """
        return disagreement(self.keypoints_px, self.world_landmarks)

    @property
    def size_px(self) -> float:
        """Longer side in pixels of the keypoints' bounding box in the axes of the region; the unit of distances."""
        return float(np.ptp(self.region.crop_from_image(self.keypoints_px), axis=0).max() * self.region.side_px)


class HandNetwork:
    """The hand landmark network; stateless between calls.

    :raises SetupError: the network has not been built.
    :raises ModelFileError: its file is damaged.
    """

    def __init__(self, threads: int, execution: Execution | None = None) -> None:
        self._session = open_session(network_path("hand_landmark"), threads, execution)

    def estimate(self, image_rgb: NDArray[np.uint8], region: Region) -> HandEstimate:
        """Estimate the hand in a region of an (H, W, 3) uint8 RGB image."""
        blob = cv2.dnn.blobFromImage(region.cut(image_rgb, INPUT_SIZE), 1 / 255.0)
        landmarks, presence, handedness, world = self._session.run(_OUTPUTS, {"input": blob})
        points = landmarks.reshape(HAND_POINTS, 3)[:, :2].astype(float) / INPUT_SIZE
        return HandEstimate(
            keypoints_px=region.image_from_crop(points),
            world_landmarks=region.rotate_to_camera(world.reshape(HAND_POINTS, 3).astype(float)),
            presence=float(presence[0, 0]),
            # The network was trained on mirrored selfies: its left hand is a right hand.
            left=1.0 - float(handedness[0, 0]),
            region=region,
        )


class PalmDetector:
    """The palm detection network; stateless between calls.

    :raises SetupError: the network has not been built.
    :raises ModelFileError: its file is damaged.
    """

    def __init__(self, threads: int, execution: Execution | None = None) -> None:
        self._session = open_session(network_path("palm_detection"), threads, execution)
        self._anchors = make_anchors(PALM_INPUT_SIZE, _LAYERS)

    def detect(self, image_rgb: NDArray[np.uint8], square: Region, threshold: float = PALM_THRESHOLD) -> list[Region]:
        """Return the hands' regions by all palms in a square of an (H, W, 3) uint8 RGB image, the best palm first."""
        blob = cv2.dnn.blobFromImage(square.cut(image_rgb, PALM_INPUT_SIZE), 1 / 255.0)
        boxes, scores = self._session.run(["boxes", "scores"], {"input": blob})
        _, values = merge_overlapping(*decode(boxes[0], scores[0, :, 0], self._anchors, threshold))
        return [_in_image(v, square) for v in values]


def _in_image(values: NDArray[np.float64], square: Region) -> Region:
    """Calculate the hand's region in the image from a box and points (18,) in the network's input pixels."""
    unit = values / PALM_INPUT_SIZE
    in_square = region_from_palm(unit[:4], unit[4:].reshape(-1, 2))
    x, y = square.image_from_crop(np.array(in_square.center_px))
    return Region((float(x), float(y)), in_square.side_px * square.side_px, in_square.rotation + square.rotation)
