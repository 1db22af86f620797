# SPDX-License-Identifier: GPL-3.0-or-later
"""Several people of one source: a given number of sessions, and who is followed by which of them.

Who is tracked from frame to frame keeps their session. Somebody who is found again gets the session
of the person whose position, motion, size and clothes match best, by the costs with which offline
captures link tracklets, but decided anew in each frame, by the clothes seen so far. Whoever was in
the picture while that person was still seen is somebody else. Otherwise a new person gets the first
session that has followed nobody yet, then one whose person has been away for long, and else none.

The first person is who was largest when the capture began. Camera and floor are estimated from
them, and the others stand in the same world.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from ...solver import Body
from ..arrays import Float64Array
from ..capture.camera.intrinsics import Camera
from ..capture.media.frame import AutoExposure, Frame
from ..capture.perception.observation import Observation
from ..capture.tracking.appearance import SIZE, distance
from ..capture.tracking.people import LONG_GAP_S, MAX_LINK_COST, End, cheapest_links, link_cost
from ..capture.tracking.track import trunk_px
from ..capture.tracking.tracker import PeopleTracker
from .pose import LivePose
from .session import LiveSession

_NEW_SHARE = 0.3  # of the newest frame in the velocity of somebody who is seen


@dataclass(eq=False)
class _Newcomer:
    """Somebody without a session: where their tracklet began, when they were seen last, and the sum
    of appearances.
    """

    tracklet: int
    start: End
    last_s: float
    appearance: Float64Array = field(default_factory=lambda: np.zeros(SIZE))


@dataclass(eq=False)
class _FollowedPerson:
    """A session, and who is followed by it: their tracklet, where they were seen last, and the sum
    of appearances.
    """

    session: LiveSession
    tracklet: int | None = None
    end: End | None = None
    appearance: Float64Array = field(default_factory=lambda: np.zeros(SIZE))

    @property
    def last_s(self) -> float:
        """When the person was seen last; -inf before there was one."""
        return -np.inf if self.end is None else self.end.time

    def update(self, observation: Observation, time_s: float) -> None:
        """Note that the person was seen, in the same tracklet as before."""
        self.end = _end(observation, time_s, self.end)
        if observation.appearance is not None:
            self.appearance = self.appearance + observation.appearance

    def take(self, newcomer: _Newcomer, observation: Observation, time_s: float) -> None:
        """Go on with the tracklet of somebody who was found, and is seen now."""
        self.tracklet = newcomer.tracklet
        self.end = _end(observation, time_s)
        self.appearance = self.appearance + newcomer.appearance

    def link_cost(self, newcomer: _Newcomer, time_s: float) -> float:
        """Return what it costs to take somebody who was found for the person, as in
        `tracking.people`; as much as no link if both were seen at once.
        """
        assert self.end is not None
        start = newcomer.start
        if start.time <= self.end.time:
            return MAX_LINK_COST
        # After so long, the session may go to anybody: clothes alone decide who gets it first.
        if time_s - self.end.time > LONG_GAP_S:
            start = replace(start, time=time_s)
        return link_cost(self.end, start, distance(self.appearance, newcomer.appearance))


class LivePeople:
    """Turns the frames of one source into poses of up to some people; one call per frame, in order.

    :param tracker: of all people if there are several sessions, otherwise of the largest one.
    :param camera: as known from the user or the source.
    :param size: width and height of the frames, pixels.
    :param heights_m: statures, as far as they are known, metres, by person.
    :param count: number of people, and of sessions.
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
        self._tracker = tracker
        self._exposure = AutoExposure()
        heights = [*heights_m, *[None] * count][:count]
        first = LiveSession(body, camera, size, heights[0], executor)
        others = [
            LiveSession(body, camera, size, height, executor, first) for height in heights[1:]
        ]
        self._followed = [_FollowedPerson(session) for session in (first, *others)]
        self._newcomers: dict[int, _Newcomer] = {}  # by tracklet

    @property
    def sessions(self) -> list[LiveSession]:
        """The session of each person."""
        return [person.session for person in self._followed]

    def step(self, frame: Frame) -> list[LivePose]:
        """Return the poses in the next frame, one of each person."""
        image_rgb = self._exposure.brighten(frame.image_rgb)
        observations = dict(self._tracker.step(image_rgb, None, frame.timestamp_s))
        before = [person.tracklet for person in self._followed]
        # who stays the same while they are seen, and then is the largest one
        if len(self._followed) > 1:
            self._assign_people(observations, frame.timestamp_s)
        elif observations and self._followed[0].tracklet not in observations:
            largest = max(observations, key=lambda k: observations[k].region.side_px)
            self._followed[0].tracklet = largest
        poses = []
        for number, person in enumerate(self._followed):
            observation = None if person.tracklet is None else observations.get(person.tracklet)
            # The tracker may have followed them for long: to the session, they are new.
            if observation is not None and person.tracklet != before[number]:
                observation = replace(observation, acquired=True)
            poses.append(replace(person.session.step(frame, observation), person=number))
        return poses

    def _assign_people(self, observations: Mapping[int, Observation], time_s: float) -> None:
        """Give sessions to those who have none, as far as there are free ones, and note who was
        seen.
        """
        by_tracklet: dict[int | None, _FollowedPerson] = {
            person.tracklet: person for person in self._followed
        }
        unknown = {k: seen for k, seen in observations.items() if k not in by_tracklet}
        self._note_newcomers(unknown, time_s)
        new = sorted(unknown, key=lambda tracklet: -unknown[tracklet].region.side_px)
        away = [person for person in self._followed if person.tracklet not in observations]
        known = [person for person in away if person.end is not None]
        cost = np.array(
            [[person.link_cost(self._newcomers[k], time_s) for k in new] for person in known]
        )
        links = cheapest_links(cost.reshape(len(known), len(new)), MAX_LINK_COST)
        people = {new[j]: known[i] for i, j in links.items()}
        free = [p for p in away if p not in people.values() and time_s - p.last_s > LONG_GAP_S]
        free.sort(key=lambda person: person.last_s)
        for tracklet in new:
            if tracklet not in people and free:
                people[tracklet] = free.pop(0)
                people[tracklet].appearance = np.zeros(SIZE)
        for tracklet, observation in observations.items():
            if tracklet in by_tracklet:
                by_tracklet[tracklet].update(observation, time_s)
            elif tracklet in people:
                people[tracklet].take(self._newcomers.pop(tracklet), observation, time_s)

    def _note_newcomers(self, unknown: Mapping[int, Observation], time_s: float) -> None:
        """Note who was seen without a session, and forget those who have been away for long."""
        for tracklet, observation in unknown.items():
            newcomer = self._newcomers.setdefault(
                tracklet, _Newcomer(tracklet, _end(observation, time_s), time_s)
            )
            newcomer.last_s = time_s
            if observation.appearance is not None:
                newcomer.appearance = newcomer.appearance + observation.appearance
        self._newcomers = {
            tracklet: newcomer
            for tracklet, newcomer in self._newcomers.items()
            if time_s - newcomer.last_s <= LONG_GAP_S
        }


def _end(observation: Observation, time_s: float, before: End | None = None) -> End:
    """Return where somebody is seen, and how fast they move if it is known where they were
    before.
    """
    center = trunk_px(observation.keypoints_px)
    velocity = np.zeros(2)
    if before is not None:
        velocity = before.velocity_px
        if time_s > before.time:
            now = (center - before.center_px) / (time_s - before.time)
            velocity = (1 - _NEW_SHARE) * velocity + _NEW_SHARE * now
    return End(time_s, center, velocity, observation.region.side_px)
