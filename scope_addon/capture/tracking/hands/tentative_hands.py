# SPDX-License-Identifier: GPL-3.0-or-later
"""Hands that the network is not sure of: believed where they continue a hand that it is sure of.

A blurred hand, or one seen edge-on, has a presence that an imagined hand has too. What tells them
apart is time: a hand does not vanish for a few frames. In `Observation.hands`, a tentative hand has
its presence with a minus sign, so that it counts as not seen until `confirmed` has looked at the
frames before and after it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

SUPPORT_S = 0.35  # to the nearest frame in which the network is sure of the hand
LONGEST_STEP_S = 0.12  # between two frames of which one supports the other
MAX_CHANGE = 0.45  # of the keypoints about their wrist, mean over them, in sizes of the hand
MAX_GROWTH = 1.6  # of its size from one frame to the other
_TOLERANCE_S = 0.005
_CONFIDENCE = 2  # column


def confirmed(
    hands: NDArray[np.floating[Any]], times: NDArray[np.float64]
) -> NDArray[np.floating[Any]]:
    """Return hands (T, 2, 21, 6) in which tentative ones are either believed, with their low
    confidence, or zeros.

    From every sure frame on, forwards and backwards, tentative hands are believed as long as each
    looks like the one before it, for at most `SUPPORT_S`.

    :param hands: pixels, confidence, which is negative for tentative ones, and world landmarks;
        zeros where not seen.
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


def _reached(
    own: NDArray[np.floating[Any]], times: NDArray[np.float64], sure: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return (T,) which tentative hands (T, 21, 6) follow a sure one without interruption."""
    out = np.zeros(len(own), bool)
    # the hand that was believed last, and when the network was sure of it last
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


def _continues(before: NDArray[np.floating[Any]], after: NDArray[np.floating[Any]]) -> bool:
    """Return whether two hands (21, 6) of successive frames may be one."""
    a, b = (hand[:, :2] - hand[0, :2] for hand in (before, after))
    sizes = [max(float(np.ptp(points, axis=0).max()), 1e-6) for points in (a, b)]
    change = float(np.linalg.norm(a - b, axis=1).mean())
    return max(sizes) <= MAX_GROWTH * min(sizes) and change <= MAX_CHANGE * max(sizes)
