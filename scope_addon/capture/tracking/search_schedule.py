# SPDX-License-Identifier: GPL-3.0-or-later
"""When the detector searches a frame for people who are not tracked, and when it searches
closely; and which frames have masks of everybody, from which the shape is estimated later.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...arrays import Uint8Array
from ..perception.landmark_network import LandmarkNetwork
from ..perception.observation import Observation, PersonMask
from .frame_clock import FRAME_S, FrameClock
from .tracked_target import TrackedTarget

SEARCH_S = 8 * FRAME_S  # between two searches for people who have entered the picture
SEARCH_LARGEST_S = 20 * FRAME_S
# The time between two searches while a lost person is remembered, and for rivals in the opening.
SEARCH_LOST_S = 4 * FRAME_S
# The clip's opening: who is visible from the start may be the most prominent one of the clip.
OPENING_S = 2.0
SMALL_SHARE = 0.39  # of the picture's longer side
# The time between two searches for small people, each as long as some twenty plain ones.
SMALL_SEARCH_S = 1.0
# The longest time between two searches that take several times as long as a plain one.
RAREST_SEARCH_S = 64 * FRAME_S
# A plain detection may miss a person in a smaller region, in shorter sides of the picture.
SMALL_SIDE = 0.4
EAGER_S = 15 * FRAME_S  # for which a lost person is looked for in every frame
MASKS = 16  # for a clip, about; 8 give the same shape on real clips
MIN_STRIDE = 6  # frames between two masks in short clips
MIN_PRESENCE = 0.5  # in a region without a person, the network invents one


class SearchSchedule:
    """Decides for each frame whether and how to search it.

    ``live`` are the people tracked in it, and ``lost`` those remembered.

    :param people: how many people are wanted; None: only the most prominent one of the clip.
    """

    def __init__(self, clock: FrameClock, people: int | None) -> None:
        self._clock = clock
        self._largest_only = people is None
        self._wanted = people or 1
        self.forget()

    def forget(self) -> None:
        """Forget when the last searches were."""
        self._search_s = self._close_search_s = self._small_search_s = -math.inf
        self._thorough = _RarerSearch(self._clock)
        self._turned = _RarerSearch(self._clock)

    def is_due(
        self, image_rgb: Uint8Array, live: Sequence[TrackedTarget], lost: Sequence[TrackedTarget]
    ) -> bool:
        """Return whether to search this frame (H, W, 3)."""
        return self._clock.has_passed(
            self._interval_s(image_rgb, live, lost), self._clock.time_s - self._search_s
        )

    def begin(
        self, image_rgb: Uint8Array, live: Sequence[TrackedTarget], lost: Sequence[TrackedTarget]
    ) -> bool:
        """Note a search in this frame (H, W, 3).

        :return: whether to search closely: where somebody small may be, and less often at a low
            frame rate, because it costs more.
        """
        clock = self._clock
        self._search_s = clock.time_s
        closely = not self._largest_only or self._searches_for_rivals(image_rgb, live)
        if closely:
            interval_s = self._interval_s(image_rgb, live, lost) * max(
                1.0, math.sqrt(clock.step_s / FRAME_S)
            )
            closely = clock.has_passed(interval_s, clock.time_s - self._close_search_s)
        if closely:
            self._close_search_s = clock.time_s
        return closely

    def begin_small(
        self, image_rgb: Uint8Array, live: Sequence[TrackedTarget], lost: Sequence[TrackedTarget]
    ) -> bool:
        """Return whether to look for small people in this frame (H, W, 3), and if so, note it.

        Only where nobody is tracked, and nobody is remembered whom a plain detection would find
        again.
        """
        due = self._clock.has_passed(SMALL_SEARCH_S, self._clock.time_s - self._small_search_s)
        if live or not due or not _are_small(image_rgb, lost):
            return False
        self._small_search_s = self._clock.time_s
        return True

    def begin_thorough(self, live: Sequence[TrackedTarget]) -> bool:
        """Return whether to look for people beside larger ones and behind others in this frame, and
        if so, note it.

        Only where fewer people are tracked than are wanted, and more and more rarely until their
        number changes: somebody whom a close search missed is mostly there from the start.
        """
        is_wanted = not self._largest_only and 0 < len(live) < self._wanted
        return self._thorough.begin(len(live), is_wanted)

    def begin_turned(self, live: Sequence[TrackedTarget]) -> bool:
        """Return whether to look for people who are not upright in this frame, and if so, note it.

        Only where fewer people are tracked than are wanted, and more and more rarely until their
        number changes: it takes as long as three plain searches.
        """
        return self._turned.begin(len(live), len(live) < self._wanted)

    def _interval_s(
        self, image_rgb: Uint8Array, live: Sequence[TrackedTarget], lost: Sequence[TrackedTarget]
    ) -> float:
        """Return the seconds between two searches at present; 0: in every frame."""
        if not live or any(self._clock.is_within(EAGER_S, f.seen_s) for f in lost):
            return 0.0
        if lost or self._searches_for_rivals(image_rgb, live):
            return SEARCH_LOST_S
        # A small person may be somebody in the background, before the most prominent one comes.
        if self._largest_only:
            return SEARCH_LOST_S if _are_small(image_rgb, live) else SEARCH_LARGEST_S
        # As many as are wanted are tracked: a newcomer counts only if they become more prominent.
        complete = (
            len(live) >= self._wanted and self._clock.time_s >= self._clock.begin_s + OPENING_S
        )
        return SEARCH_LARGEST_S if complete else SEARCH_S

    def _searches_for_rivals(self, image_rgb: Uint8Array, live: Sequence[TrackedTarget]) -> bool:
        """Return whether somebody half as large as the most prominent person would be missed by a
        plain detection.
        """
        if not self._largest_only or self._clock.time_s >= self._clock.begin_s + OPENING_S:
            return False
        sides = [f.estimate.next_region.side_px for f in live]
        return bool(sides) and max(sides) < SMALL_SHARE * max(image_rgb.shape[:2])


class _RarerSearch:
    """A search that is repeated more and more rarely while as many people are tracked."""

    def __init__(self, clock: FrameClock) -> None:
        self._clock = clock
        self._search_s = -math.inf
        self._interval_s = SEARCH_LOST_S
        self._tracked = 0

    def begin(self, tracked: int, is_wanted: bool) -> bool:
        """Return whether the search is due in this frame, and if so, note it.

        :param tracked: how many people are tracked.
        :param is_wanted: whether it is of use in this frame.
        """
        if tracked != self._tracked:
            self._tracked = tracked
            self._interval_s = SEARCH_LOST_S
        elapsed_s = self._clock.time_s - self._search_s
        if not is_wanted or not self._clock.has_passed(self._interval_s, elapsed_s):
            return False
        self._search_s = self._clock.time_s
        self._interval_s = min(2 * self._interval_s, RAREST_SEARCH_S)
        return True


def _are_small(image_rgb: Uint8Array, people: Sequence[TrackedTarget]) -> bool:
    """Return whether nobody of these people is large enough to be found by a plain detection."""
    side_px = SMALL_SIDE * min(image_rgb.shape[:2])
    return all(person.estimate.region.side_px < side_px for person in people)


class MaskSchedule:
    """Adds masks to the observations of every n-th frame.

    When there are enough, n doubles: a clip of unknown length has hardly more masks than one of
    known length. The tracker knows beforehand which frame is due (`upcoming_is_due`), since its own
    run of the network gives masks at a quarter of the cost of another one; only people whom it was
    not following take that other run.

    :param network: None: no frame has masks.
    :param frames: how many frames are expected; 0 if that is unknown.
    """

    def __init__(self, network: LandmarkNetwork | None, frames: int) -> None:
        self._network = network
        self._stride = max(MIN_STRIDE, frames // MASKS)
        self._frames = 0
        self._masks = 0

    @property
    def upcoming_is_due(self) -> bool:
        """Whether the frame after the next one to be added will be due, if people are seen in the
        next one.
        """
        return self._network is not None and (self._frames + 1) % self._stride == 0

    def add(
        self, image_rgb: Uint8Array, observations: Sequence[tuple[int, Observation]]
    ) -> list[tuple[int, Observation]]:
        """Return the observations of the next frame (H, W, 3) with masks, if they are due."""
        found = list(observations)
        due = self._frames % self._stride == 0
        self._frames += bool(found)
        if self._network is None or not found or not due:
            return [(number, o if o.mask is None else replace(o, mask=None)) for number, o in found]
        self._masks += 1
        if self._masks % MASKS == 0:
            self._stride *= 2
        return [(number, self._with_mask(self._network, image_rgb, o)) for number, o in found]

    @staticmethod
    def _with_mask(
        network: LandmarkNetwork, image_rgb: Uint8Array, observation: Observation
    ) -> Observation:
        if observation.presence < MIN_PRESENCE:
            return replace(observation, mask=None)
        if observation.mask is not None:
            return observation
        probability = network.mask(image_rgb, observation.region).astype(np.float16)
        size = image_rgb.shape[1], image_rgb.shape[0]
        return replace(observation, mask=PersonMask(observation.region, probability, size))
