# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracking of hands: the body says where to look first, the hand's own keypoints where to look in the next frame."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...perception.execution import Execution
from ...perception.hand_landmarks import HAND_POINTS, HandEstimate, HandNetwork
from ...perception.hand_region import HAND_LENGTH_M, SIDES, WRISTS, pixels_per_metre, region_from_body
from ...perception.observation import Observation
from ...perception.palm_detector import SCORE_THRESHOLD, PalmDetector
from ...perception.region import Region
from ..frame_clock import EAGER_S, FRAME_S, PATIENCE_S, is_search_due
from .hand_assignment import (
    CERTAIN_PRESENCE,
    DETECTED,
    PREDICTED,
    SECOND,
    SECOND_TENTATIVE,
    SURE_WRIST,
    TENTATIVE,
    Key,
    Least,
    assigned,
    without_duplicates,
)
from .hand_color import is_like, palm_color

FIRST_PRESENCE = 0.1  # in a rough region, from which the better one of the landmarks is looked at
FAR_MOTION = 0.35  # of the wrist in a frame, in hand lengths, from which the region that does not move is tried as well
SEARCH_SCALE = 2.3  # side of the square in which a palm is searched, in sides of the predicted region
CLOSER_SCALE, SMALLER_SCALE = 1.5, 0.7  # of the square and the region of a second look, likewise
UNSURE_SCORE = 0.2  # of a palm in a second look
MOST_PALMS = 2
SMALLEST_HAND_PX = 12.0
_MARGIN = 0.3  # of a region's side, by which its centre may be outside the image


class _Found(NamedTuple):
    """An estimate that may be this hand, whether the network is sure of it, and the palm's colour."""

    estimate: HandEstimate
    is_sure: bool
    color: NDArray[np.float64] | None


@dataclass
class _Hand:
    """The state of one hand of one person: what was found in the frame before, if anything, and the body's wrist."""

    found: _Found | None
    wrist_px: NDArray[np.float64]
    seen_s: float  # when it was last surely seen; if never, when it was first looked for
    searched_s: float  # when it was last looked for
    color: NDArray[np.float64] | None = None  # of the palm, when it was last surely seen


@dataclass(frozen=True)
class _Sight:
    """Where one hand is looked for: ``scale`` in pixels per metre, ``side`` 0 left, 1 right, ``color`` of the palm."""

    image_rgb: NDArray[np.uint8]
    person: Observation
    side: int
    scale: float
    color: NDArray[np.float64] | None

    @property
    def wrist_px(self) -> NDArray[np.float64]:
        """The body's wrist (2,)."""
        wrist: NDArray[np.float64] = self.person.keypoints_px[WRISTS[self.side]]
        return wrist

    @property
    def wrist_confidence(self) -> float:
        """Of the body's wrist."""
        return float(self.person.keypoints_confidence[WRISTS[self.side]])

    @property
    def hand_px(self) -> float:
        """Length of the hand in pixels."""
        return HAND_LENGTH_M * self.scale

    def judge(self, estimate: HandEstimate, sure: Least, tentative: Least) -> _Found | None:
        """Return an estimate if it may be this hand, see `assigned`; unless it is certain, in the hand's colour."""
        color = palm_color(self.image_rgb, estimate.keypoints_px)
        if estimate.presence < CERTAIN_PRESENCE and not is_like(color, self.color):
            return None
        for is_sure, least in ((True, sure), (False, tentative)):
            hand = assigned(estimate, self.person, self.scale, self.side, least)
            if hand is not None:
                return _Found(hand, is_sure, color)
        return None


class HandTracker:
    """Tracks the hands of the people whom `PeopleTracker` tracks; frames are given in order.

    :param threads: of each network.
    :param folder: of the networks; None: the built-in ones.
    :param execution: what the networks run on.
    :raises SetupError: a network is missing.
    """

    def __init__(self, threads: int, folder: Path | None = None, execution: Execution | None = None) -> None:
        self._network = HandNetwork(threads, folder, execution)
        self._palms = PalmDetector(threads, folder, execution)
        self._hands: dict[Key, _Hand] = {}
        self._time_s = 0.0

    def another(self) -> HandTracker:
        """Return a tracker with the same networks that has seen nothing."""
        tracker = copy.copy(self)
        tracker._hands, tracker._time_s = {}, 0.0
        return tracker

    def step(
        self, image_rgb: NDArray[np.uint8], observations: Sequence[tuple[int, Observation]], time_s: float | None = None
    ) -> list[tuple[int, Observation]]:
        """Add ``hands`` to the observations of one frame; tentative ones as in `tentative_hands`.

        :param image_rgb: (H, W, 3).
        :param observations: tracklet number and observation of each person.
        :param time_s: when the frame is shown; None: a thirtieth of a second after the one before.
        """
        self._time_s = now = self._time_s + FRAME_S if time_s is None else time_s
        people = dict(observations)
        sights = {
            (n, side): self._sight(image_rgb, o, (n, side)) for n, o in observations for side in range(len(SIDES))
        }
        self._hands = {
            key: self._hands.get(key) or _Hand(None, sight.wrist_px, now, now - PATIENCE_S)
            for key, sight in sights.items()
        }
        found = {key: self._find(sight, self._hands[key]) for key, sight in sights.items()}
        kept = without_duplicates({key: hand and hand.estimate for key, hand in found.items()}, people)
        found = {key: hand if kept[key] is not None else None for key, hand in found.items()}
        for key, hand in found.items():
            state = self._hands[key]
            state.found, state.wrist_px = hand, sights[key].wrist_px
            if hand is not None and hand.is_sure:
                state.seen_s, state.color = now, hand.color
        return [(n, replace(o, hands=_as_array([found[n, s] for s in range(len(SIDES))]))) for n, o in observations]

    def _sight(self, image_rgb: NDArray[np.uint8], person: Observation, key: Key) -> _Sight:
        scale = pixels_per_metre(person.keypoints_px, person.world_landmarks)
        known = self._hands.get(key)
        return _Sight(image_rgb, person, key[1], scale, known.color if known else None)

    def _find(self, sight: _Sight, hand: _Hand) -> _Found | None:
        """Look for the hand where it was a frame ago, otherwise where the body's pose predicts it."""
        followed = None
        if hand.found is not None:
            least = DETECTED if hand.found.is_sure else PREDICTED
            motion = sight.wrist_px - hand.wrist_px if sight.wrist_confidence >= SURE_WRIST else np.zeros(2)
            for region in _followed(hand.found.estimate, motion, sight.hand_px):
                estimate = self._network.estimate(sight.image_rgb, region)
                followed = _better(followed, sight.judge(estimate, least, TENTATIVE))
                if followed is not None and followed.is_sure:
                    return followed
        if not is_search_due(self._time_s, hand.seen_s, hand.searched_s):
            return followed
        hand.searched_s = self._time_s
        predicted = region_from_body(sight.person.keypoints_px, sight.scale, sight.side)
        if sight.hand_px < SMALLEST_HAND_PX or not _is_in_image(predicted, sight.image_rgb):
            return followed
        just_lost = self._time_s - hand.seen_s <= EAGER_S
        return _better(self._search(sight, predicted, look_again=just_lost), followed)

    def _search(self, sight: _Sight, predicted: Region, look_again: bool) -> _Found | None:
        """Find the hand whose palm is nearest to the predicted region, or without a palm, any hand in that region.

        Where the network is sure of none although the body's wrist is seen, it may look again: for palms in a smaller
        square, in which blurred and small ones score higher, and for a hand in a smaller region.
        """
        around = replace(predicted, side_px=SEARCH_SCALE * predicted.side_px)
        palms = self._palms_near(sight, predicted, around, SCORE_THRESHOLD)
        found = self._first_sure(sight, [*((palm, DETECTED) for palm in palms), (predicted, PREDICTED)], TENTATIVE)
        if not look_again or (found is not None and found.is_sure) or sight.wrist_confidence < SURE_WRIST:
            return found
        closer, smaller = (replace(predicted, side_px=k * predicted.side_px) for k in (CLOSER_SCALE, SMALLER_SCALE))
        palms = self._palms_near(sight, predicted, closer, UNSURE_SCORE)
        again = self._first_sure(sight, [(region, SECOND) for region in (*palms, smaller)], SECOND_TENTATIVE)
        return _better(found, again)

    def _palms_near(self, sight: _Sight, predicted: Region, square: Region, threshold: float) -> list[Region]:
        """Return the hands' regions by the palms in a square that are nearest to the predicted region."""
        palms = sorted(
            self._palms.detect(sight.image_rgb, square, threshold),
            key=lambda palm: float(np.hypot(*np.subtract(palm.region.center_px, predicted.center_px))),
        )
        return [palm.region for palm in palms[:MOST_PALMS]]

    def _first_sure(self, sight: _Sight, regions: Sequence[tuple[Region, Least]], tentative: Least) -> _Found | None:
        """Return the hand in the first region, each with what it requires, in which there surely is one.

        Otherwise the best tentative one. Each is estimated twice: the landmarks give a better region.
        """
        found = None
        for region, least in regions:
            first = self._network.estimate(sight.image_rgb, region)
            if first.presence < FIRST_PRESENCE:
                continue
            second = self._network.estimate(sight.image_rgb, first.next_region)
            for estimate in (second, first):
                found = _better(found, sight.judge(estimate, least, tentative))
                if found is not None and found.is_sure:
                    return found
        return found


def _followed(estimate: HandEstimate, motion_px: NDArray[np.float64], hand_px: float) -> list[Region]:
    """Return where a hand that was seen a frame ago may be: moved with the body's wrist, and at its place of then."""
    region = estimate.next_region
    if np.linalg.norm(motion_px) < FAR_MOTION * hand_px:
        return [region]
    x, y = np.asarray(region.center_px) + motion_px
    return [replace(region, center_px=(float(x), float(y))), region]


def _better(a: _Found | None, b: _Found | None) -> _Found | None:
    """Return the sure one of two findings, or the one with more presence."""
    both = [found for found in (a, b) if found is not None]
    return max(both, key=lambda found: (found.is_sure, found.estimate.presence), default=None)


def _as_array(hands: Sequence[_Found | None]) -> NDArray[np.float64]:
    """Return (2, 21, 6) pixels, confidence and world landmarks of both hands; zeros where one was not found.

    The confidence of a tentative hand is negative.
    """
    out = np.zeros((len(hands), HAND_POINTS, 6))
    for row, hand in zip(out, hands, strict=True):
        if hand is not None:
            row[:, :2], row[:, 3:] = hand.estimate.keypoints_px, hand.estimate.world_landmarks
            row[:, 2] = hand.estimate.presence if hand.is_sure else -hand.estimate.presence
    return out


def _is_in_image(region: Region, image_rgb: NDArray[np.uint8]) -> bool:
    height, width = image_rgb.shape[:2]
    x, y = region.center_px
    reach = _MARGIN * region.side_px
    return -reach <= x <= width + reach and -reach <= y <= height + reach
