# SPDX-License-Identifier: GPL-3.0-or-later
"""The person whom the user chose by a place in the picture; and footage that seems to be turned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Float64Array
from ...errors import UsageError
from ..perception.landmark_network import HIPS, SHOULDERS, TRUNK
from .track import Track, Tracklet

MAX_DISTANCE = 0.2  # from the nearest keypoint, in sides of the region
MAX_DELAY_S = 0.5  # between the chosen time and a frame in which the person was seen


@dataclass(frozen=True)
class ChosenPerson:
    """Who is at ``x``, ``y`` pixels of the upright picture at ``time_s`` in the footage; None: at
    the beginning.
    """

    x: float
    y: float
    time_s: float | None

    def __str__(self) -> str:
        """Write the place as the option has it."""
        time = "" if self.time_s is None else f"@{self.time_s:.2f}"
        return f"{self.x:.0f},{self.y:.0f}{time}"


def find_chosen(
    chosen: ChosenPerson,
    people: Sequence[list[Tracklet]],
    doubtful: Sequence[list[Tracklet]],
    times_s: Sequence[float],
) -> list[Tracklet]:
    """Return the one of the people who is the chosen one.

    :param people: the tracklets of each.
    :param doubtful: of those who are chosen only where none of the people is.
    :param times_s: of the clip's frames.
    :raises UsageError: nobody is near that place then; the message says where people are.
    """
    time_s = times_s[0] if chosen.time_s is None else chosen.time_s
    place = np.array([chosen.x, chosen.y])
    distances = []
    others = []
    for person in (*people, *doubtful):
        tracklet, k = _nearest_frame(person, times_s, time_s)
        if abs(times_s[tracklet.rows[k]] - time_s) > MAX_DELAY_S:
            distances.append(np.inf)
            continue
        points: Float64Array = tracklet.values[k][:, :2].astype(float)
        distance = np.linalg.norm(points - place, axis=1).min()
        distances.append(float(distance / tracklet.sides_px[k]))
        x, y = tracklet.centers_px[k]
        others.append(f"{x:.0f},{y:.0f}")
    nearest = int(np.argmin(distances[: len(people)] or distances))
    if distances[nearest] > MAX_DISTANCE:
        nearest = int(np.argmin(distances))
    if distances[nearest] > MAX_DISTANCE:
        seen = f"people are then at {' and '.join(others)}" if others else "nobody was seen then"
        raise UsageError(f"--person {chosen}: nobody was found there at {time_s:.2f} s; {seen}")
    return [*people, *doubtful][nearest]


def place_of(person: Sequence[Tracklet], times_s: Sequence[float]) -> ChosenPerson:
    """Return a place by which a person can be chosen: in the middle of the longest tracklet."""
    longest = max(person, key=lambda tracklet: len(tracklet.rows))
    k = len(longest.rows) // 2
    x, y = longest.centers_px[k].tolist()
    return ChosenPerson(x, y, times_s[longest.rows[k]])


def _nearest_frame(
    person: Sequence[Tracklet], times_s: Sequence[float], time_s: float
) -> tuple[Tracklet, int]:
    """Return the tracklet, and the number of its frame, that is nearest to a time."""
    frames = [
        (abs(times_s[row] - time_s), number, k)
        for number, tracklet in enumerate(person)
        for k, row in enumerate(tracklet.rows)
    ]
    _, number, k = min(frames)
    return person[number], k


MIN_CONFIDENCE = 0.5  # of shoulders and hips that count
MAX_DEVIATION_DEG = 35.0  # of the trunk from a quarter turn
MIN_SHARE = 0.9  # of the frames in which the trunk has this direction
MIN_FRAMES = 10  # in which it was seen; in fewer, somebody may just lie


def needed_turn(track: Track) -> int:
    """Return by how many degrees clockwise a picture has to be turned for the person's trunk to be
    upright: a multiple of 90; 0 also where the trunk's direction changes.
    """
    confidence = track.confidence[:, TRUNK].min(axis=1)
    shoulders = track.keypoints_px[:, SHOULDERS].mean(axis=1)
    hips = track.keypoints_px[:, HIPS].mean(axis=1)
    trunk = (shoulders - hips)[track.seen & (confidence > MIN_CONFIDENCE)].astype(float)
    if len(trunk) < MIN_FRAMES:
        return 0
    clockwise_deg = np.degrees(np.arctan2(trunk[:, 0], -trunk[:, 1]))
    for turn_deg in (90, 180, 270):
        deviation = (clockwise_deg + turn_deg + 180.0) % 360.0 - 180.0
        if (np.abs(deviation) < MAX_DEVIATION_DEG).mean() >= MIN_SHARE:
            return turn_deg
    return 0
