# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose hand it is: checks of an estimate against a person's body, and hands that were found more
than once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...perception.hand_landmarks import ELBOWS, HAND_LENGTH_M, WRISTS, HandEstimate
from ...perception.observation import Observation

WRIST_DISTANCE = 0.7  # largest distance between the hand's wrist and the body's, in hand lengths
UNSURE_WRIST_DISTANCE = 1.2  # where the body's wrist is uncertain
# The same of a hand of a sure side, with this presence, within the forearm's reach, that was this
# one a frame ago: it has not left its place because the body's wrist is elsewhere.
FOLLOWED_DISTANCE = 2.0
FOLLOWED_PRESENCE = 0.8
SURE_WRIST = 0.5
MAX_SIZE = 2.0  # of the hand, in the hand lengths of the body
# mean distance of the keypoints, in sizes of the hand, below which two hands are one
SAME_HAND = 0.35
# The same where the network is sure that one is a left hand and the other a right one: hands that
# touch are so near.
SAME_PLACE = 0.15
# probability; of a hand behind the other one, which the network imagines, it says up to 0.83
SURE_SIDE = 0.9
DISAGREEMENT_THRESHOLD = 0.3
CERTAIN_PRESENCE = 0.95  # from which a hand is none that the network imagines
MIN_SIDE_PROBABILITY = 0.15  # of the right side
# distances of the body's two wrists from a hand of the wrong side, in hand lengths
SAME_WRIST = 0.3
OTHER_WRIST = 1.0
FOLLOWED_WRIST = 0.5  # the first of them for a hand that was this one in the frame before or after
# Where forearms cross, the body's wrists are exchanged or both at one hand. A hand of a sure side
# then goes by its own.
CROSSING = 2.0  # distance of the body's two wrists up to which this may be so, in hand lengths
FOREARM = 2.0  # most of a hand's wrist from its elbow there, likewise

Key = tuple[int, int]  # tracklet number, and 0 for the left hand or 1 for the right one


class Least(NamedTuple):
    """Least presence of a hand with its wrist at the body's, and elsewhere; least size in the
    body's hand lengths.
    """

    near: float
    elsewhere: float
    size: float = 0.25


# of a hand whose palm was detected, or that was seen in the frame before
DETECTED = Least(0.5, 0.5)
PREDICTED = Least(0.6, 0.8)  # of one that is only predicted from the body
TENTATIVE = Least(0.2, 0.2)  # of one that may be believed later, see `tentative_hands`
# the same of a hand that is followed back from where it was found again
FOLLOWED_BACK = Least(0.2, 0.2, 0.42)
# The same of hands in a second look, which finds small ones in the skin of a forearm.
SECOND = Least(0.6, np.inf, 0.42)
SECOND_TENTATIVE = Least(0.2, np.inf, 0.42)


def assigned(
    estimate: HandEstimate,
    person: Observation,
    scale: float,
    side: int,
    least: Least = DETECTED,
    same_wrist: float = SAME_WRIST,
) -> HandEstimate | None:
    """Return a hand as this hand of the person; None if it cannot be.

    Its wrist has to be near the body's, its size like the body's. Where the network is not certain
    of a hand, its keypoints in the image have to agree with those in space, which an imagined
    hand's do not.

    A hand that the network takes for one of the other side is somebody else's or the person's other
    one, unless its wrist is this one and the other is far away: seen edge-on, left and right hands
    look alike. In an orthographic projection, a left hand looks like a right one with reversed
    depth, which is then returned. Where the body's wrists are near each other, they may be
    exchanged: a hand of which the network is certain, side included, may be at either.

    :param scale: pixels per metre at the person's distance.
    :param side: 0 left, 1 right.
    :param same_wrist: distance up to which the wrist is this one, in hand lengths, for a hand of
        the other side.
    """
    sure = person.keypoints_confidence[WRISTS[side]] >= SURE_WRIST
    length = HAND_LENGTH_M * scale
    wrists = person.keypoints_px[WRISTS]
    elbow = person.keypoints_px[ELBOWS[side]]
    distance, other = (np.linalg.norm(estimate.keypoints_px[0] - wrists, axis=1) / length)[
        [side, 1 - side]
    ]
    probability = estimate.left if side == 0 else 1.0 - estimate.left
    crossing = np.linalg.norm(np.subtract(*wrists)) <= CROSSING * length
    is_in_reach = np.linalg.norm(estimate.keypoints_px[0] - elbow) <= FOREARM * length
    most = WRIST_DISTANCE if sure else UNSURE_WRIST_DISTANCE
    if probability >= SURE_SIDE and is_in_reach:
        if crossing and side_of(estimate) == side:
            distance = min(distance, other)
        if same_wrist >= FOLLOWED_WRIST and estimate.presence >= FOLLOWED_PRESENCE:
            most = FOLLOWED_DISTANCE
    if (
        not estimate.presence >= (least.near if distance <= SAME_WRIST else least.elsewhere)
        or distance > most
        or not least.size * length <= estimate.size_px <= MAX_SIZE * length
        or (estimate.presence < CERTAIN_PRESENCE and estimate.disagreement > DISAGREEMENT_THRESHOLD)
    ):
        return None
    if probability >= MIN_SIDE_PROBABILITY:
        return estimate
    if (
        not sure
        or distance > same_wrist
        or other < OTHER_WRIST
        or (crossing and side_of(estimate) == 1 - side)
    ):
        return None
    mirrored = estimate.world_landmarks * np.array([1.0, 1.0, -1.0])
    return replace(estimate, world_landmarks=mirrored, left=1.0 - estimate.left)


def side_of(estimate: HandEstimate) -> int | None:
    """Return 0 for what surely is a left hand, 1 for a right one, None if the network is not
    sure.
    """
    if not estimate.presence >= CERTAIN_PRESENCE:
        return None
    if estimate.left >= SURE_SIDE:
        return 0
    return 1 if estimate.left <= 1.0 - SURE_SIDE else None


def without_duplicates(
    found: Mapping[Key, HandEstimate | None], people: Mapping[int, Observation]
) -> dict[Key, HandEstimate | None]:
    """Assign a hand that was found more than once to the nearest wrist, of its side if that is
    sure; else None.
    """

    def rank(key: Key) -> tuple[bool, float]:
        number, side = key
        estimate = found[key]
        if estimate is None:
            return True, np.inf
        wrist = people[number].keypoints_px[WRISTS[side]]
        return side_of(estimate) != side, float(np.linalg.norm(estimate.keypoints_px[0] - wrist))

    unique = dict(found)
    keys = sorted(found, key=rank)
    for k, key in enumerate(keys):
        estimate = unique[key]
        if estimate is not None and any(
            is_same_hand(estimate, unique[other]) for other in keys[:k]
        ):
            unique[key] = None
    return unique


def is_same_hand(a: HandEstimate, b: HandEstimate | None) -> bool:
    """Return whether two estimates, of which the second may be none, are of one hand."""
    if b is None:
        return False
    distance = np.linalg.norm(a.keypoints_px - b.keypoints_px, axis=1).mean()
    are_opposite = max(a.left, b.left) >= SURE_SIDE and min(a.left, b.left) <= 1.0 - SURE_SIDE
    limit = SAME_PLACE if are_opposite else SAME_HAND
    return bool(distance < limit * min(a.size_px, b.size_px))
