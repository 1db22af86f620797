# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose hand it is: checks of an estimate against a person's body, and hands that were found more
than once.

Hands that the network is not sure of: believed where they continue a hand that it is sure of.

A blurred hand, or one seen edge-on, has a presence that an imagined hand has too. What tells them
apart is time: a hand does not vanish for a few frames. In `Observation.hands`, a tentative hand has
its presence with a minus sign, so that it counts as not seen until `confirmed` has looked at the
frames before and after it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...arrays import BoolArray, Float64Array, FloatArray
from ..perception.hand_landmarks import ELBOWS, HAND_LENGTH_M, WRISTS, HandEstimate
from ..perception.observation import Observation

WRIST_DISTANCE = 0.7  # largest distance between the hand's wrist and the body's, in hand lengths
UNSURE_WRIST_DISTANCE = 1.2  # where the body's wrist is uncertain
# The same of a hand of a sure side, with this presence, within the forearm's reach, that was this
# one a frame ago: it has not left its place because the body's wrist is elsewhere.
FOLLOWED_DISTANCE = 2.0
FOLLOWED_PRESENCE = 0.8
SURE_WRIST = 0.5
MAX_SIZE = 2.0  # of the hand, in the hand lengths of the body
# Two hands whose keypoints are closer in the mean, in sizes of the hand, are one.
SAME_HAND = 0.35
# The same where the network is sure that one is a left hand and the other a right one: hands that
# touch are so near.
SAME_PLACE = 0.15
# The least probability of a side; for a hand that the network imagines behind the other, it has up
# to 0.83.
SURE_SIDE = 0.9
DISAGREEMENT_THRESHOLD = 0.3
CERTAIN_PRESENCE = 0.95  # from which a hand is none that the network imagines
MIN_SIDE_PROBABILITY = 0.15  # of the right side
# Distances of the body's two wrists from a hand of the wrong side, in hand lengths.
SAME_WRIST = 0.3
OTHER_WRIST = 1.0
FOLLOWED_WRIST = 0.5  # the first of them for a hand that was this one in the frame before or after
# Where forearms cross, the body's wrists are exchanged or both at one hand. A hand of a sure side
# then goes by its own.
CROSSING = 2.0  # distance of the body's two wrists up to which this may be so, in hand lengths
FOREARM = 2.0  # most of a hand's wrist from its elbow there, likewise

# Columns of a hand, see `Observation`.
_CONFIDENCE = 2
_WORLD = slice(3, 6)
_LEFT = 6
_DEPTH_REVERSED = np.array([1.0, 1.0, -1.0])

Key = tuple[int, int]  # tracklet number, and 0 for the left hand or 1 for the right one


class Least(NamedTuple):
    """Least presence of a hand with its wrist at the body's, and elsewhere; least size in the
    body's hand lengths.
    """

    near: float
    elsewhere: float
    size: float = 0.25


# What a hand requires whose palm was detected, or that was seen in the frame before.
DETECTED = Least(0.5, 0.5)
PREDICTED = Least(0.6, 0.8)  # of one that is only predicted from the body
TENTATIVE = Least(0.2, 0.2)  # of one that may be believed later, see `confirmed`
# What a hand requires that is followed back from where it was found again.
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
    distances = np.linalg.norm(estimate.keypoints_px[0] - wrists, axis=1) / length
    distance = distances[side]
    other = distances[1 - side]
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
    mirrored = estimate.world_landmarks * _DEPTH_REVERSED
    return replace(estimate, world_landmarks=mirrored, left=1.0 - estimate.left)


def with_sides_exchanged(hands: FloatArray) -> FloatArray:
    """Return hands (T, 2, 21, 7) of which each is the other one, with the depth that `assigned`
    would have given it as such: a right hand that was mirrored because it was at what was taken for
    the left wrist has its own depth again.

    :param hands: see `Observation`.
    """
    out = hands[:, ::-1].copy()
    for side in range(len(WRISTS)):
        own = out[:, side]
        left = own[:, 0, _LEFT]
        probability = left if side == 0 else 1.0 - left
        is_wrong = (own[:, 0, _CONFIDENCE] != 0) & (probability < MIN_SIDE_PROBABILITY)
        own[is_wrong, :, _WORLD] *= _DEPTH_REVERSED
        own[is_wrong, :, _LEFT] = 1.0 - own[is_wrong, :, _LEFT]
    return out


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


SUPPORT_S = 0.35  # to the nearest frame in which the network is sure of the hand
LONGEST_STEP_S = 0.12  # between two frames of which one supports the other
MAX_CHANGE = 0.45  # of the keypoints about their wrist, mean over them, in sizes of the hand
MAX_GROWTH = 1.6  # of its size from one frame to the other
_TOLERANCE_S = 0.005


def confirmed(hands: FloatArray, times: Float64Array) -> FloatArray:
    """Return hands (T, 2, 21, 7) in which tentative ones are either believed, with their low
    confidence, or zeros.

    From every sure frame on, forwards and backwards, tentative hands are believed as long as each
    looks like the one before it, for at most `SUPPORT_S`.

    :param hands: see `Observation`, the confidence negative for tentative ones; zeros where not
        seen.
    :param times: (T,) seconds.
    """
    out = hands.copy()
    for side in range(hands.shape[1]):
        own = hands[:, side]
        sure = own[:, 0, _CONFIDENCE] > 0
        believed = (
            sure | _reached(own, times, sure) | _reached(own[::-1], -times[::-1], sure[::-1])[::-1]
        )
        out[:, side, :, _CONFIDENCE] = abs(own[..., _CONFIDENCE])
        out[~believed, side] = 0.0
    return out


def _reached(own: FloatArray, times: Float64Array, sure: BoolArray) -> BoolArray:
    """Return (T,) which tentative hands (T, 21, 7) follow a sure one without interruption."""
    out = np.zeros(len(own), bool)
    # The hand that was believed last, and when the network was sure of it last.
    last = -1
    since = -np.inf
    for k in np.flatnonzero(own[:, 0, _CONFIDENCE]):
        if sure[k]:
            last = k
            since = times[k]
        elif (
            last >= 0
            and times[k] - since <= SUPPORT_S + _TOLERANCE_S
            and times[k] - times[last] <= LONGEST_STEP_S + _TOLERANCE_S
            and _continues(own[last], own[k])
        ):
            out[k] = True
            last = k
    return out


def _continues(before: FloatArray, after: FloatArray) -> bool:
    """Return whether two hands (21, 7) of successive frames may be one."""
    a = before[:, :2] - before[0, :2]
    b = after[:, :2] - after[0, :2]
    sizes = [max(float(np.ptp(points, axis=0).max()), 1e-6) for points in (a, b)]
    change = float(np.linalg.norm(a - b, axis=1).mean())
    return max(sizes) <= MAX_GROWTH * min(sizes) and change <= MAX_CHANGE * max(sizes)
