# SPDX-License-Identifier: GPL-3.0-or-later
"""Hands in the image: their landmark network, the palm detector, and the regions that the former
looks at.

A region follows from the body's arm, from a detected palm, or from the hand's keypoints. In each,
the fingers point up from the wrist, and a hand with straight fingers fills half of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...arrays import Float64Array, Uint8Array
from .landmark_network import KEYPOINT_NAMES, disagreement
from .person_detector import decode, make_anchors, merge_overlapping
from .region import Region, box_along, image_input, rotation_towards
from .sessions import Execution, network_path, open_session

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
SIDES = ("left", "right")
HAND_LENGTH_M = 0.18  # wrist to the tip of the middle finger
_ARM = np.array(
    [
        [KEYPOINT_NAMES.index(f"{side}_{name}") for name in ("elbow", "wrist", "index", "pinky")]
        for side in SIDES
    ]
)
ELBOWS = _ARM[:, 0]
WRISTS = _ARM[:, 1]
_STATURE = [
    [KEYPOINT_NAMES.index(f"{side}_{name}") for name in ("shoulder", "hip", "knee", "ankle")]
    for side in SIDES
]
_STATURE_M = 1.35  # shoulder to ankle along the bones
_MIDDLE = 0.45  # distance from the wrist to the hand's centre, in hand lengths
# Side of the region in hand lengths; large, because the body gives only a rough position.
_BODY_SCALE = 1.5
# MediaPipe's: side, and shift towards the fingers, in sides of the palm's box
_PALM_SCALE = 2.6
_PALM_SHIFT = 0.5
# The side of the region in sides of the box of the keypoints below.
_TRACK_SCALE = 2.0
_TRACK_SHIFT = 0.1
# Keypoints of the palm and of the finger bases.
_RIGID = np.array([0, 1, 2, 3, 5, 6, 9, 10, 13, 14, 17, 18])


@dataclass(frozen=True)
class HandEstimate:
    """The network's estimate for one region.

    ``keypoints_px`` (21, 2) image pixels; ``world_landmarks`` (21, 3) metres in camera axes (x
    right, y down, z forward), the hand's centre at 0; ``presence``: probability that there is a
    hand; ``left``: probability that it is a left hand; ``region``: the input region. Order:
    `HAND_NAMES`.
    """

    keypoints_px: Float64Array
    world_landmarks: Float64Array
    presence: float
    left: float
    region: Region

    @property
    def next_region(self) -> Region:
        """The region to look at in the next frame."""
        return region_from_landmarks(self.keypoints_px)

    @property
    def disagreement(self) -> float:
        """Inconsistency of the keypoints in the image and in space, see
        `PoseEstimate.disagreement`.

        0.08..0.2 for visible hands; up to 0.5 for occluded ones, which the network guesses.
        """
        return disagreement(self.keypoints_px, self.world_landmarks)

    @property
    def size_px(self) -> float:
        """Longer side in pixels of the keypoints' bounding box in the axes of the region; the unit
        of distances.
        """
        return float(
            np.ptp(self.region.crop_from_image(self.keypoints_px), axis=0).max()
            * self.region.side_px
        )


class HandNetwork:
    """The hand landmark network; stateless between calls.

    :raises SetupError: the network has not been built.
    :raises ModelFileError: its file is damaged.
    """

    def __init__(self, execution: Execution | None = None) -> None:
        self._session = open_session(network_path("hand_landmark"), 1, execution)

    def estimate(self, image_rgb: Uint8Array, region: Region) -> HandEstimate:
        """Estimate the hand in a region of an (H, W, 3) uint8 RGB image."""
        blob = image_input(region.cut(image_rgb, INPUT_SIZE))
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

    def __init__(self, execution: Execution | None = None) -> None:
        self._session = open_session(network_path("palm_detection"), 1, execution)
        self._anchors = make_anchors(PALM_INPUT_SIZE, _LAYERS)

    def detect(
        self, image_rgb: Uint8Array, square: Region, threshold: float = PALM_THRESHOLD
    ) -> list[Region]:
        """Return the hands' regions by all palms in a square of an (H, W, 3) uint8 RGB image, the
        best palm first.
        """
        blob = image_input(square.cut(image_rgb, PALM_INPUT_SIZE))
        boxes, scores = self._session.run(["boxes", "scores"], {"input": blob})
        _, values = merge_overlapping(*decode(boxes[0], scores[0, :, 0], self._anchors, threshold))
        return [_in_image(v, square) for v in values]


def _in_image(values: Float64Array, square: Region) -> Region:
    """Calculate the hand's region in the image from a box and points (18,) in the network's input
    pixels.
    """
    unit = values / PALM_INPUT_SIZE
    in_square = region_from_palm(unit[:4], unit[4:].reshape(-1, 2))
    x, y = square.image_from_crop(np.array(in_square.center_px))
    return Region((x, y), in_square.side_px * square.side_px, in_square.rotation + square.rotation)


def pixels_per_metre(keypoints_px: Float64Array, world_landmarks: Float64Array) -> float:
    """Estimate the image scale at the person's distance, in pixels per metre.

    s = ‖p − mean p‖ / ‖w_xy − mean w_xy‖ of all 33 keypoints p and world landmarks w, by scaled
    orthographic projection. Without world landmarks (all 0): the length of trunk and longer leg in
    the image over an adult's.

    :param keypoints_px: (33, 2) pixels.
    :param world_landmarks: (33, 3) metres in camera axes, or all 0.
    """
    if not world_landmarks.any():
        trunk_and_legs = [
            np.linalg.norm(np.diff(keypoints_px[chain], axis=0), axis=1).sum() for chain in _STATURE
        ]
        return float(max(trunk_and_legs)) / _STATURE_M
    image = keypoints_px - keypoints_px.mean(axis=0)
    space = world_landmarks[:, :2] - world_landmarks[:, :2].mean(axis=0)
    return float(np.linalg.norm(image) / np.maximum(np.linalg.norm(space), 1e-9))


def region_from_body(keypoints_px: Float64Array, scale: float, side: int) -> Region:
    """Predict the region of a hand from the body's keypoints.

    The centre lies beyond the wrist in the direction of the finger keypoints' mean m = (index +
    pinky) / 2, with their foreshortening. m is half-way along the hand, so the centre is wrist + (m
    − wrist) · 0.45 / 0.5. The region's up direction follows m and the forearm.

    :param keypoints_px: (33, 2) pixels, of the body.
    :param scale: see `pixels_per_metre`.
    :param side: 0 left, 1 right.
    """
    elbow, wrist, index, pinky = keypoints_px[_ARM[side]]
    length = HAND_LENGTH_M * scale
    reach = (index + pinky) / 2 - wrist
    longest = 0.6 * length
    reach *= min(1.0, longest / max(float(np.linalg.norm(reach)), 1e-9))
    forearm = wrist - elbow
    up = reach / max(0.5 * length, 1e-9) + 0.5 * forearm / max(float(np.linalg.norm(forearm)), 1e-9)
    x, y = wrist + reach * (_MIDDLE / 0.5)
    return Region((x, y), _BODY_SCALE * length, rotation_towards(up))


def region_from_palm(box_px: Float64Array, points_px: Float64Array) -> Region:
    """Calculate the region of a hand from its detected palm.

    :param box_px: (4,) left, top, right, bottom of the palm's square box, in the axes of the
        detector's input.
    :param points_px: (7, 2) in the same axes: 0 the wrist, 2 the base of the middle finger.
    """
    size = float(max(box_px[2] - box_px[0], box_px[3] - box_px[1]))
    up = points_px[2] - points_px[0]
    center = (box_px[:2] + box_px[2:]) / 2
    return _shifted(center, size, rotation_towards(up), _PALM_SCALE, _PALM_SHIFT)


def region_from_landmarks(keypoints_px: Float64Array) -> Region:
    """Calculate the region for the next frame from this one's keypoints (21, 2), in pixels.

    Up is from the wrist to the weighted mean of the base joints of index, middle and ring finger
    (weights ¼, ½, ¼). The box is that of the palm and of the finger bases in these axes, so that
    moving fingers do not move the region.
    """
    up = 0.25 * (keypoints_px[5] + keypoints_px[13]) + 0.5 * keypoints_px[9] - keypoints_px[0]
    rotation = rotation_towards(up)
    center, sides = box_along(keypoints_px[_RIGID], rotation)
    return _shifted(center, float(sides.max()), rotation, _TRACK_SCALE, _TRACK_SHIFT)


def _shifted(
    center: Float64Array, size: float, rotation: float, scale: float, shift: float
) -> Region:
    """Build a region ``scale`` times ``size``, shifted up (in its own axes) by ``shift`` sizes."""
    up = np.array([math.sin(rotation), -math.cos(rotation)])
    x, y = center + shift * size * up
    return Region((x, y), scale * size, rotation)
