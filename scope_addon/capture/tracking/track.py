# SPDX-License-Identifier: GPL-3.0-or-later
"""What the networks saw of one person: over an unbroken stretch of frames (tracklet), and over a clip (track)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..perception.landmark_network import KEYPOINT_COUNT
from ..perception.observation import PendingReference, Observation
from .appearance import SIZE as APPEARANCE_SIZE


@dataclass
class Track:
    """Observations of one person in T frames; rows where nobody was seen hold zeros and ``seen`` is False."""

    frames: np.ndarray  # (T,) i64 source frame index
    times: np.ndarray  # (T,) seconds
    seen: np.ndarray  # (T,) bool
    keypoints_px: np.ndarray  # (T, 33, 2) pixels of the decoded, upright frame
    confidence: np.ndarray  # (T, 33) 0..1
    world_landmarks: np.ndarray  # (T, 33, 3) metres, hip-centred, axes of the camera; all 0: unknown
    acquired: np.ndarray  # (T,) the person was not followed from the frame before, but found (again) in this one
    # The strong network's world landmarks, in few frames: rows (A,) and (A, 33, 3). See `left_right`.
    reference_rows: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    reference_landmarks: np.ndarray = field(default_factory=lambda: np.zeros((0, KEYPOINT_COUNT, 3)))
    # (T, 2, 21, 6) pixels, confidence, world landmarks of the left and right hand; None: they were not looked for.
    hands: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def has_depth(self) -> bool:
        """Whether the landmark network told depth; a user's keypoint network does not."""
        return bool(self.world_landmarks.any())

    def without_depth(self) -> Track:
        """The same, the world landmarks forgotten: of an hour they take 43 MB."""
        nothing = np.broadcast_to(np.float32(0.0), self.world_landmarks.shape)
        return replace(self, world_landmarks=nothing, reference_rows=self.reference_rows[:0], reference_landmarks=nothing[:0])


@dataclass
class Tracklet:
    """Grows frame by frame, in float32: an hour of one person takes some 90 MB, and no picture is kept."""

    rows: list[int] = field(default_factory=list)  # place of each frame in the clip
    values: list[np.ndarray] = field(default_factory=list)  # (33, 6) pixels, confidence, world landmarks
    centers_px: list[np.ndarray] = field(default_factory=list)  # (2,) middle of the trunk
    sides_px: list[float] = field(default_factory=list)  # of the region
    appearance: np.ndarray = field(default_factory=lambda: np.zeros(APPEARANCE_SIZE))  # sum over the frames
    judged: list[tuple[int, PendingReference]] = field(default_factory=list)
    hands: list[np.ndarray] = field(default_factory=list)  # (2, 21, 6) each; none when they are not looked for

    def add(self, row: int, observation: Observation) -> None:
        """Append the frame in place ``row``; what is not finite counts as not seen."""
        o = observation
        values = np.concatenate([o.keypoints_px, o.keypoints_confidence[:, None], o.world_landmarks], axis=1)
        if not np.isfinite(values).all():
            return
        self.rows.append(row)
        self.values.append(values.astype(np.float32))
        self.centers_px.append(o.keypoints_px[[11, 12, 23, 24]].mean(axis=0))
        self.sides_px.append(o.region.side_px)
        if o.appearance is not None:
            self.appearance = self.appearance + o.appearance
        if o.reference_landmarks is not None:
            self.judged.append((row, o.reference_landmarks))
        if o.hands is not None:
            self.hands.append(np.where(np.isfinite(o.hands), o.hands, 0.0).astype(np.float32))

    def cut(self, count: int) -> None:
        """Keep the first ``count`` frames."""
        if count < len(self.rows):
            end = self.rows[count]
            self.judged = [(row, w) for row, w in self.judged if row < end]
            del self.rows[count:], self.values[count:], self.centers_px[count:], self.sides_px[count:]
            del self.hands[count:]

    @property
    def prominence(self) -> float:
        """Size in the picture, summed over the frames."""
        return float(np.sum(self.sides_px))


def make_track(frames: Sequence[int], times: Sequence[float], tracklets: Sequence[Tracklet]) -> Track:
    """One person's track from tracklets that follow each other, in a clip of these frames."""
    keypoints, confidence, world = (np.zeros((len(frames), KEYPOINT_COUNT, n), np.float32) for n in (2, 1, 3))
    seen, acquired = np.zeros(len(frames), bool), np.zeros(len(frames), bool)
    judged: list[tuple[int, np.ndarray]] = []
    shapes = {hands.shape for tracklet in tracklets for hands in tracklet.hands[:1]}
    hands = np.zeros((len(frames), *shapes.pop()), np.float32) if shapes else None
    for tracklet in tracklets:
        if tracklet.rows:
            for row, value in zip(tracklet.rows, tracklet.values, strict=True):
                keypoints[row], confidence[row], world[row] = np.split(value, (2, 3), axis=1)
            seen[tracklet.rows] = True
            acquired[tracklet.rows[0]] = True
            results = [(row, look.result()) for row, look in tracklet.judged]
            judged += [(row, landmarks) for row, landmarks in results if landmarks is not None]
        if hands is not None and tracklet.hands:
            hands[tracklet.rows] = tracklet.hands
    return Track(
        frames=np.array(frames, np.int64),
        times=np.array(times, float),
        seen=seen,
        keypoints_px=keypoints,
        confidence=confidence[..., 0],
        world_landmarks=world,
        acquired=acquired,
        reference_rows=np.array([row for row, _ in judged], np.int64),
        reference_landmarks=np.array([w for _, w in judged], float).reshape(-1, KEYPOINT_COUNT, 3),
        hands=hands,
    )


def single_frame_track(observation: Observation) -> Track:
    """A track of one frame, without the judgement, which may still be awaited, and without fingers."""
    tracklet = Tracklet()
    tracklet.add(0, replace(observation, reference_landmarks=None, hands=None))
    return make_track([0], [0.0], [tracklet])
