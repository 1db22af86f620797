# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces in the image: the landmark network and its regions, the expression network, and the light
around the eyes.

A region is predicted from the body's head keypoints, or from the face's own landmarks; its forehead
points up. The box of the landmarks fills two thirds of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...arrays import Float64Array, FloatArray, Uint8Array
from ...kinematics.face import EXPRESSIONS
from .landmark_network import KEYPOINT_NAMES
from .region import Region, box_along, image_input, rotation_towards
from .sessions import Execution, network_path, open_session

INPUT_SIZE = 256
FACE_POINTS = 478  # the mesh of 468 points, then the right and the left iris, five points each
# Keypoints of the body: nose, eyes, ears, mouth.
HEAD = tuple(range(KEYPOINT_NAMES.index("mouth_right") + 1))
_EYES = [KEYPOINT_NAMES.index(f"{side}_eye") for side in ("left", "right")]
_EARS = [KEYPOINT_NAMES.index(f"{side}_ear") for side in ("left", "right")]
_MOUTH = [KEYPOINT_NAMES.index(f"mouth_{side}") for side in ("left", "right")]
# Distances on an adult's face: each gives a scale, the largest of which is the least foreshortened.
_EYES_M = 0.063
_EYES_TO_MOUTH_M = 0.068
_EARS_M = 0.150
# Longer side of the box of the landmarks, which reaches from the hairline to the chin.
FACE_M = 0.185
_MIDDLE = 0.3  # of the face, from the eyes towards the mouth, in their distance
_SCALE = 1.5  # side of a region in longer sides of the box
_OUTER_EYES = (33, 263)  # landmarks: the outer corners of the right and the left eye
# The landmarks that the expression network was trained on, in its order.
EXPRESSION_POINTS = (
    0, 1, 4, 5, 6, 7, 8, 10, 13, 14, 17, 21, 33, 37, 39, 40, 46, 52, 53, 54, 55, 58, 61, 63, 65, 66,
    67, 70, 78, 80, 81,
    82, 84, 87, 88, 91, 93, 95, 103, 105, 107, 109, 127, 132, 133, 136, 144, 145, 146, 148, 149,
    150, 152, 153, 154,
    155, 157, 158, 159, 160, 161, 162, 163, 168, 172, 173, 176, 178, 181, 185, 191, 195, 197, 234,
    246, 249, 251, 263,
    267, 269, 270, 276, 282, 283, 284, 285, 288, 291, 293, 295, 296, 297, 300, 308, 310, 311, 312,
    314, 317, 318, 321,
    323, 324, 332, 334, 336, 338, 356, 361, 362, 365, 373, 374, 375, 377, 378, 379, 380, 381, 382,
    384, 385, 386, 387,
    388, 389, 390, 397, 398, 400, 402, 405, 409, 415, 454, 466, 468, 469, 470, 471, 472, 473, 474,
    475, 476, 477,
)  # fmt: skip
# The expression network's outputs: a weight of the neutral face, then these. It knows nothing of
# the tongue.
_OF_NETWORK = [k for k, name in enumerate(EXPRESSIONS) if name != "tongueOut"]
# Corners of the right and the left eye, and places on the cheek under each and on the forehead
# above; landmarks.
_EYE_CORNERS = ((33, 133), (362, 263))
_CHEEKS = ((50, 101, 205, 36), (280, 330, 425, 266))
_FOREHEAD = ((151, 108, 69), (151, 337, 299))
_HALF = 0.5  # side of the square around an eye, over twice the distance of its corners
_SPOT = 0.1  # of a place on the cheek, likewise
_DARK = 8.0  # brightness below which skin says nothing
_MIN_PX = 6.0  # distance of an eye's corners below which the square is mostly shadow and hair


@dataclass(frozen=True)
class FaceEstimate:
    """The network's estimate for one region.

    ``landmarks`` (478, 3): image pixels, and depth in pixels in the region's axes, away from the
    camera; ``presence``: probability that there is a face; ``region``: the input region;
    ``eye_light``: see `eye_light`; of faces only.
    """

    landmarks: Float64Array
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

    def __init__(self, execution: Execution | None = None) -> None:
        # Its small layers take twice the processor time in two threads, which mostly wait for each
        # other.
        self._session = open_session(network_path("face_landmark"), 1, execution)

    def estimate(self, image_rgb: Uint8Array, region: Region) -> FaceEstimate:
        """Estimate the face in a region of an (H, W, 3) uint8 RGB image."""
        blob = image_input(region.cut(image_rgb, INPUT_SIZE))
        landmarks, presence = self._session.run(["landmarks", "presence"], {"input": blob})
        points = landmarks.reshape(FACE_POINTS, 3).astype(float) / INPUT_SIZE
        depth = region.side_px * points[:, 2:]
        placed = np.concatenate([region.image_from_crop(points[:, :2]), depth], axis=1)
        return FaceEstimate(
            landmarks=placed, presence=float(1.0 / (1.0 + np.exp(-presence.item()))), region=region
        )


def pixels_per_metre(keypoints_px: Float64Array) -> float:
    """Estimate the image scale at the head from the body's keypoints (33, 2)."""
    eyes = keypoints_px[_EYES]
    mouth = keypoints_px[_MOUTH].mean(axis=0)
    return max(
        float(np.linalg.norm(eyes[0] - eyes[1])) / _EYES_M,
        float(np.linalg.norm(mouth - eyes.mean(axis=0))) / _EYES_TO_MOUTH_M,
        float(np.linalg.norm(keypoints_px[_EARS[0]] - keypoints_px[_EARS[1]])) / _EARS_M,
    )


def region_from_body(keypoints_px: Float64Array) -> Region:
    """Predict the region of the face from the body's keypoints (33, 2), in pixels.

    Up is from the mouth to the eyes, and across the line of the eyes, each as far as it is not
    foreshortened.
    """
    eyes = keypoints_px[_EYES]
    mouth = keypoints_px[_MOUTH].mean(axis=0)
    middle = eyes.mean(axis=0)
    # The vector from the right eye to the left one points right in an image of a front view.
    dx, dy = eyes[0] - eyes[1]
    up = (middle - mouth) + np.array([dy, -dx])
    x, y = middle + _MIDDLE * (mouth - middle)
    side = _SCALE * FACE_M * pixels_per_metre(keypoints_px)
    return Region((x, y), side, rotation_towards(up))


def facing(world_landmarks: Float64Array) -> float:
    """Return the cosine of the angle between where the body's head looks and the direction to the
    camera.

    It looks along (left ear − right ear) × (eyes − mouth): -1 is the back of a head, 1 a face from
    the front.

    Where the body's network exchanges left and right, a face from the front counts as the back of a
    head.

    :param world_landmarks: (33, 3) of the body, metres, camera axes; all 0 where depth is unknown,
        for which this is 1.
    """
    across = world_landmarks[_EARS[0]] - world_landmarks[_EARS[1]]
    up = world_landmarks[_EYES].mean(axis=0) - world_landmarks[_MOUTH].mean(axis=0)
    ahead = np.cross(across, up)
    length = float(np.linalg.norm(ahead))
    return -float(ahead[2]) / length if length > 0 else 1.0


def region_from_landmarks(landmarks_px: Float64Array) -> Region:
    """Calculate the region for the next frame from this one's landmarks (478, 2): their box along
    the line of the eyes.

    :param landmarks_px: pixels.
    """
    dx, dy = landmarks_px[_OUTER_EYES[1]] - landmarks_px[_OUTER_EYES[0]]
    rotation = math.atan2(dy, dx)
    (x, y), sides = box_along(landmarks_px, rotation)
    return Region((x, y), _SCALE * float(sides.max()), rotation)


class ExpressionNetwork:
    """The expression network; stateless between calls.

    :raises SetupError: the network has not been built.
    :raises ModelFileError: its file is damaged.
    """

    def __init__(self) -> None:
        # It takes a millisecond, which further threads would make longer.
        self._session = open_session(network_path("face_expression"), 1)

    def estimate(self, landmarks_px: FloatArray) -> Float64Array:
        """Estimate the weights (52,) 0..1 of the expressions in the order of `EXPRESSIONS`; 0 of
        the tongue.

        :param landmarks_px: (146, 2) those of `EXPRESSION_POINTS`, pixels.
        """
        (found,) = self._session.run(["weights"], {"input": landmarks_px.astype(np.float32)[None]})
        weights = np.zeros(len(EXPRESSIONS))
        weights[_OF_NETWORK] = found[0, 1:]
        return weights


def eye_light(image_rgb: Uint8Array, landmarks: Float64Array) -> float:
    """Return the median brightness of the square around an eye over that of the skin, for the
    brighter eye.

    The skin is the darker one of cheek and forehead: a mask is brighter than skin. 0.6 to 1.5 with
    bare eyes and clear glasses, at most 0.4 with dark ones; 1 where the skin is too dark or the eye
    too small to tell, and where a landmark is not finite.

    :param image_rgb: (H, W, 3) uint8.
    :param landmarks: (478, 2) or (478, 3) pixels; a third column is not used.
    """
    if not np.isfinite(landmarks[:, :2]).all():
        return 1.0
    found = []
    for (first, second), *places in zip(_EYE_CORNERS, _CHEEKS, _FOREHEAD, strict=True):
        (ax, ay), (bx, by) = landmarks[[first, second], :2].tolist()
        width = math.hypot(ax - bx, ay - by)
        if width < _MIN_PX:
            continue
        eye = _brightness(image_rgb, (ax + bx) / 2, (ay + by) / 2, _HALF * width)
        half = _SPOT * width
        spots = [
            [_brightness(image_rgb, x, y, half) for x, y in landmarks[list(k), :2].tolist()]
            for k in places
        ]
        skin = min(_middle(place) for place in spots)
        if not math.isnan(eye) and skin > _DARK:
            found.append(eye / skin)
    return max(found, default=1.0)


def _brightness(image: Uint8Array, x: float, y: float, half: float) -> float:
    """Return the median of green in a square around a point; NaN outside the image."""
    left = math.floor(x - half)
    top = math.floor(y - half)
    right = math.ceil(x + half) + 1
    bottom = math.ceil(y + half) + 1
    height, width = image.shape[:2]
    if top >= height or left >= width or bottom <= 0 or right <= 0:
        return math.nan
    part = image[max(top, 0) : bottom, max(left, 0) : right, 1]
    low = (part.size - 1) // 2
    high = part.size // 2
    ordered = np.partition(part, (low, high), axis=None)
    return (int(ordered[low]) + int(ordered[high])) / 2


def _middle(values: list[float]) -> float:
    """Return the median of a few values, NaN if one is; `np.median` takes far longer for so few."""
    if any(map(math.isnan, values)):
        return math.nan
    ordered = sorted(values)
    return (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]) / 2
