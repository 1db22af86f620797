# SPDX-License-Identifier: GPL-3.0-or-later
"""The seam between two windows: who in the one is who in the other.

Both have followed the people in the frames that they share. Two tracklets are the same person if both last until the
end of these frames, with keypoints in the same places over the last of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...tracking.association import cheapest_links
from ...tracking.track import Tracklet
from .window_record import WindowRecord

SAME_PERSON = 0.15  # mean distance of the keypoints in sides of the region, below which two tracklets are one person
COMPARED_FRAMES = 10
SAME_POSE = 0.04  # the same, below which the tracklets are faded into each other; else left and right may be swapped


def same_people(before: WindowRecord, after: WindowRecord) -> dict[int, int]:
    """Return for each tracklet of the later window that continues one of the earlier window, the number of that one."""
    overlap = after.first
    if not overlap or len(before) - before.anchor != overlap:
        return {}
    old = _lasting(before, len(before) - 1)
    new = _lasting(after, overlap - 1)
    cost = np.full((len(new), len(old)), SAME_PERSON)
    rows = max(0, overlap - COMPARED_FRAMES), overlap
    for i, later in enumerate(new):
        for j, earlier in enumerate(old):
            apart = distance(before.tracklets[earlier], after.tracklets[later], before.anchor, rows)
            cost[i, j] = min(apart, SAME_PERSON)
    links = cheapest_links(cost, SAME_PERSON)
    return {new[i]: old[j] for i, j in links.items()}


def missed_people(before: WindowRecord, after: WindowRecord) -> bool:
    """Return whether somebody who was followed throughout the shared frames was not found there again."""
    overlap = len(before) - before.anchor
    if not overlap:
        return False
    found = set(same_people(before, after).values())
    followed = [
        number
        for number in _lasting(before, len(before) - 1)
        if len(before.tracklets[number].rows) >= overlap and before.tracklets[number].rows[-overlap] == before.anchor
    ]
    return not found.issuperset(followed)


def distance(earlier: Tracklet, later: Tracklet, offset: int, rows: tuple[int, int]) -> float:
    """Return the mean distance of the keypoints in the frames that two tracklets share, in sides of the region.

    :param offset: the row of the earlier window that is row 0 of the later one.
    :param rows: the first and the end of the rows of the later window that are compared.
    :return: inf if there are none.
    """
    places = {row - offset: k for k, row in enumerate(earlier.rows)}
    found = []
    for k, row in enumerate(later.rows):
        if rows[0] <= row < rows[1] and row in places:
            other = places[row]
            apart = np.linalg.norm(later.values[k][:, :2] - earlier.values[other][:, :2], axis=1).mean()
            found.append(float(apart) / min(later.sides_px[k], earlier.sides_px[other]))
    return float(np.mean(found)) if found else np.inf


def faded(earlier: Tracklet, later: Tracklet, offset: int, overlap: int) -> dict[int, NDArray[np.float32]]:
    """Return the values of the shared frames, which go over from the earlier tracklet to the later one.

    value(i) = (1 − a) earlier(i) + a later(i), with a rising evenly over the overlap. Else the body would jump by some
    pixels at the seam: two trackers that began at different frames look at slightly different regions.

    :param offset: the row of the earlier window that is row 0 of the later one.
    :param overlap: how many frames both have.
    :return: by the place in the earlier tracklet; empty where the poses are not the same.
    """
    if distance(earlier, later, offset, (0, overlap)) > SAME_POSE:
        return {}
    places = {row - offset: k for k, row in enumerate(earlier.rows)}
    values: dict[int, NDArray[np.float32]] = {}
    for k, row in enumerate(later.rows):
        if row < overlap and row in places:
            a = np.float32((row + 1) / (overlap + 1))
            values[places[row]] = (1 - a) * earlier.values[places[row]] + a * later.values[k]
    return values


def _lasting(record: WindowRecord, row: int) -> list[int]:
    """Return the tracklets that were seen in a row."""
    return [number for number, tracklet in record.tracklets.items() if row in tracklet.rows]
