# SPDX-License-Identifier: GPL-3.0-or-later
"""Synthetic people for tests of tracking: images of coloured boxes, and networks that see people in
them.

The fake networks know where everybody is, and fail as the real ones do: an occluded person is not
detected, and the landmarks in a region are those of the visible person nearest to its centre,
whoever that is.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field

import cv2
import numpy as np
from scope.scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES, PoseEstimate
from scope.scope_addon.capture.perception.person_detector import Detection, Search
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.left_right import MIRROR_PARTNER

_HEIGHTS = {
    "shoulder": -0.5,
    "elbow": -0.3,
    "wrist": -0.1,
    "hip": 0.0,
    "knee": 0.45,
    "ankle": 0.85,
    "heel": 0.9,
}
_HEIGHTS |= {"foot": 0.9, "pinky": -0.05, "index": -0.05, "thumb": -0.05}


def _joint(name: str) -> tuple[float, float, float]:
    side = 0.15 if "left" in name else -0.15 if "right" in name else 0.0
    return (
        (2 * side if "wrist" in name else side),
        next((h for key, h in _HEIGHTS.items() if key in name), -0.7),
        0.0,
    )


_BODY = np.array([_joint(name) for name in KEYPOINT_NAMES])


@dataclass
class Person:
    """``center_px(t)`` of the hips, None outside the image; ``size_px``, pixels per metre;
    ``hidden`` frames.

    In the frames ``swapped`` the small network confuses left and right, in the frames ``lost`` it
    sees nobody, and in the frames ``turned`` it sees the person turned about the vertical axis by
    as many degrees.
    """

    center_px: Callable[[int], tuple[float, float] | None]
    color: tuple[int, int, int]
    size_px: float = 100.0
    hidden: range = range(0)
    swapped: Collection[int] = ()
    lost: Collection[int] = ()
    turned: Mapping[int, float] = field(default_factory=dict)

    def place(self, t: int) -> np.ndarray | None:
        center = self.center_px(t)
        return None if t in self.hidden or center is None else np.asarray(center, float)

    def body(self, t: int) -> np.ndarray:
        """(33, 3) metres, with arms and legs that move."""
        swing = 0.1 * np.sin(0.3 * t + np.arange(33))
        return _BODY + np.stack([swing, np.zeros(33), swing], axis=1)


def pictures(
    people: list[Person], count: int, size: tuple[int, int] = (1200, 400)
) -> Iterator[np.ndarray]:
    for t in range(count):
        image = np.full((size[1], size[0], 3), 128, np.uint8)
        for person in people:
            place = person.place(t)
            if place is not None:
                half = np.array([0.3, 0.9]) * person.size_px
                low, high = (
                    tuple(int(v) for v in corner) for corner in (place - half, place + half)
                )
                cv2.rectangle(image, low, high, person.color, -1)
        image[0, 0] = t % 256, t // 256, 0
        yield image


def _time(image: np.ndarray) -> int:
    return int(image[0, 0, 0]) + 256 * int(image[0, 0, 1])


class FakeDetector:
    def __init__(self, people: list[Person]) -> None:
        self.people = people
        self.calls = 0
        self.close_calls = 0

    def detect(self, image: np.ndarray, closely: bool = False) -> list[Detection]:
        self.calls += 1
        self.close_calls += closely
        found = []
        for person in self.people:
            place = person.place(_time(image))
            if place is not None:
                points = np.array([place, place - [0, person.size_px], place, place])
                found.append(Detection(0.95, np.zeros(4), points))
        return found

    def detect_smaller(self, image: np.ndarray, search: Search) -> list[Detection]:
        return []

    def detect_turned(self, image: np.ndarray) -> list[Detection]:
        return []


class FakeLandmarks:
    def __init__(self, people: list[Person], is_reliable: bool = False) -> None:
        self.people = people
        self.is_reliable = is_reliable
        self.batches: list[int] = []
        self.begun = 0

    def estimate(self, image: np.ndarray, regions: list[Region]) -> list[PoseEstimate]:
        self.batches.append(len(regions))
        return [self._one(_time(image), region) for region in regions]

    def begin(
        self, image: np.ndarray, region: Region, with_mask: bool = False
    ) -> Future[PoseEstimate]:
        call: Future[PoseEstimate] = Future()
        call.set_result(self._one(_time(image), region))
        self.begun += 1
        return call

    def _one(self, t: int, region: Region) -> PoseEstimate:
        def distance(person: Person) -> float:
            place = person.place(t)
            return (
                np.inf
                if place is None
                else float(np.linalg.norm(place - region.center_px)) / region.side_px
            )

        person = min(self.people, key=distance)
        seen = distance(person) < 0.4 and (self.is_reliable or t not in person.lost)
        place = person.place(t) if seen else np.asarray(region.center_px)
        assert place is not None  # a person who is seen is at a finite distance
        body = person.body(t)
        if t in person.swapped and not self.is_reliable:
            body = body[MIRROR_PARTNER]
        if t in person.turned and not self.is_reliable:
            angle = np.radians(person.turned[t])
            c = np.cos(angle)
            s = np.sin(angle)
            body = body @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        there = Region((float(place[0]), float(place[1])), 2.5 * person.size_px, 0.0)
        return PoseEstimate(
            keypoints_px=place + body[:, :2] * person.size_px,
            keypoints_confidence=np.ones(33),
            world_landmarks=body,
            presence=0.99 if seen else 0.0,
            region=region if seen else there,
            next_region=there,
        )
