# SPDX-License-Identifier: GPL-3.0-or-later
"""Tests of a landmark network's estimates: whether they are of a body, of which one, and whether it
is in the image.
"""

from __future__ import annotations

import math

from ...arrays import Uint8Array
from ..perception.landmark_network import PoseEstimate
from ..perception.region import Region, bounds, inside
from .left_right import mean_distance

PRESENCE_THRESHOLD = 0.5
# See PoseEstimate.spread and .disagreement. Hands are detected as people with scores of up to 0.86,
# and the landmark networks then report spreads of up to 0.36, rarely 0.46. A detection with a lower
# score has to pass stricter limits.
SPREAD_THRESHOLD = 0.38
DISAGREEMENT_THRESHOLD = 0.25
UNSURE_SPREAD_THRESHOLD = 0.47
UNSURE_DISAGREEMENT_THRESHOLD = 0.18
# The least number of confident keypoints; a person who has left shows fewer.
MIN_CONFIDENT = 4
CONFIDENT = 0.3
SMALLEST_SIDE_PX = 24.0
LARGEST_SIDE = 6.0  # in longer sides of the image
# Two bodies whose keypoints are closer in the mean, in sides of the region, are one.
SAME_BODY = 0.1
# How far a predicted region may be from the one that the frame before gives: centre and size in
# sides, rotation in radians. The networks were trained on regions with larger errors.
SAME_CENTER = 0.08
SAME_SIDE = 0.12
SAME_ROTATION = 0.15


def is_plausible(estimate: PoseEstimate, sure: bool = True) -> bool:
    """Return whether landmarks are those of a body.

    :param sure: whether there is independent evidence of a body here; without it, stricter limits
        apply.
    """
    return bool(
        estimate.presence >= PRESENCE_THRESHOLD
        and (estimate.keypoints_confidence >= CONFIDENT).sum() >= MIN_CONFIDENT
        and estimate.spread >= (SPREAD_THRESHOLD if sure else UNSURE_SPREAD_THRESHOLD)
        and estimate.disagreement
        <= (DISAGREEMENT_THRESHOLD if sure else UNSURE_DISAGREEMENT_THRESHOLD)
    )


def is_same_body(a: PoseEstimate, b: PoseEstimate) -> bool:
    """Return whether two estimates describe the same body in the image."""
    return bool(
        mean_distance(a.keypoints_px, b.keypoints_px)
        < SAME_BODY * min(a.region.side_px, b.region.side_px)
    )


def share_within(a: PoseEstimate, b: PoseEstimate) -> float:
    """Return the share of a's keypoints that are inside the bounding box of b's."""
    return float(inside(a.keypoints_px, [bounds(b.keypoints_px)]).mean())


def is_center_in_image(estimate: PoseEstimate, image_rgb: Uint8Array) -> bool:
    """Return whether the mean of the keypoints is inside the image (H, W, 3); a network may imagine
    a body outside.
    """
    height, width = image_rgb.shape[:2]
    x, y = estimate.keypoints_px.mean(axis=0)
    return bool(0 <= x < width and 0 <= y < height)


def share_in_image(estimate: PoseEstimate, image_rgb: Uint8Array) -> float:
    """Return the share of the keypoints that are inside the image (H, W, 3)."""
    height, width = image_rgb.shape[:2]
    return float(
        ((estimate.keypoints_px >= 0) & (estimate.keypoints_px < [width, height]))
        .all(axis=1)
        .mean()
    )


def is_same_region(a: Region, b: Region) -> bool:
    """Return whether a landmark network's estimate is the same in either region."""
    rotation = math.remainder(a.rotation - b.rotation, 2 * math.pi)
    return (
        math.dist(a.center_px, b.center_px) <= SAME_CENTER * b.side_px
        and abs(a.side_px - b.side_px) <= SAME_SIDE * b.side_px
        and abs(rotation) <= SAME_ROTATION
    )


def is_in_image(region: Region, image_rgb: Uint8Array) -> bool:
    """Return whether a region overlaps the image (H, W, 3) and has a usable size."""
    height, width = image_rgb.shape[:2]
    x, y = region.center_px
    reach = region.side_px / 2
    outside = x + reach < 0 or y + reach < 0 or x - reach > width or y - reach > height
    return not outside and SMALLEST_SIDE_PX <= region.side_px <= LARGEST_SIDE * max(height, width)
