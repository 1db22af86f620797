# SPDX-License-Identifier: GPL-3.0-or-later
"""One person as one camera sees them: what synchronization and calibration need of a track."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import BoolArray, Float64Array, FloatArray, IndexArray
from ...scene_gaps import usual_step_s
from ..camera.intrinsics import Camera
from ..fitting.frame_measurements import place
from ..fitting.prepared_track import PreparedTrack
from ..perception.landmark_network import KEYPOINT_NAMES

# Names of keypoints that are the same places of a body from all sides: not hands, which are small,
# nor the face, which is hidden from behind.
NAMES = [
    f"{side}_{name}"
    for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "heel", "foot_index")
    for side in ("left", "right")
]
KEYPOINTS = np.array([KEYPOINT_NAMES.index(name) for name in NAMES])
# What keeps its length while the body moves; the trunk does so only roughly.
BONES = (
    ("shoulder", "elbow"),
    ("elbow", "wrist"),
    ("hip", "knee"),
    ("knee", "ankle"),
    ("ankle", "heel"),
    ("ankle", "foot_index"),
    ("shoulder", "hip"),
)
_ACROSS = ("shoulder", "hip")  # and from left to right
BONE_COUNT = len(BONES) + len(_ACROSS)
_ROWS = [
    (NAMES.index(f"{side}_{a}"), NAMES.index(f"{side}_{b}"), bone)
    for bone, (a, b) in enumerate(BONES)
    for side in ("left", "right")
] + [
    (NAMES.index(f"left_{name}"), NAMES.index(f"right_{name}"), len(BONES) + k)
    for k, name in enumerate(_ACROSS)
]
# Rows of bones: both ends, as numbers of `KEYPOINTS`, and the bone's own number.
BONE_STARTS, BONE_ENDS, BONE_OF_ROW = (np.array(column) for column in zip(*_ROWS, strict=True))
MIN_CONFIDENCE = 0.3  # of a keypoint that counts
# Between two frames between which keypoints are interpolated; at low frame rates, half a frame more
# than the usual time between two.
LONGEST_GAP_S = 0.12
LONGEST_GAP = 1.5


@dataclass(frozen=True)
class Between:
    """Where times (n,) lie between the frames of a camera that sees a person."""

    before: IndexArray  # (n,) the frame before
    after: IndexArray  # (n,) the frame after
    share: Float64Array  # (n,) 0..1 from the one to the other
    # (n,) whether the person is seen in both, and they are no farther apart than `LONGEST_GAP_S` or
    # `LONGEST_GAP`; False before the first frame and after the last one
    seen: BoolArray

    @classmethod
    def of(cls, own: Float64Array, seen: BoolArray, times: Float64Array) -> Between:
        """Look up times among those of the frames.

        :param own: (T,) times of the frames. :param seen: (T,) whether the person is seen.
        :param times: (n,).
        """
        after = np.clip(np.searchsorted(own, times), 1, max(len(own) - 1, 1))
        before = after - 1
        after = np.minimum(after, len(own) - 1)
        gap = own[after] - own[before]
        share = (times - own[before]) / np.maximum(gap, 1e-9)
        longest_s = max(LONGEST_GAP_S, LONGEST_GAP * usual_step_s(own))
        both: BoolArray = seen[before] & seen[after] & (gap <= longest_s)
        both &= (share >= -1e-9) & (share <= 1 + 1e-9)
        return cls(before, after, np.clip(share, 0.0, 1.0), both)

    def mixed(self, values: FloatArray) -> Float64Array:
        """Return values (T, ...) at the times (n, ...), by linear interpolation."""
        share: Float64Array = self.share.reshape(-1, *[1] * (values.ndim - 1))
        of_frames = np.asarray(values, np.float64)
        mixed: Float64Array = (1.0 - share) * of_frames[self.before]
        mixed += share * of_frames[self.after]
        return mixed

    def least(self, confidence: FloatArray) -> Float64Array:
        """Return the lower confidence (n, ...) of both frames, of (T, ...); 0 where not seen."""
        least = np.minimum(confidence[self.before], confidence[self.after])
        return least * self.seen.reshape(-1, *[1] * (least.ndim - 1))


@dataclass(frozen=True)
class SeenPerson:
    """A person in T frames of a camera, by the clock of its file. n keypoints, see `KEYPOINTS`."""

    times: Float64Array  # (T,) seconds, increasing
    seen: BoolArray  # (T,)
    rays: Float64Array  # (T, n, 2) normalized image coordinates, without lens distortion
    confidence: Float64Array  # (T, n) 0..1
    points: Float64Array  # (T, n, 3) lifted keypoints, hip-centred, camera axes, metres
    root: Float64Array  # (T, 3) the middle of the hips, camera, metres: uncertain along z

    def at(self, times: Float64Array) -> SeenPerson:
        """Return the person at other times (n,), by linear interpolation between frames.

        Times before the first frame, after the last one, in longer gaps than `Between` allows, or
        beside a frame in which the person is not seen are those of an unseen person.
        """
        between = Between.of(self.times, self.seen, times)
        confidence = between.least(self.confidence)
        rays, points, root = map(between.mixed, (self.rays, self.points, self.root))
        return SeenPerson(times, between.seen, rays, confidence, points, root)


def bone_lengths(keypoints: Float64Array) -> Float64Array:
    """Return the lengths (B,) of the bones of a body at rest, with keypoints (n, 3) in metres."""
    rows = np.linalg.norm(keypoints[BONE_ENDS] - keypoints[BONE_STARTS], axis=1)
    return np.array([rows[BONE_OF_ROW == bone].mean() for bone in range(BONE_COUNT)])


def seen_person(prepared: PreparedTrack, camera: Camera) -> SeenPerson:
    """Return what a camera sees of a person, of a lifted track."""
    track = prepared.track
    rays = camera.rays(track.keypoints_px)[..., :2]
    confidence = track.confidence * track.seen[:, None]
    points = np.asarray(prepared.lifted.points, float)
    root = np.array([place(points[k], rays[k], confidence[k]) for k in range(len(track))])
    return SeenPerson(
        np.asarray(track.times, float),
        track.seen,
        np.asarray(rays[:, KEYPOINTS], float),
        np.asarray(confidence[:, KEYPOINTS], float),
        points[:, KEYPOINTS],
        root,
    )
