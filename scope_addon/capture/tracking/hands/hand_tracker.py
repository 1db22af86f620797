# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracking of hands: the body says where to look first, the hand's own keypoints where to look in the next frame."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..perception.execution import Execution
from ..perception.hand_landmarks import HAND_POINTS, HandEstimate, HandNetwork
from ..perception.hand_region import HAND_LENGTH_M, SIDES, WRISTS, pixels_per_metre, region_from_body
from ..perception.observation import Observation
from ..perception.palm_detector import PalmDetector
from ..perception.region import Region
from .frame_clock import FRAME_S, PATIENCE_S, is_search_due

FIRST_PRESENCE = 0.1  # in a rough region, from which the better one of the landmarks is looked at
# Least presence with the wrist at the body's, and elsewhere: of a hand whose palm was detected, or that was seen in the
# frame before; and of one that is only predicted from the body.
DETECTED_PRESENCE, PREDICTED_PRESENCE = (0.5, 0.5), (0.6, 0.8)
WRIST_DISTANCE = 0.7  # largest distance between the hand's wrist and the body's, in hand lengths
UNSURE_WRIST_DISTANCE = 1.2  # where the body's wrist is uncertain
SURE_WRIST = 0.5
MIN_SIZE, MAX_SIZE = 0.25, 2.0  # of the hand, in the hand lengths of the body
SAME_HAND = 0.35  # mean distance of the keypoints, in sizes of the hand, below which two hands are one
SEARCH_SCALE = 2.3  # side of the square in which a palm is searched, in sides of the predicted region
MOST_PALMS = 2
SMALLEST_HAND_PX = 12.0
DISAGREEMENT_THRESHOLD = 0.3
CERTAIN_PRESENCE = 0.95  # from which a hand is none that the network imagines
MIN_SIDE_PROBABILITY = 0.15  # of the right side
SAME_WRIST, OTHER_WRIST = 0.3, 1.0  # distances of the body's two wrists from a hand of the wrong side, in hand lengths
_MARGIN = 0.3  # of a region's side, by which its centre may be outside the image

_Key = tuple[int, int]  # tracklet number, and 0 for the left hand or 1 for the right one


@dataclass
class _Hand:
    """The state of one hand of one person: the estimate in the frame before, if there was one."""

    estimate: HandEstimate | None
    seen_s: float  # when it was last seen; if never, when it was first looked for
    searched_s: float  # when it was last looked for


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
        self._hands: dict[_Key, _Hand] = {}
        self._time_s = 0.0

    def another(self) -> HandTracker:
        """Return a tracker with the same networks that has seen nothing."""
        tracker = copy.copy(self)
        tracker._hands, tracker._time_s = {}, 0.0
        return tracker

    def step(
        self, image_rgb: NDArray[np.uint8], observations: Sequence[tuple[int, Observation]], time_s: float | None = None
    ) -> list[tuple[int, Observation]]:
        """Add ``hands`` to the observations of one frame.

        :param image_rgb: (H, W, 3).
        :param observations: tracklet number and observation of each person.
        :param time_s: when the frame is shown; None: a thirtieth of a second after the one before.
        """
        self._time_s = now = self._time_s + FRAME_S if time_s is None else time_s
        keys = [(number, side) for number, _ in observations for side in range(len(SIDES))]
        self._hands = {key: self._hands.get(key) or _Hand(None, now, now - PATIENCE_S) for key in keys}
        people = dict(observations)
        found = {key: self._find(image_rgb, self._hands[key], people[key[0]], key[1]) for key in keys}
        found = _without_duplicates(found, people)
        for key, estimate in found.items():
            hand = self._hands[key]
            hand.estimate = estimate
            if estimate is not None:
                hand.seen_s = now
        return [(n, replace(o, hands=_as_array([found[n, s] for s in range(len(SIDES))]))) for n, o in observations]

    def _find(self, image_rgb: NDArray[np.uint8], hand: _Hand, person: Observation, side: int) -> HandEstimate | None:
        """Look for the hand where it was a frame ago, otherwise where the body's pose predicts it."""
        scale = pixels_per_metre(person.keypoints_px, person.world_landmarks)
        if hand.estimate is not None:
            estimate = self._network.estimate(image_rgb, hand.estimate.next_region)
            found = assigned(estimate, person, scale, side)
            if found is not None:
                return found
        elif not is_search_due(self._time_s, hand.seen_s, hand.searched_s):
            return None
        hand.searched_s = self._time_s
        predicted = region_from_body(person.keypoints_px, scale, side)
        if HAND_LENGTH_M * scale < SMALLEST_HAND_PX or not _is_in_image(predicted, image_rgb):
            return None
        return self._search(image_rgb, predicted, person, scale, side)

    def _search(
        self, image_rgb: NDArray[np.uint8], predicted: Region, person: Observation, scale: float, side: int
    ) -> HandEstimate | None:
        """Find the hand whose palm is nearest to the predicted region, or without a palm, any hand in that region.

        Each is estimated twice: the landmarks give a better region than the palm.

        :param scale: pixels per metre.
        """
        around = replace(predicted, side_px=SEARCH_SCALE * predicted.side_px)
        palms = sorted(
            self._palms.detect(image_rgb, around),
            key=lambda palm: float(np.hypot(*np.subtract(palm.region.center_px, predicted.center_px))),
        )
        candidates = [(palm.region, DETECTED_PRESENCE) for palm in palms[:MOST_PALMS]]
        for region, least_presence in [*candidates, (predicted, PREDICTED_PRESENCE)]:
            first = self._network.estimate(image_rgb, region)
            if first.presence < FIRST_PRESENCE:
                continue
            second = self._network.estimate(image_rgb, first.next_region)
            found = assigned(second, person, scale, side, least_presence)
            if found is not None:
                return found
        return None


def assigned(
    estimate: HandEstimate,
    person: Observation,
    scale: float,
    side: int,
    least_presence: tuple[float, float] = DETECTED_PRESENCE,
) -> HandEstimate | None:
    """Return a hand as this hand of the person; None if it cannot be.

    Its wrist has to be near the body's, its size like the body's. Where the network is not certain of a hand, its
    keypoints in the image have to agree with those in space, which an imagined hand's do not.

    A hand that the network takes for one of the other side is somebody else's or the person's other one, unless its
    wrist is this one and the other is far away: seen edge-on, left and right hands look alike. In an orthographic
    projection, a left hand looks like a right one with reversed depth, which is then returned.

    :param scale: pixels per metre at the person's distance.
    :param side: 0 left, 1 right.
    :param least_presence: with the wrist at the body's, and elsewhere.
    """
    sure = person.keypoints_confidence[WRISTS[side]] >= SURE_WRIST
    length = HAND_LENGTH_M * scale
    near, elsewhere = least_presence
    distance, other = _wrist_distances(estimate, person, scale)[[side, 1 - side]]
    if (
        not estimate.presence >= (near if distance <= SAME_WRIST else elsewhere)
        or distance > (WRIST_DISTANCE if sure else UNSURE_WRIST_DISTANCE)
        or not MIN_SIZE * length <= estimate.size_px <= MAX_SIZE * length
        or (estimate.presence < CERTAIN_PRESENCE and estimate.disagreement > DISAGREEMENT_THRESHOLD)
    ):
        return None
    probability = estimate.left if side == 0 else 1.0 - estimate.left
    if probability >= MIN_SIDE_PROBABILITY:
        return estimate
    if not sure or distance > SAME_WRIST or other < OTHER_WRIST:
        return None
    mirrored = estimate.world_landmarks * np.array([1.0, 1.0, -1.0])
    return replace(estimate, world_landmarks=mirrored, left=1.0 - estimate.left)


def _wrist_distances(estimate: HandEstimate, person: Observation, scale: float) -> NDArray[np.float64]:
    """Return the distances (2,) of the hand's wrist from the body's left and right one, in hand lengths."""
    distances: NDArray[np.float64] = np.linalg.norm(estimate.keypoints_px[0] - person.keypoints_px[WRISTS], axis=1)
    return distances / (HAND_LENGTH_M * scale)


def _without_duplicates(
    found: Mapping[_Key, HandEstimate | None], people: Mapping[int, Observation]
) -> dict[_Key, HandEstimate | None]:
    """Assign a hand that was found more than once to the nearest wrist; None for the others."""

    def distance(key: _Key) -> float:
        number, side = key
        estimate = found[key]
        wrist = people[number].keypoints_px[WRISTS[side]]
        return np.inf if estimate is None else float(np.linalg.norm(estimate.keypoints_px[0] - wrist))

    unique = dict(found)
    keys = sorted(found, key=distance)
    for k, key in enumerate(keys):
        estimate = unique[key]
        if estimate is not None and any(_is_same_hand(estimate, unique[other]) for other in keys[:k]):
            unique[key] = None
    return unique


def _is_same_hand(a: HandEstimate, b: HandEstimate | None) -> bool:
    if b is None:
        return False
    distance = np.linalg.norm(a.keypoints_px - b.keypoints_px, axis=1).mean()
    return bool(distance < SAME_HAND * min(a.size_px, b.size_px))


def _as_array(hands: Sequence[HandEstimate | None]) -> NDArray[np.float64]:
    """Return (2, 21, 6) pixels, confidence and world landmarks of both hands; zeros where one was not found."""
    out = np.zeros((len(hands), HAND_POINTS, 6))
    for row, hand in zip(out, hands, strict=True):
        if hand is not None:
            row[:, :2], row[:, 2], row[:, 3:] = hand.keypoints_px, hand.presence, hand.world_landmarks
    return out


def _is_in_image(region: Region, image_rgb: NDArray[np.uint8]) -> bool:
    height, width = image_rgb.shape[:2]
    x, y = region.center_px
    reach = _MARGIN * region.side_px
    return -reach <= x <= width + reach and -reach <= y <= height + reach
