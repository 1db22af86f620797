# SPDX-License-Identifier: GPL-3.0-or-later
"""Several people of one source: a session for each of a given number of places, and who takes which of them.

Who is tracked from frame to frame keeps their place. Somebody who is found again gets the place of the person whose
position, motion, size and clothes match best, by the costs with which offline captures link tracklets, but decided at
once. Otherwise a new person takes the first free place, then one whose person has been away for long, and else none.

The person in the first place is who was largest when the capture began. Camera and floor are estimated from them, and
the others stand in the same world.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ...solver import Body
from ..capture.camera.intrinsics import Camera
from ..capture.media.frame import Frame
from ..capture.perception.observation import Observation
from ..capture.tracking.appearance import SIZE, distance
from ..capture.tracking.association import LONG_GAP_S, MAX_LINK_COST, End, cheapest_links, link_cost
from ..capture.tracking.tracker import PeopleTracker
from .pose import LivePose
from .session import LiveSession

_NO_LINK = 1e6


@dataclass
class _Place:
    """A session, and who is followed by it: their tracklet, where they were seen last, and the sum of appearances."""

    session: LiveSession
    tracklet: int | None = None
    end: End | None = None
    appearance: NDArray[np.float64] = field(default_factory=lambda: np.zeros(SIZE))

    def see(self, tracklet: int, observation: Observation, time_s: float) -> None:
        """Note that the person was seen."""
        before = self.end if self.tracklet == tracklet else None
        self.tracklet, self.end = tracklet, _end(observation, time_s, before)
        if observation.appearance is not None:
            self.appearance = self.appearance + observation.appearance


class LivePeople:
    """Turns the frames of one source into poses of up to some people; one call per frame, in order.

    :param camera: as known from the user or the source.
    :param size: width and height of the frames, pixels.
    :param heights_m: statures, as far as they are known, metres, by place.
    :param count: number of places.
    :param executor: see `LiveSession`.
    """

    def __init__(
        self,
        body: Body,
        tracker: PeopleTracker,
        camera: Camera,
        size: tuple[int, int],
        *,
        heights_m: Sequence[float] = (),
        count: int = 1,
        executor: Executor | None = None,
    ) -> None:
        heights = [*heights_m, *[None] * count][:count]
        first = LiveSession(body, tracker, camera, size, heights[0], executor)
        others = [LiveSession(body, tracker, camera, size, height, executor, first) for height in heights[1:]]
        self._places = [_Place(session) for session in (first, *others)]

    @property
    def sessions(self) -> list[LiveSession]:
        """The session of each place."""
        return [place.session for place in self._places]

    def step(self, frame: Frame) -> list[LivePose]:
        """Return the poses in the next frame, one of each place."""
        first = self._places[0].session
        if len(self._places) == 1:
            return [first.step(frame)]
        observations = dict(first.track(frame))
        self._take_places(observations, frame.timestamp_s)
        poses = []
        for number, place in enumerate(self._places):
            observation = None if place.tracklet is None else observations.get(place.tracklet)
            poses.append(replace(place.session.follow(frame, observation), person=number))
        return poses

    def _take_places(self, observations: Mapping[int, Observation], time_s: float) -> None:
        """Give places to those who have none, as far as there are free ones, and note who was seen."""
        taken = {place.tracklet for place in self._places}
        new = [tracklet for tracklet in observations if tracklet not in taken]
        new.sort(key=lambda tracklet: -observations[tracklet].region.side_px)
        left = [place for place in self._places if place.tracklet not in observations and place.end is not None]
        unused = [place for place in self._places if place.end is None]
        cost = np.full((len(left), len(new)), _NO_LINK)
        for i, place in enumerate(left):
            for j, tracklet in enumerate(new):
                seen = observations[tracklet]
                unlike = distance(place.appearance, np.zeros(SIZE) if seen.appearance is None else seen.appearance)
                assert place.end is not None
                cost[i, j] = link_cost(place.end, _end(seen, time_s), unlike)
        links = {j: left[i] for i, j in cheapest_links(cost, MAX_LINK_COST).items()}
        away = [p for p in left if p not in links.values() and p.end is not None and time_s - p.end.time > LONG_GAP_S]
        free = unused + sorted(away, key=lambda place: place.end.time if place.end else 0.0)
        for j, tracklet in enumerate(new):
            chosen = links.get(j) or (free.pop(0) if free else None)
            if chosen is not None:
                if j not in links:  # somebody else
                    chosen.appearance = np.zeros(SIZE)
                chosen.see(tracklet, observations[tracklet], time_s)
        for place in self._places:
            if place.tracklet in observations and place.end is not None and place.end.time < time_s:
                assert place.tracklet is not None
                place.see(place.tracklet, observations[place.tracklet], time_s)


def _end(observation: Observation, time_s: float, before: End | None = None) -> End:
    """Return where somebody is seen, and how fast they move if it is known where they were before."""
    center = observation.keypoints_px[[11, 12, 23, 24]].mean(axis=0)  # of the trunk
    velocity = np.zeros(2)
    if before is not None and time_s > before.time:
        now = (center - before.center_px) / (time_s - before.time)
        velocity = 0.7 * before.velocity_px + 0.3 * now
    return End(time_s, center, velocity, observation.region.side_px)
