# SPDX-License-Identifier: GPL-3.0-or-later
"""The people of a clip: collects the tracker's observations, and finally decides on identities and
prominence.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .association import link
from .track import Track, Tracklet, make_track

MIN_SHARE = 0.02  # of the frames; a person who was seen in fewer is a mistake of the detector
MIN_INTERVAL_S = 0.3  # the same for the longest time without interruption
MIN_PROMINENCE = 0.05  # of the most prominent person's
# mean distance of the keypoints, in sides of the region, while a target drifts onto another
MERGER_DISTANCE = 0.25
MAX_MERGER_S = 0.38
# a lost person who is found for a shorter time, and lost again, was something else
MIN_REAPPEARANCE_S = 0.1


def build_tracks(
    frames: Sequence[int], times: Sequence[float], tracklets: Sequence[Tracklet], most: int
) -> list[Track]:
    """Return the tracks of at most ``most`` people, the most prominent (size times frames) first.

    Each track has a row per frame. The list is empty if nobody was seen in enough frames to be
    plausible.

    :param frames: source frame index of each frame.
    :param times: their times in seconds, with a long gap at a cut.
    :param tracklets: in the order in which they begin; they are truncated.
    """
    if not tracklets:
        return []
    for tracklet in tracklets:
        tracklet.truncate(frames_before_flicker(tracklet, times))
        tracklet.truncate(frames_before_merger(tracklet, tracklets, times))
    people = [[tracklets[k] for k in chain] for chain in link(tracklets, times)]
    people.sort(key=_prominence, reverse=True)
    counted = _plausible(people, times)[:most]
    least = MIN_PROMINENCE * _prominence(counted[0]) if counted else 0.0
    return [make_track(frames, times, person) for person in counted if _prominence(person) >= least]


def _plausible(people: list[list[Tracklet]], times: Sequence[float]) -> list[list[Tracklet]]:
    """Select the people who were seen in enough frames, and for long enough without interruption.

    At a low frame rate somebody may be elsewhere in every frame: where nobody was followed from
    frame to frame, one frame is enough.
    """
    frequent = [
        person for person in people if sum(len(t.rows) for t in person) >= MIN_SHARE * len(times)
    ]
    longest = [max(times[t.rows[-1]] - times[t.rows[0]] for t in person) for person in frequent]
    least = min(MIN_INTERVAL_S, 0.5 * (times[-1] - times[0]))
    if max(longest, default=0.0) < least and np.median(np.diff(times)) >= MIN_INTERVAL_S:
        least = 0.0
    return [person for person, s in zip(frequent, longest, strict=True) if s >= least]


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


def _prominence(person: list[Tracklet]) -> float:
    """Return the person's size in the image, summed over the frames."""
    return sum(float(np.sum(t.sides_px)) for t in person)
