# SPDX-License-Identifier: GPL-3.0-or-later
"""What is observed of the people in one frame after another: body, hands, faces, outlines, cuts. No frame is kept."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..media.frame import Frame
from ..perception.observation import Observation
from ..tracking.face.face_tracker import FaceTracker
from ..tracking.hands.hand_tracker import HandTracker
from ..tracking.landmarks.mask_schedule import MaskSchedule
from ..tracking.scene_cuts import SceneCuts
from ..tracking.tracker import PeopleTracker
from .clock import StageClock


class Trackers(NamedTuple):
    """The trackers of people, and of what is captured only on request."""

    people: PeopleTracker
    hands: HandTracker | None
    faces: FaceTracker | None


class BrightenedFrame(NamedTuple):
    """A frame, and its image in the brightness that the networks are given."""

    frame: Frame
    lit: NDArray[np.uint8]


class FrameObserver:
    """Runs the networks on each frame."""

    def __init__(self, trackers: Trackers, masks: MaskSchedule, clock: StageClock) -> None:
        self._trackers, self._masks, self._clock = trackers, masks, clock
        self._cuts = SceneCuts()

    def step(
        self, now: BrightenedFrame, upcoming: BrightenedFrame | None, with_masks: bool
    ) -> tuple[list[tuple[int, Observation]], bool]:
        """Observe one frame.

        :param upcoming: the frame after it; None at the end of the clip.
        :param with_masks: whether the frame counts in the schedule of the outlines.
        :return: tracklet number and observation of each person, and whether the frame begins another scene.
        """
        frame, lit = now
        with self._clock.stage("networks"):
            upcoming_rgb = upcoming.frame.image_rgb if upcoming else None
            is_cut = self._cuts.is_cut(frame.image_rgb, upcoming_rgb)
            if is_cut:
                self._trackers.people.forget()
            due = with_masks and self._masks.upcoming_is_due
            observations = self._trackers.people.step(lit, upcoming.lit if upcoming else None, frame.timestamp_s, due)
            if with_masks:
                observations = self._masks.add(lit, observations)
        if self._trackers.hands is not None:
            with self._clock.stage("hands"):
                observations = self._trackers.hands.step(lit, observations, frame.timestamp_s)
        if self._trackers.faces is not None:
            with self._clock.stage("face"):
                observations = self._trackers.faces.step(lit, observations, frame.timestamp_s)
        return observations, is_cut
