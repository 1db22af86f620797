# SPDX-License-Identifier: GPL-3.0-or-later
"""Follows the hands of everybody who is followed: the body says where to look, the hand's own keypoints where next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..perception.execution import Execution
from ..perception.hand_landmarks import HAND_POINTS, HandEstimate, HandNetwork
from ..perception.hand_region import HAND_LENGTH_M, SIDES, WRISTS, pixels_per_metre, region_from_body
from ..perception.observation import Observation
from ..perception.palm_detector import PalmDetector
from ..perception.region import Region
from .tracker import FRAME_S

PRESENCE_THRESHOLD = 0.5
UNAIDED_PRESENCE = 0.8  # where neither a palm was detected nor the hand seen before
WRIST_APART = 0.7  # most distance between the hand's wrist and the body's, in hand lengths
UNSURE_WRIST_APART = 1.2  # where the body's wrist is uncertain
SURE_WRIST = 0.5
SAME_HAND = 0.35  # mean distance of the keypoints, in sizes of the hand, below which two hands are one
SEARCH_SCALE = 2.3  # side of the square in which a palm is looked for, over the region that the body foretells
EAGER_S = 10 * FRAME_S  # how long a lost hand is looked for in every frame
PATIENT_S = 4 * FRAME_S  # afterwards, so long after the look before
SOON_S = 0.005  # what a frame's time may be off
SMALLEST_HAND_PX = 12.0
DISAGREEMENT_THRESHOLD = 0.3
STRANGER = 0.15  # probability of the right side below which a hand is not the one that is wanted


@dataclass
class _Hand:
    """One hand of one person: where it was seen in the frame before, if it was."""

    estimate: HandEstimate | None
    seen_s: float  # when it was seen last; of one that never was, when it was first looked for
    looked_s: float  # when it was last looked for


class HandTracker:
    """The hands of the people whom `PeopleTracker` follows; frames are given in order."""

    def __init__(self, threads: int, folder: Path | None = None, execution: Execution | None = None) -> None:
        self._network = HandNetwork(threads, folder, execution)
        self._palms = PalmDetector(threads, folder, execution)
        self._hands: dict[tuple[int, int], _Hand] = {}
        self._time_s = 0.0

    def step(
        self, image_rgb: np.ndarray, observations: Sequence[tuple[int, Observation]], time_s: float | None = None
    ) -> list[tuple[int, Observation]]:
        """The observations of one frame, each with the person's ``hands``.

        ``time_s``: when the frame is shown; without it, a thirtieth of a second after the one before.
        """
        self._time_s = now = self._time_s + FRAME_S if time_s is None else time_s
        keys = [(number, side) for number, _ in observations for side in range(len(SIDES))]
        self._hands = {key: self._hands.get(key) or _Hand(None, now, now - PATIENT_S) for key in keys}
        people = dict(observations)
        found = {key: self._find(image_rgb, self._hands[key], people[key[0]], key[1]) for key in keys}
        _settle_rivals(found, people)
        for key, estimate in found.items():
            hand = self._hands[key]
            hand.estimate = estimate
            if estimate is not None:
                hand.seen_s = now
        return [(n, replace(o, hands=_as_array([found[n, s] for s in range(len(SIDES))]))) for n, o in observations]

    def _find(self, image_rgb: np.ndarray, hand: _Hand, person: Observation, side: int) -> HandEstimate | None:
        """The hand where it was a frame ago, else where the body foretells it."""
        scale = pixels_per_metre(person.keypoints_px, person.world_landmarks)
        if hand.estimate is not None:
            followed = self._network.estimate(image_rgb, hand.estimate.next_region)
            if followed.presence >= PRESENCE_THRESHOLD and belongs(followed, person, scale, side):
                return followed
        elif self._time_s - hand.seen_s > EAGER_S + SOON_S and self._time_s - hand.looked_s < PATIENT_S - SOON_S:
            return None
        hand.looked_s = self._time_s
        foretold = region_from_body(person.keypoints_px, scale, side)
        if HAND_LENGTH_M * scale < SMALLEST_HAND_PX or not _is_in_image(foretold, image_rgb):
            return None
        return self._search(image_rgb, foretold, person, scale, side)

    def _search(
        self, image_rgb: np.ndarray, foretold: Region, person: Observation, scale: float, side: int
    ) -> HandEstimate | None:
        """The palm that lies nearest to the body's wrist; without one, whatever hand the foretold region shows.

        Each is looked at twice: the landmarks know better than the palm where the hand lies.
        """
        around = replace(foretold, side_px=SEARCH_SCALE * foretold.side_px)
        palms = self._palms.detect(image_rgb, around)
        palms.sort(key=lambda palm: np.hypot(*np.subtract(palm.region.center_px, foretold.center_px)))
        tries = [(palm.region, PRESENCE_THRESHOLD) for palm in palms[:2]] + [(foretold, UNAIDED_PRESENCE)]
        for region, least in tries:
            first = self._network.estimate(image_rgb, region)
            if first.presence < min(least, PRESENCE_THRESHOLD):
                continue
            second = self._network.estimate(image_rgb, first.next_region)
            if second.presence >= least and belongs(second, person, scale, side):
                return second
        return None


def belongs(estimate: HandEstimate, person: Observation, scale: float, side: int) -> bool:
    """Whether a hand may be this one of the person: near the body's wrist, as large as a hand, not the other hand.

    And one that agrees with itself, which an imagined one does not.
    """
    wrist = WRISTS[side]
    sure = person.keypoints_confidence[wrist] >= SURE_WRIST
    length = HAND_LENGTH_M * scale
    apart = float(np.linalg.norm(estimate.keypoints_px[0] - person.keypoints_px[wrist]))
    likely = estimate.left if side == 0 else 1.0 - estimate.left
    return (
        apart <= (WRIST_APART if sure else UNSURE_WRIST_APART) * length
        and 0.25 * length <= estimate.size_px <= 2.0 * length
        and likely >= STRANGER
        and estimate.disagreement <= DISAGREEMENT_THRESHOLD
    )


def _settle_rivals(found: dict[tuple[int, int], HandEstimate | None], people: dict[int, Observation]) -> None:
    """Two that look at one hand: it belongs to the one whose wrist is nearer."""

    def away(key: tuple[int, int]) -> float:
        number, side = key
        estimate = found[key]
        wrist = people[number].keypoints_px[WRISTS[side]]
        return np.inf if estimate is None else float(np.linalg.norm(estimate.keypoints_px[0] - wrist))

    keys = sorted(found, key=away)
    for k, key in enumerate(keys):
        estimate = found[key]
        if estimate is not None and any(_same_hand(estimate, found[other]) for other in keys[:k]):
            found[key] = None


def _same_hand(a: HandEstimate, b: HandEstimate | None) -> bool:
    if b is None:
        return False
    apart = np.linalg.norm(a.keypoints_px - b.keypoints_px, axis=1).mean()
    return bool(apart < SAME_HAND * min(a.size_px, b.size_px))


def _as_array(hands: Sequence[HandEstimate | None]) -> np.ndarray:
    """(2, 21, 6) pixels, confidence and world landmarks of both hands; zeros where one was not found."""
    out = np.zeros((len(hands), HAND_POINTS, 6))
    for row, hand in zip(out, hands, strict=True):
        if hand is not None:
            row[:, :2], row[:, 2], row[:, 3:] = hand.keypoints_px, hand.presence, hand.world_landmarks
    return out


def _is_in_image(region: Region, image_rgb: np.ndarray) -> bool:
    height, width = image_rgb.shape[:2]
    x, y = region.center_px
    reach = 0.3 * region.side_px
    return -reach <= x <= width + reach and -reach <= y <= height + reach
