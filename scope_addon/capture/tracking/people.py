# SPDX-License-Identifier: GPL-3.0-or-later
"""Association of tracklets: which ones belong to a person who was occluded, or away for a while.

The end of a tracklet and the start of a later one are linked when position, motion, size and
appearance match:

    cost = |Δposition| / (0.15 + 0.8 · gap) + 3 · Δappearance + |log(size ratio)|

with the gap in seconds and Δposition in sides of the region. Δposition is the mean of two
distances: from the start to the end's position extrapolated forward, and from the end to the
start's position extrapolated backward. The links of a clip are chosen together, for the least total
cost.

The people of a clip: collects the tracker's observations, and finally decides on identities and
prominence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Float64Array
from ...scene_gaps import usual_step_s
from .appearance import distance
from .track import Tracklet

POSITION_SIGMA = 0.15  # sides of the region
SPEED_SIGMA = 0.8  # sides per second: nobody keeps exactly the same velocity
APPEARANCE_WEIGHT = 3.0
MAX_LINK_COST = 3.0
# After a longer gap the position carries no information, so the appearance has to match closely.
LONG_GAP_S = 2.0
LONG_GAP_MAX_APPEARANCE = 0.35
LONG_GAP_COST = 2.0
_VELOCITY_WINDOW_S = 0.25  # of a tracklet's end, for its velocity
_MAX_EXTRAPOLATION_S = 0.5
_MAX_VELOCITY_FRAMES = 60
_NO_LINK = 1e6


@dataclass(frozen=True)
class End:
    """One end of a tracklet: seconds, trunk (2,) px, velocity (2,) px/s forward in time, side of
    the region px.
    """

    time: float
    center_px: Float64Array
    velocity_px: Float64Array
    side_px: float


def link(tracklets: Sequence[Tracklet], times: Sequence[float]) -> list[list[int]]:
    """Group tracklets into people.

    :param tracklets: in any order; their rows index ``times``.
    :param times: seconds of each frame of the clip.
    :return: each person's tracklet numbers in order of time. Every tracklet that has a frame is in
        exactly one list.
    """
    used = [k for k, t in enumerate(tracklets) if t.rows]
    starts = [_end(tracklets[k], times, first=True) for k in used]
    ends = [_end(tracklets[k], times, first=False) for k in used]
    cost = np.full((len(used), len(used)), _NO_LINK)
    for i, end in enumerate(ends):
        for j, start in enumerate(starts):
            if start.time > end.time:
                difference = distance(tracklets[used[i]].appearance, tracklets[used[j]].appearance)
                cost[i, j] = link_cost(end, start, difference)
    successor = cheapest_links(cost, MAX_LINK_COST)
    has_predecessor = set(successor.values())
    people = []
    for first in range(len(used)):
        if first in has_predecessor:
            continue
        chain = [first]
        while chain[-1] in successor:
            chain.append(successor[chain[-1]])
        people.append([used[k] for k in chain])
    return people


def link_cost(end: End, start: End, appearance_distance: float) -> float:
    """Compute the cost of the module's equation.

    :param appearance_distance: 0..1, see `appearance.distance`.
    """
    gap = start.time - end.time
    size_change = abs(float(np.log(start.side_px / end.side_px)))
    if gap > LONG_GAP_S:
        if appearance_distance > LONG_GAP_MAX_APPEARANCE:
            return _NO_LINK
        return (
            LONG_GAP_COST * (0.5 + 0.5 * appearance_distance / LONG_GAP_MAX_APPEARANCE)
            + 0.5 * size_change
        )
    side = (start.side_px + end.side_px) / 2
    elapsed = min(gap, _MAX_EXTRAPOLATION_S)
    forward = np.linalg.norm(start.center_px - end.center_px - end.velocity_px * elapsed)
    backward = np.linalg.norm(start.center_px - start.velocity_px * elapsed - end.center_px)
    position = float(forward + backward) / (2 * side) / (POSITION_SIGMA + SPEED_SIGMA * gap)
    return position + APPEARANCE_WEIGHT * appearance_distance + size_change


def cheapest_links(cost: Float64Array, max_cost: float) -> dict[int, int]:
    """Choose the links with the least sum of ``cost - max_cost``, among those cheaper than
    ``max_cost``.

    The problem splits into groups of rows and columns that can be linked to each other; each is
    solved separately.

    :param cost: (N, M) of linking a row to a column.
    :param max_cost: a link that costs as much is no better than none.
    :return: the column of each linked row.
    """
    is_open = cost < max_cost
    links: dict[int, int] = {}
    remaining = set(np.flatnonzero(is_open.any(axis=1)).tolist())
    while remaining:
        rows = {remaining.pop()}
        columns = np.zeros(cost.shape[1], bool)
        while True:
            columns = is_open[sorted(rows)].any(axis=0)
            grown = set(np.flatnonzero(is_open[:, columns].any(axis=1)).tolist())
            if grown == rows:
                break
            rows = grown
        remaining -= rows
        r = np.array(sorted(rows))
        c = np.flatnonzero(columns)
        # An extra column for each row that stays without a link.
        padded = np.concatenate([cost[np.ix_(r, c)] - max_cost, np.zeros((len(r), len(r)))], axis=1)
        for i, j in enumerate(assign(padded)):
            if j < len(c) and is_open[r[i], c[j]]:
                links[int(r[i])] = int(c[j])
    return links


def assign(cost: Float64Array) -> list[int]:
    """Solve the assignment problem by shortest augmenting paths, in O(N²M).

    :param cost: (N, M), N <= M.
    :return: the column of each row, all different, with the least total cost.
    """
    rows, columns = cost.shape
    row_price = np.zeros(rows + 1)
    column_price = np.zeros(columns + 1)
    row_of = np.full(columns + 1, -1)  # the last column holds the row that is being added
    for new in range(rows):
        row_of[columns] = new
        at = columns
        shortest = np.full(columns, np.inf)
        came_from = np.full(columns, columns)
        visited = np.zeros(columns + 1, bool)
        while row_of[at] >= 0:
            visited[at] = True
            row = row_of[at]
            length = cost[row] - row_price[row] - column_price[:columns]
            better = ~visited[:columns] & (length < shortest)
            shortest[better] = length[better]
            came_from[better] = at
            nearest = int(np.where(visited[:columns], np.inf, shortest).argmin())
            step = shortest[nearest]
            row_price[row_of[visited]] += step
            column_price[visited] -= step
            shortest[~visited[:columns]] -= step
            at = nearest
        while at != columns:
            row_of[at] = row_of[came_from[at]]
            at = int(came_from[at])
    column_of = [-1] * rows
    for column in range(columns):
        if row_of[column] >= 0:
            column_of[row_of[column]] = column
    return column_of


def _end(tracklet: Tracklet, times: Sequence[float], first: bool) -> End:
    rows = tracklet.rows if first else tracklet.rows[::-1]
    time = times[rows[0]]
    counted = zip(range(_MAX_VELOCITY_FRAMES), rows, strict=False)
    near = [k for k, row in counted if abs(times[row] - time) <= _VELOCITY_WINDOW_S]
    index = np.array(near) if first else len(tracklet.rows) - 1 - np.array(near)
    t = np.array([times[tracklet.rows[k]] for k in index])
    centers = np.array([tracklet.centers_px[k] for k in index])
    velocity = np.zeros(2)
    if len(t) > 2:
        off = t - t.mean()
        velocity = off @ (centers - centers.mean(axis=0)) / max(float(off @ off), 1e-9)
    return End(time, centers[0], velocity, float(np.median([tracklet.sides_px[k] for k in index])))


# Whoever was seen in a smaller share of the frames, or is less prominent compared to the most
# prominent person, is a mistake of the detector. Of whoever was followed for `CERTAIN_S`, it does
# not matter how briefly: prominence is then compared in those frames in which each was seen.
CERTAIN_S = 3.0
MIN_SHARE = 0.02
# Of those who were seen in a smaller share, whoever was followed for so long is no mistake. In
# fifteen real clips, a mistake lasts 0.33 s at most.
BRIEF_S = 1.0
MIN_PROMINENCE = 0.05
MIN_INTERVAL_S = 0.3  # the same for the longest time without interruption
# Speed of hands and feet, in sides of the region per second, from which somebody counts as moving
# throughout: half that of walking. People who sit or stand and watch have less than 0.05.
ACTIVE = 0.2
_ACTIVITY_STEP_S = 0.3
_LIMB_ENDS = [15, 16, 27, 28]  # wrists and ankles
# The mean distance of the keypoints, in sides of the region, while a target drifts onto another.
MERGER_DISTANCE = 0.25
MAX_MERGER_S = 0.38
# A lost person who is found for a shorter time, and lost again, was something else.
MIN_REAPPEARANCE_S = 0.1


def people_of(
    times: Sequence[float], tracklets: Sequence[Tracklet]
) -> tuple[list[list[Tracklet]], list[list[Tracklet]]]:
    """Return the tracklets of each person of a clip, the most prominent one first; and of those who
    may be mistakes of the detector.

    :param times: seconds of each frame of the clip, with a long gap at a cut.
    :param tracklets: in the order in which they begin; they are truncated.
    """
    if not tracklets:
        return [], []
    for tracklet in tracklets:
        tracklet.truncate(frames_before_flicker(tracklet, times))
        tracklet.truncate(frames_before_merger(tracklet, tracklets, times))
    tracklets = without_glimpses(tracklets, times)
    found = [[tracklets[k] for k in chain] for chain in link(tracklets, times)]
    counted = _plausible(found, times)
    prominence = [_prominence(person, times) for person in counted]
    order = sorted(range(len(counted)), key=lambda k: prominence[k], reverse=True)
    certain = _frames_in(CERTAIN_S, times)
    people = []
    for k in order:
        share = prominence[k] / prominence[order[0]]
        if _followed_frames(counted[k], times) >= certain:
            share *= _seen_frames(counted[order[0]]) / _seen_frames(counted[k])
        if share > MIN_PROMINENCE:
            people.append(counted[k])
    doubtful = [person for person in found if not any(person is each for each in people)]
    return people, doubtful


def seen_briefly(
    people: Sequence[list[Tracklet]], doubtful: Sequence[list[Tracklet]], times: Sequence[float]
) -> list[list[Tracklet]]:
    """Select, of those who may be mistakes of the detector, the people who are none, but were seen
    too briefly in a clip of this length; not those who are tiny beside the most prominent person.

    :param people: of `people_of`, at least one.
    """
    least = _frames_in(BRIEF_S, times)
    certain = _frames_in(CERTAIN_S, times)
    smallest = MIN_PROMINENCE * _prominence(people[0], times) / _seen_frames(people[0])
    return [
        person
        for person in doubtful
        if least <= _followed_frames(person, times) < certain
        and _prominence(person, times) / _seen_frames(person) > smallest
    ]


def _plausible(people: list[list[Tracklet]], times: Sequence[float]) -> list[list[Tracklet]]:
    """Select the people who were seen in enough frames, and for long enough without interruption.

    In a long clip, whoever was followed for `CERTAIN_S` was seen in enough: a share of an hour is
    longer than many who pass through are in the picture.

    At a low frame rate somebody may be elsewhere in every frame: where nobody was followed from
    frame to frame, one frame is enough.
    """
    certain = _frames_in(CERTAIN_S, times)
    frequent = [
        person
        for person in people
        if _seen_frames(person) >= MIN_SHARE * len(times)
        or _followed_frames(person, times) >= certain
    ]
    longest = [max(times[t.rows[-1]] - times[t.rows[0]] for t in person) for person in frequent]
    least = min(MIN_INTERVAL_S, 0.5 * (times[-1] - times[0]))
    if max(longest, default=0.0) < least and usual_step_s(times) >= MIN_INTERVAL_S:
        least = 0.0
    return [person for person, s in zip(frequent, longest, strict=True) if s >= least]


def _followed_frames(person: list[Tracklet], times: Sequence[float]) -> int:
    """Return in how many frames a person was seen at most, without gaps of over `LONG_GAP_S`:
    somebody may be hidden for a moment.
    """
    most = 0
    frames = 0
    end_s = -np.inf
    for tracklet in person:
        if times[tracklet.rows[0]] - end_s > LONG_GAP_S:
            frames = 0
        frames += len(tracklet.rows)
        most = max(most, frames)
        end_s = times[tracklet.rows[-1]]
    return most


def _seen_frames(person: list[Tracklet]) -> int:
    return sum(len(tracklet.rows) for tracklet in person)


def _frames_in(seconds: float, times: Sequence[float]) -> float:
    """Return how many frames a clip has in a time, by its usual rate; inf for a single frame."""
    if len(times) < 2:
        return np.inf
    return seconds / max(usual_step_s(times), 1e-6)


def frames_before_merger(
    tracklet: Tracklet, others: Sequence[Tracklet], times: Sequence[float]
) -> int:
    """Return how many frames of a tracklet come before it drifts onto a person who is seen after
    its end.

    A tracklet ends in this way when its person goes behind another one: for some frames the network
    already reports parts of the person in front.

    :param others: all tracklets of the clip; it does not matter whether ``tracklet`` is among them.
    """
    keep = len(tracklet.rows)
    if not keep:
        return 0
    end = tracklet.rows[-1]
    for other in others:
        if other is tracklet or not other.rows or other.rows[-1] <= end or other.rows[0] > end:
            continue
        index = {row: k for k, row in enumerate(other.rows)}
        for k in range(len(tracklet.rows) - 1, 0, -1):
            j = index.get(tracklet.rows[k])
            if j is None or times[end] - times[tracklet.rows[k]] > MAX_MERGER_S:
                break
            distance = np.linalg.norm(
                tracklet.values[k][:, :2] - other.values[j][:, :2], axis=1
            ).mean()
            if distance > MERGER_DISTANCE * min(tracklet.sides_px[k], other.sides_px[j]):
                break
            keep = min(keep, k)
    return keep


def frames_before_flicker(tracklet: Tracklet, times: Sequence[float]) -> int:
    """Return how many frames of a tracklet come before final reappearances that are too short to be
    plausible.

    Their position would mislead the association of tracklets.
    """
    end = len(tracklet.rows)
    while end:
        start = end - 1
        while start and tracklet.rows[start] == tracklet.rows[start - 1] + 1:
            start -= 1
        if (
            not start
            or times[tracklet.rows[end - 1]] - times[tracklet.rows[start]] >= MIN_REAPPEARANCE_S
        ):
            break
        end = start
    return end


def without_glimpses(tracklets: Sequence[Tracklet], times: Sequence[float]) -> list[Tracklet]:
    """Leave out tracklets that are too short to be plausible, unless others continue them, as where
    somebody moves too fast to be followed; all of them stay where there are no others.

    As the beginning of somebody who is found later, such a glimpse of another person would put the
    first one there.
    """
    begins = {tracklet.rows[0] for tracklet in tracklets if tracklet.rows}
    ends = {tracklet.rows[-1] for tracklet in tracklets if tracklet.rows}
    step_s = usual_step_s(times, alone=MIN_REAPPEARANCE_S)
    kept = []
    for tracklet in tracklets:
        if not tracklet.rows:
            continue
        first = tracklet.rows[0]
        last = tracklet.rows[-1]
        seconds = times[last] - times[first] + step_s
        is_continued = last + 1 in begins or first - 1 in ends
        if is_continued or seconds > MIN_REAPPEARANCE_S - 0.5 * step_s:
            kept.append(tracklet)
    return kept or list(tracklets)


def _prominence(person: list[Tracklet], times: Sequence[float]) -> float:
    """Return the person's size in the image, summed over the frames, and doubled for somebody who
    moves.

    Who walks or dances is the subject, rather than somebody of the same size who watches.
    """
    size = sum(float(np.sum(t.sides_px)) for t in person)
    return size * (1.0 + min(_activity(person, times) / ACTIVE, 1.0))


def _activity(person: list[Tracklet], times: Sequence[float]) -> float:
    """Return how fast hands and feet move relative to the trunk: the median over the clip, in sides
    of the region per second.

    A step of `_ACTIVITY_STEP_S` is long against the noise of keypoints.
    """
    speeds = []
    for tracklet in person:
        at = np.array([times[row] for row in tracklet.rows])
        later = np.searchsorted(at, at + _ACTIVITY_STEP_S)
        first = np.flatnonzero(later < len(at))
        if not len(first):
            continue
        limbs = np.array([values[_LIMB_ENDS, :2] for values in tracklet.values], float)
        limbs -= np.array(tracklet.centers_px)[:, None]
        moved = np.linalg.norm(limbs[later[first]] - limbs[first], axis=2).mean(axis=1)
        elapsed = at[later[first]] - at[first]
        speeds.append(moved / elapsed / np.array(tracklet.sides_px)[first])
    return float(np.median(np.concatenate(speeds))) if speeds else 0.0
