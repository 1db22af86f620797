# SPDX-License-Identifier: GPL-3.0-or-later
"""Which tracklet goes on with which: people who were lost behind somebody, or were away for a while.

The end of a tracklet and the start of a later one are the same person's when place, motion, size and clothes fit:

    cost = |Δplace| / (0.15 + 0.8 · gap) + 3 · Δappearance + |log(size ratio)|

with Δplace in sides of the region: the mean of how far the start lies from where the end's motion leads and the end
from where the start's motion comes from; the gap in seconds. All links together are chosen for the least sum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .appearance import distance
from .track import Tracklet

PLACE_SIGMA = 0.15  # sides of the region
SPEED_SIGMA = 0.8  # sides a second: nobody goes on exactly as before
APPEARANCE_WEIGHT = 3.0
MOST_COST = 3.0  # of a link
LONG_GAP_S = 2.0  # from then on place says nothing, so that the clothes have to be very alike
MOST_APPEARANCE_LONG = 0.35
LONG_LINK_COST = 2.0
_MOTION_S = 0.25  # of a tracklet's end that its velocity is taken from
_LONGEST_MOTION_S = 0.5  # that it goes on for
_NO_LINK = 1e6


@dataclass(frozen=True)
class End:
    """One end of a tracklet: seconds, trunk (2,) px, velocity (2,) px/s forward in time, side of the region px."""

    time: float
    center_px: np.ndarray
    velocity_px: np.ndarray
    side_px: float


def link(tracklets: Sequence[Tracklet], times: Sequence[float]) -> list[list[int]]:
    """People as lists of tracklet numbers in order of time; every tracklet that has a frame is in exactly one."""
    used = [k for k, t in enumerate(tracklets) if t.rows]
    starts = [_end(tracklets[k], times, first=True) for k in used]
    ends = [_end(tracklets[k], times, first=False) for k in used]
    cost = np.full((len(used), len(used)), _NO_LINK)
    for i, end in enumerate(ends):
        for j, start in enumerate(starts):
            if start.time > end.time:
                unlike = distance(tracklets[used[i]].appearance, tracklets[used[j]].appearance)
                cost[i, j] = link_cost(end, start, unlike)
    following = cheapest_links(cost, MOST_COST)
    has_before = set(following.values())
    people = []
    for first in range(len(used)):
        if first in has_before:
            continue
        chain = [first]
        while chain[-1] in following:
            chain.append(following[chain[-1]])
        people.append([used[k] for k in chain])
    return people


def link_cost(end: End, start: End, unlike: float) -> float:
    """See the module's equation; ``unlike`` is the distance of the appearances, 0..1."""
    gap = start.time - end.time
    resized = abs(float(np.log(start.side_px / end.side_px)))
    if gap > LONG_GAP_S:
        if unlike > MOST_APPEARANCE_LONG:
            return _NO_LINK
        return LONG_LINK_COST * (0.5 + 0.5 * unlike / MOST_APPEARANCE_LONG) + 0.5 * resized
    side, moved = (start.side_px + end.side_px) / 2, min(gap, _LONGEST_MOTION_S)
    forward = np.linalg.norm(start.center_px - end.center_px - end.velocity_px * moved)
    back = np.linalg.norm(start.center_px - start.velocity_px * moved - end.center_px)
    place = float(forward + back) / (2 * side) / (PLACE_SIGMA + SPEED_SIGMA * gap)
    return place + APPEARANCE_WEIGHT * unlike + resized


def cheapest_links(cost: np.ndarray, most: float) -> dict[int, int]:
    """For each row its column in the assignment with the least sum of ``cost - most`` over links cheaper than ``most``.

    Rows and columns that cannot be linked to each other are independent of each other and solved on their own.
    """
    open_links = cost < most
    links: dict[int, int] = {}
    todo = set(np.flatnonzero(open_links.any(axis=1)).tolist())
    while todo:
        rows, columns = {todo.pop()}, np.zeros(cost.shape[1], bool)
        while True:
            columns = open_links[sorted(rows)].any(axis=0)
            grown = set(np.flatnonzero(open_links[:, columns].any(axis=1)).tolist())
            if grown == rows:
                break
            rows = grown
        todo -= rows
        r, c = np.array(sorted(rows)), np.flatnonzero(columns)
        # a column of its own for each row that stays without a link
        square = np.concatenate([cost[np.ix_(r, c)] - most, np.zeros((len(r), len(r)))], axis=1)
        for i, j in enumerate(assign(square)):
            if j < len(c) and open_links[r[i], c[j]]:
                links[int(r[i])] = int(c[j])
    return links


def assign(cost: np.ndarray) -> list[int]:
    """The column of each row, all different, with the least sum; (N, M), N <= M. Shortest augmenting paths, O(N²M)."""
    rows, columns = cost.shape
    row_price, column_price = np.zeros(rows + 1), np.zeros(columns + 1)
    row_of = np.full(columns + 1, -1)  # the last column is where each new row waits
    for new in range(rows):
        row_of[columns], at = new, columns
        shortest, came_from = np.full(columns, np.inf), np.full(columns, columns)
        visited = np.zeros(columns + 1, bool)
        while row_of[at] >= 0:
            visited[at] = True
            row = row_of[at]
            length = cost[row] - row_price[row] - column_price[:columns]
            better = ~visited[:columns] & (length < shortest)
            shortest[better], came_from[better] = length[better], at
            nearest = int(np.where(visited[:columns], np.inf, shortest).argmin())
            step = shortest[nearest]
            row_price[row_of[visited]] += step
            column_price[visited] -= step
            shortest[~visited[:columns]] -= step
            at = nearest
        while at != columns:
            row_of[at], at = row_of[came_from[at]], int(came_from[at])
    column_of = [-1] * rows
    for column in range(columns):
        if row_of[column] >= 0:
            column_of[row_of[column]] = column
    return column_of


def _end(tracklet: Tracklet, times: Sequence[float], first: bool) -> End:
    rows = tracklet.rows if first else tracklet.rows[::-1]
    edge = times[rows[0]]
    near = [k for k, row in zip(range(60), rows, strict=False) if abs(times[row] - edge) <= _MOTION_S]
    index = np.array(near) if first else len(tracklet.rows) - 1 - np.array(near)
    t = np.array([times[tracklet.rows[k]] for k in index])
    centers = np.array([tracklet.centers_px[k] for k in index])
    velocity = np.zeros(2)
    if len(t) > 2:
        off = t - t.mean()
        velocity = off @ (centers - centers.mean(axis=0)) / max(float(off @ off), 1e-9)
    return End(edge, centers[0], velocity, float(np.median([tracklet.sides_px[k] for k in index])))
