# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracking of hands: the body says where to look first, the hand's own keypoints where to look in
the next frame.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from ...arrays import Float32Array, Float64Array, Uint8Array
from ..perception.hand_landmarks import (
    HAND_POINTS,
    PALM_THRESHOLD,
    SIDES,
    HandEstimate,
    HandNetwork,
    PalmDetector,
    pixels_per_metre,
)
from ..perception.observation import Observation
from ..perception.region import Region
from ..perception.sessions import Execution
from .frame_clock import EAGER_S, FRAME_S, PATIENCE_S, is_search_due
from .hand_assignment import (
    DETECTED,
    FOLLOWED_BACK,
    FOLLOWED_WRIST,
    PREDICTED,
    SAME_WRIST,
    SECOND,
    SECOND_TENTATIVE,
    SUPPORT_S,
    SURE_WRIST,
    TENTATIVE,
    Key,
    Least,
    without_duplicates,
)
from .hand_sight import Found, Sight, better, followed_regions

AGAIN_PRESENCE = 0.03  # the same where a hand is looked for that was found in the frame after
FIRST_PRESENCE = 0.1  # in a rough region, from which the better one of the landmarks is looked at
# Side of the square in which a palm is searched, in sides of the predicted region.
SEARCH_SCALE = 2.3
# The sides of the square and the region of a second look, in sides of the predicted region.
CLOSER_SCALE = 1.5
SMALLER_SCALE = 0.7
UNSURE_SCORE = 0.2  # of a palm in a second look
MAX_PALMS = 2
# Frames that are kept of a hand, a third of a second at 30 frames/s: each is a copy of its
# surroundings.
MAX_MISSED = 11
SMALLEST_HAND_PX = 12.0  # length of a hand that is looked for
# Length from which the network reads the palm's direction to within about 20 degrees: 20 pixels
# from wrist to middle knuckle.
LARGE_HAND_PX = 52.0
HIDDEN_WRIST = 0.1  # confidence of the body's wrist below which its hand is hardly ever found
LARGER_SCALE = 1.3  # of a region by the body in which a hand is looked for that was found later
_MARGIN = 0.3  # of a region's side, by which its centre may be outside the image


@dataclass
class _Hand:
    """The state of one hand of one person: what was found in the frame before, if anything, and the
    body's wrist.
    """

    found: Found | None
    wrist_px: Float64Array
    seen_s: float  # when it was last surely seen; if never, when it was first looked for
    searched_s: float  # when it was last looked for
    color: Float64Array | None = None  # of the palm, when it was last surely seen


@dataclass
class _Missed:
    """A frame in which a hand was not surely found, and its row in the array that the observation
    has.
    """

    time_s: float
    sight: Sight
    found: Found | None
    row: Float32Array


class HandTracker:
    """Tracks the hands of the people whom `PeopleTracker` tracks; frames are given in order.

    Each network runs in one thread, and several hands in parallel: in two threads, which mostly
    wait for each other, a run of these small networks takes twice the processor time.

    :param threads: number of hands that are looked for in parallel.
    :param least_px: length of the smallest hands that are looked for, by the body's scale; pixels.
    :raises SetupError: a network is missing.
    """

    def __init__(
        self, threads: int, execution: Execution | None = None, least_px: float = SMALLEST_HAND_PX
    ) -> None:
        self._least_px = least_px
        self._network = HandNetwork(execution)
        self._palms = PalmDetector(execution)
        self._pool = ThreadPoolExecutor(threads, "scope-hands")
        self._hands: dict[Key, _Hand] = {}
        self._missed: dict[Key, list[_Missed]] = {}
        self._time_s = 0.0

    def restarted(self) -> HandTracker:
        """Return a tracker with the same networks that has seen nothing."""
        tracker = copy.copy(self)
        tracker._hands = {}
        tracker._missed = {}
        tracker._time_s = 0.0
        return tracker

    def step(
        self,
        image_rgb: Uint8Array,
        observations: Sequence[tuple[int, Observation]],
        time_s: float | None = None,
    ) -> list[tuple[int, Observation]]:
        """Add ``hands`` to the observations of one frame; tentative ones as in `confirmed`.

        A hand that is surely found after frames in which it was not is followed back through the
        last third of a second, and written into the arrays of these frames.

        :param image_rgb: (H, W, 3).
        :param observations: tracklet number and observation of each person.
        :param time_s: when the frame is shown; None: a thirtieth of a second after the one before.
        """
        now = self._time_s + FRAME_S if time_s is None else time_s
        self._time_s = now
        people = dict(observations)
        sights = {
            (number, side): self._sight(image_rgb, person, (number, side))
            for number, person in people.items()
            for side in range(len(SIDES))
        }
        self._hands = {
            key: self._hands.get(key) or _Hand(None, sight.wrist_px, now, now - PATIENCE_S)
            for key, sight in sights.items()
        }
        found = self._find_all(sights, people)
        for key, hand in found.items():
            state = self._hands[key]
            state.found = hand
            state.wrist_px = sights[key].wrist_px
            if hand is not None and hand.is_sure:
                state.seen_s = now
                state.color = hand.color
        rows = {number: np.zeros((len(SIDES), HAND_POINTS, 7), np.float32) for number in people}
        for (number, side), hand in found.items():
            if hand is not None:
                rows[number][side] = hand.row
        self._complete_earlier_frames(sights, found, rows)
        return [(number, replace(o, hands=rows[number])) for number, o in observations]

    def _find_all(
        self, sights: dict[Key, Sight], people: dict[int, Observation]
    ) -> dict[Key, Found | None]:
        """Look for every hand; one that was found twice is looked for again beside all others."""
        # Each changes its own hand and sight alone, so that the results do not depend on the
        # threads' timing.
        in_order = self._pool.map(self._find, sights.values(), self._hands.values())
        found = dict(zip(sights, in_order, strict=True))
        for (number, side), sight in sights.items():
            if found[number, side] is None:
                found[number, side] = _of_other_side(sight, sights[number, 1 - side].opposite)
        estimates = {key: hand and hand.estimate for key, hand in found.items()}
        kept = without_duplicates(estimates, people)
        for key, sight in sights.items():
            if found[key] is not None and kept[key] is None:
                # The hand may touch the others.
                others = [other for other in kept.values() if other is not None]
                beside = self._search(replace(sight, others=others), look_again=False)
                found[key] = beside
                kept[key] = beside and beside.estimate
        return found

    def _complete_earlier_frames(
        self,
        sights: dict[Key, Sight],
        found: dict[Key, Found | None],
        rows: dict[int, Float32Array],
    ) -> None:
        """Follow hands that are surely found back through the frames in which they were missed, and
        note those that are missed now.

        :param rows: (2, 21, 7) of each person, which the observations of this frame have.
        """
        now = self._time_s
        before = self._missed
        self._missed = {}
        for key, sight in sights.items():
            hand = found[key]
            missed = [m for m in before.get(key, []) if now - m.time_s <= SUPPORT_S + 0.005]
            if hand is not None and hand.is_sure:
                of_others = [
                    those for other, those in (before | self._missed).items() if other != key
                ]
                self._look_back(missed, hand, sight, list(chain.from_iterable(of_others)))
            elif sight.hand_px >= self._least_px:
                others = [h.estimate for k, h in found.items() if k != key and h is not None]
                seen = replace(sight.around_wrist(), others=others, opposite=[])
                number, side = key
                missed.append(_Missed(now, seen, hand, rows[number][side]))
                self._missed[key] = missed[-MAX_MISSED:]

    def _look_back(
        self, missed: Sequence[_Missed], hand: Found, sight: Sight, elsewhere: Sequence[_Missed]
    ) -> None:
        """Follow a hand that was surely found back through the frames before in which it was not;
        see `_Missed`.

        :param elsewhere: frames in which other hands were missed, which are told of this one.
        """
        for each in reversed(missed):
            found = each.found or self._found_back(each.sight, hand, sight)
            if found is None:
                return
            each.row[:] = found.row
            for other in elsewhere:
                if other.time_s == each.time_s:
                    other.sight.others.append(found.estimate)
            hand = found
            sight = each.sight

    def _found_back(self, sight: Sight, later: Found, later_sight: Sight) -> Found | None:
        """Look for a hand in the frame before one in which it was found, there and around the
        body's wrist.
        """
        if not min(sight.image_rgb.shape[:2]):
            return None
        least = DETECTED if later.is_sure else PREDICTED
        both = min(sight.wrist_confidence, later_sight.wrist_confidence) >= SURE_WRIST
        motion = sight.wrist_px - later_sight.wrist_px if both else np.zeros(2)
        followed = [
            (region, least) for region in followed_regions(later.estimate, motion, sight.hand_px)
        ]
        found = self._first_sure(sight, followed, FOLLOWED_BACK, FOLLOWED_WRIST, AGAIN_PRESENCE)
        if found is not None and found.is_sure:
            return found
        predicted = sight.predicted
        larger = replace(predicted, side_px=LARGER_SCALE * predicted.side_px)
        rough = [(region, SECOND) for region in (predicted, larger)]
        return better(
            found, self._first_sure(sight, rough, SECOND_TENTATIVE, least_first=AGAIN_PRESENCE)
        )

    def _sight(self, image_rgb: Uint8Array, person: Observation, key: Key) -> Sight:
        scale = pixels_per_metre(person.keypoints_px, person.world_landmarks)
        known = self._hands.get(key)
        return Sight(image_rgb, person, key[1], scale, known.color if known else None)

    def _find(self, sight: Sight, hand: _Hand) -> Found | None:
        """Look for the hand where it was a frame ago, otherwise where the body's pose predicts
        it.
        """
        followed = None
        if hand.found is not None:
            least = DETECTED if hand.found.is_sure else PREDICTED
            motion = (
                sight.wrist_px - hand.wrist_px
                if sight.wrist_confidence >= SURE_WRIST
                else np.zeros(2)
            )
            for region in followed_regions(hand.found.estimate, motion, sight.hand_px):
                estimate = sight.estimate(self._network, region)
                followed = better(followed, sight.judge(estimate, least, TENTATIVE, FOLLOWED_WRIST))
                if followed is not None and followed.is_sure:
                    return followed
        # A lost hand is looked for at most 30 times per second, a hidden one at `PATIENCE_S`: where
        # it is found again, it is followed back through the frames in between.
        seen_s = hand.seen_s if sight.wrist_confidence >= HIDDEN_WRIST else -math.inf
        if not is_search_due(self._time_s, seen_s, hand.searched_s, FRAME_S):
            return followed
        hand.searched_s = self._time_s
        return better(
            self._search(sight, look_again=self._time_s - hand.seen_s <= EAGER_S), followed
        )

    def _search(self, sight: Sight, look_again: bool) -> Found | None:
        """Find the hand whose palm is nearest to the predicted region, or without a palm, any hand
        in that region.

        Where the network is sure of none although the body's wrist is seen, it may look again: for
        palms in a smaller square, in which blurred and small ones score higher, and for a hand in a
        smaller region.
        """
        predicted = sight.predicted
        if sight.hand_px < self._least_px or not _is_in_image(predicted, sight.image_rgb):
            return None
        around = replace(predicted, side_px=SEARCH_SCALE * predicted.side_px)
        palms = self._palms_near(sight, around, PALM_THRESHOLD)
        found = self._first_sure(
            sight, [*((palm, DETECTED) for palm in palms), (predicted, PREDICTED)], TENTATIVE
        )
        if (
            not look_again
            or (found is not None and found.is_sure)
            or sight.wrist_confidence < SURE_WRIST
        ):
            return found
        closer, smaller = (
            replace(predicted, side_px=k * predicted.side_px) for k in (CLOSER_SCALE, SMALLER_SCALE)
        )
        palms = self._palms_near(sight, closer, UNSURE_SCORE)
        again = self._first_sure(
            sight, [(region, SECOND) for region in (*palms, smaller)], SECOND_TENTATIVE
        )
        return better(found, again)

    def _palms_near(self, sight: Sight, square: Region, threshold: float) -> list[Region]:
        """Return the hands' regions by the palms in a square that are nearest to the predicted
        region.
        """
        palms = self._palms.detect(sight.image_rgb, square, threshold)
        palms.sort(key=lambda palm: math.dist(palm.center_px, sight.predicted.center_px))
        return palms[:MAX_PALMS]

    def _first_sure(
        self,
        sight: Sight,
        regions: Sequence[tuple[Region, Least]],
        tentative: Least,
        same_wrist: float = SAME_WRIST,
        least_first: float = FIRST_PRESENCE,
    ) -> Found | None:
        """Return the hand in the first region, each with what it requires, in which there surely is
        one.

        Otherwise the best tentative one. Each is estimated twice: the landmarks give a better
        region.
        """
        found = None
        for region, least in regions:
            first = sight.estimate(self._network, region)
            if first.presence < least_first:
                continue
            second = sight.estimate(self._network, first.next_region)
            for estimate in (second, first):
                found = better(found, sight.judge(estimate, least, tentative, same_wrist))
                if found is not None and found.is_sure:
                    return found
        return found


def _of_other_side(sight: Sight, seen: Sequence[HandEstimate]) -> Found | None:
    """Return this hand where it was seen while the other one was looked for: the body's wrists may
    be exchanged.
    """
    found = None
    for estimate in seen:
        found = better(found, sight.judge(estimate, DETECTED, TENTATIVE))
    return found


def _is_in_image(region: Region, image_rgb: Uint8Array) -> bool:
    height, width = image_rgb.shape[:2]
    x, y = region.center_px
    reach = _MARGIN * region.side_px
    return -reach <= x <= width + reach and -reach <= y <= height + reach
