# SPDX-License-Identifier: GPL-3.0-or-later
"""One hand of one person in one frame: where it is looked for, and what is found there."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...arrays import Float32Array, Float64Array, Uint8Array
from ..perception.hand_landmarks import (
    HAND_LENGTH_M,
    HAND_POINTS,
    WRISTS,
    HandEstimate,
    HandNetwork,
    region_from_body,
)
from ..perception.observation import Observation
from ..perception.region import Region
from .appearance import sample
from .hand_assignment import CERTAIN_PRESENCE, SAME_WRIST, Least, assigned, is_same_hand, side_of

# From this motion of the wrist on, in hand lengths per frame, the region at rest is tried as well.
FAR_MOTION = 0.35
KEPT_REACH = 2.0  # of the part of a frame that is kept around the wrist, in hand lengths
# Keypoints of a hand: bases and middle joints of the fingers.
_KNUCKLES = [5, 9, 13, 17]
_MIDDLES = [6, 10, 14, 18]
_ALONG = (1 / 3, 2 / 3)  # places on the palm, from the wrist to the knuckles
_DARK = 8.0  # added to colours, which say little below it
MAX_SHADE = 0.7  # change of a channel's logarithm that light can make from one frame to another
MAX_TINT = 0.08  # change of a channel's share of all three


class Found(NamedTuple):
    """An estimate that may be this hand, whether the network is sure of it, and the palm's
    colour.
    """

    estimate: HandEstimate
    is_sure: bool
    color: Float64Array | None

    @property
    def row(self) -> Float32Array:
        """Pixels, confidence, world landmarks and the probability that these are a left hand's
        (21, 7), finite; the confidence of a tentative hand is negative.
        """
        out = np.empty((HAND_POINTS, 7))
        out[:, :2] = self.estimate.keypoints_px
        out[:, 3:6] = self.estimate.world_landmarks
        out[:, 6] = self.estimate.left
        out[:, 2] = self.estimate.presence if self.is_sure else -self.estimate.presence
        return np.where(np.isfinite(out), out, 0.0).astype(np.float32)


@dataclass(frozen=True)
class Sight:
    """Where one hand is looked for: ``scale`` in pixels per metre, ``side`` 0 left, 1 right,
    ``color`` of the palm.

    ``image_rgb`` is the frame, or a part of it with the pixel ``offset_px`` at its top left;
    ``others`` are the other hands that are known in it; ``opposite`` collects those that were seen
    and surely are of the other side.
    """

    image_rgb: Uint8Array
    person: Observation
    side: int
    scale: float
    color: Float64Array | None
    offset_px: tuple[int, int] = (0, 0)
    others: list[HandEstimate] = field(default_factory=list)
    opposite: list[HandEstimate] = field(default_factory=list)

    def estimate(self, network: HandNetwork, region: Region) -> HandEstimate:
        """Run the network in a region of the frame."""
        found = network.estimate(self.image_rgb, region.moved(-np.array(self.offset_px)))
        return replace(found, keypoints_px=found.keypoints_px + self.offset_px, region=region)

    def around_wrist(self) -> Sight:
        """Return the same with a copy of the part of the frame in which a hand at the body's wrist
        can be.
        """
        reach = KEPT_REACH * self.hand_px
        height, width = self.image_rgb.shape[:2]
        (x0, y0) = np.floor(self.wrist_px - reach)
        (x1, y1) = np.ceil(self.wrist_px + reach)
        x0, x1 = (int(np.clip(x, 0, width)) for x in (x0, x1))
        y0, y1 = (int(np.clip(y, 0, height)) for y in (y0, y1))
        return replace(self, image_rgb=self.image_rgb[y0:y1, x0:x1].copy(), offset_px=(x0, y0))

    @property
    def wrist_px(self) -> Float64Array:
        """The body's wrist (2,)."""
        return self.person.keypoints_px[WRISTS[self.side]]

    @property
    def wrist_confidence(self) -> float:
        """Confidence of the body's wrist."""
        return float(self.person.keypoints_confidence[WRISTS[self.side]])

    @property
    def hand_px(self) -> float:
        """Length of the hand in pixels."""
        return HAND_LENGTH_M * self.scale

    @cached_property
    def predicted(self) -> Region:
        """Where the body's arm predicts the hand."""
        return region_from_body(self.person.keypoints_px, self.scale, self.side)

    def judge(
        self, estimate: HandEstimate, sure: Least, tentative: Least, same_wrist: float = SAME_WRIST
    ) -> Found | None:
        """Return an estimate if it may be this hand, see `assigned`; unless it is certain, in the
        hand's colour.
        """
        if any(is_same_hand(estimate, other) for other in self.others):
            return None
        color = palm_color(self.image_rgb, estimate.keypoints_px - self.offset_px)
        if estimate.presence < CERTAIN_PRESENCE and not is_like(color, self.color):
            return None
        for is_sure, least in ((True, sure), (False, tentative)):
            hand = assigned(estimate, self.person, self.scale, self.side, least, same_wrist)
            if hand is not None:
                return Found(hand, is_sure, color)
        if side_of(estimate) == 1 - self.side:
            self.opposite.append(estimate)
        return None


def followed_regions(
    estimate: HandEstimate, motion_px: Float64Array, hand_px: float
) -> list[Region]:
    """Return where a hand that was seen a frame ago may be: moved with the body's wrist, and at its
    place of then.

    :param motion_px: (2,) of the body's wrist.
    :param hand_px: length of the hand.
    """
    region = estimate.next_region
    if np.linalg.norm(motion_px) < FAR_MOTION * hand_px:
        return [region]
    return [region.moved(motion_px), region]


def better(a: Found | None, b: Found | None) -> Found | None:
    """Return the sure one of two findings, or the one with more presence."""
    both = [found for found in (a, b) if found is not None]
    return max(both, key=lambda found: (found.is_sure, found.estimate.presence), default=None)


def palm_color(image_rgb: Uint8Array, keypoints_px: Float64Array) -> Float64Array | None:
    """Return the median colour (3,) at places on palm and fingers; None if none of them is in the
    image.

    :param image_rgb: (H, W, 3) uint8.
    :param keypoints_px: (21, 2) of the hand.
    """
    wrist = keypoints_px[0]
    knuckles = keypoints_px[_KNUCKLES]
    places = [
        knuckles,
        keypoints_px[_MIDDLES],
        *(wrist + share * (knuckles - wrist) for share in _ALONG),
    ]
    pixels = sample(image_rgb, np.concatenate(places))
    return np.asarray(np.median(pixels.astype(float), axis=0)) if len(pixels) else None


def is_like(color: Float64Array | None, before: Float64Array | None) -> bool:
    """Return whether a colour (3,) and an earlier one (3,) can be one hand's; also where one of
    them is not known.

    Light and shadow change all channels by one factor, which may be large; something else differs
    in tint as well.
    """
    if color is None or before is None:
        return True
    a = color + _DARK
    b = before + _DARK
    shade = float(np.abs(np.log(a / b)).max())
    tint = float(np.abs(a / a.sum() - b / b.sum()).max())
    return shade <= MAX_SHADE or tint <= MAX_TINT
