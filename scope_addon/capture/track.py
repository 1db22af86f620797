# SPDX-License-Identifier: GPL-3.0-or-later
"""What the networks saw of one person over a clip, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .tracker import Observation


@dataclass
class Track:
    """Observations of one person in T frames; rows where nobody was seen hold zeros and ``seen`` is False."""

    frames: np.ndarray  # (T,) i64 source frame index
    times: np.ndarray  # (T,) seconds
    seen: np.ndarray  # (T,) bool
    keypoints_px: np.ndarray  # (T, 33, 2) pixels of the decoded, upright frame
    confidence: np.ndarray  # (T, 33) 0..1
    world_landmarks: np.ndarray  # (T, 33, 3) metres, hip-centred, axes of the camera
    acquired: np.ndarray  # (T,) found by the detector in this frame: it may be another person than before

    def __len__(self) -> int:
        return len(self.frames)


class TrackBuilder:
    """Collects observations frame by frame, in float32: an hour of video takes some 50 MB."""

    def __init__(self) -> None:
        self._frames: list[int] = []
        self._times: list[float] = []
        self._observations: list[np.ndarray | None] = []
        self._acquired: list[bool] = []

    def add(self, frame: int, time_s: float, observation: Observation | None) -> None:
        """Append one frame; ``None`` where the person was not seen."""
        self._frames.append(frame)
        self._times.append(time_s)
        self._acquired.append(observation is not None and observation.acquired)
        if observation is None:
            self._observations.append(None)
        else:
            o = observation
            row = np.concatenate([o.keypoints_px, o.keypoints_confidence[:, None], o.world_landmarks], axis=1)
            self._observations.append(row.astype(np.float32))

    def build(self) -> Track:
        """The arrays of everything added so far."""
        rows = np.zeros((len(self._frames), 33, 6))
        seen = np.zeros(len(self._frames), bool)
        for k, row in enumerate(self._observations):
            if row is not None and np.isfinite(row).all():
                rows[k], seen[k] = row, True
        return Track(
            frames=np.array(self._frames, np.int64),
            times=np.array(self._times, float),
            seen=seen,
            keypoints_px=rows[..., :2],
            confidence=rows[..., 2],
            world_landmarks=rows[..., 3:],
            acquired=np.array(self._acquired, bool),
        )
