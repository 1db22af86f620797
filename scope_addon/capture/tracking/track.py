# SPDX-License-Identifier: GPL-3.0-or-later
"""What the networks report of one person: in an interval without interruption (tracklet), and in a
clip (track).
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import BoolArray, Float32Array, Float64Array, FloatArray
from ...scene_gaps import usual_step_s
from ..camera.intrinsics import Camera
from ..perception.face_record import RECORD
from ..perception.landmark_network import KEYPOINT_COUNT, TRUNK
from ..perception.observation import Observation, PendingReference, PersonMask
from .appearance import SIZE as APPEARANCE_SIZE

# Lists of a tracklet with one entry for each row; the last two may be empty.
_FOR_EACH_ROW = ("rows", "values", "centers_px", "sides_px", "hands", "faces")


@dataclass
class Track:
    """Observations of one person in T frames; rows where they were not seen hold zeros, and
    ``seen`` is False.

    ``acquired`` marks frames in which the person was found (again) rather than followed from the
    frame before. ``reference_rows`` and ``reference_landmarks`` are the reference network's world
    landmarks in a few frames, see `left_right`. ``hands`` holds what was seen of the left and the
    right hand, see `Observation`; None: hands were not looked for. ``masks`` holds the person's
    outline in a few frames, each with its row. ``face`` holds what was seen of the face, see
    `face_record`; None: it was not looked for.
    """

    frames: NDArray[np.int64]  # (T,) source frame index
    times: Float64Array  # (T,) seconds
    seen: BoolArray  # (T,)
    keypoints_px: FloatArray  # (T, 33, 2) pixels of the decoded, upright frame
    confidence: FloatArray  # (T, 33) 0..1
    # (T, 33, 3) metres, hip-centred, camera axes; all 0: unknown
    world_landmarks: FloatArray
    acquired: BoolArray  # (T,)
    reference_rows: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))  # (A,)
    reference_landmarks: FloatArray = field(  # (A, 33, 3)
        default_factory=lambda: np.zeros((0, KEYPOINT_COUNT, 3))
    )
    hands: FloatArray | None = None  # (T, 2, 21, 7)
    masks: tuple[tuple[int, PersonMask], ...] = ()
    face: FloatArray | None = None  # (T, RECORD)
    # (T,) focal length over that by which keypoints and hands are given; None: it is constant.
    # Masks and faces are given as they were seen.
    zoom: Float64Array | None = None

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def step_s(self) -> float:
        """The usual time from one frame to the next, 0 for a single frame."""
        return usual_step_s(self.times)

    @property
    def has_depth(self) -> bool:
        """Whether the landmark network estimated depth; a user's keypoint network does not."""
        return bool(self.world_landmarks.any())

    @property
    def has_hands(self) -> bool:
        """Whether some hand was seen."""
        return self.hands is not None and bool((self.hands[:, :, 0, 2] > 0).any())

    def steadied(self, camera: Camera, zoom: Float64Array) -> Track:
        """Return the track as it was seen by a lens that zooms, by a constant focal length.

        :param camera: with that focal length.
        :param zoom: (T,) the lens's over it.
        """
        steady = self.at_zoom(camera, 1.0 / zoom)
        masks = tuple((row, replace(mask, zoom=float(zoom[row]))) for row, mask in self.masks)
        return replace(steady, masks=masks, zoom=zoom)

    def as_seen(self, camera: Camera) -> Track:
        """Return the track with its keypoints and hands where they are in the image."""
        return self if self.zoom is None else self.at_zoom(camera, self.zoom)

    def at_zoom(self, camera: Camera, zoom: Float64Array) -> Track:
        """Return the track with keypoints and hands at (T,) times the focal length."""
        keypoints = camera.at_zoom(self.keypoints_px, zoom[:, None, None])
        keypoints = np.where(self.seen[:, None, None], keypoints, self.keypoints_px)
        hands = self.hands
        if hands is not None:
            hands = hands.copy()
            moved = camera.at_zoom(hands[..., :2], zoom[:, None, None, None])
            hands[..., :2] = np.where(hands[..., 2:3] != 0.0, moved, hands[..., :2])
        return replace(self, keypoints_px=keypoints.astype(self.keypoints_px.dtype), hands=hands)

    def without_depth(self) -> Track:
        """Return the track without world landmarks, which take 43 MB for an hour."""
        nothing = np.broadcast_to(np.float32(0.0), self.world_landmarks.shape)
        return replace(
            self,
            world_landmarks=nothing,
            reference_rows=self.reference_rows[:0],
            reference_landmarks=nothing[:0],
        )


@dataclass
class Tracklet:
    """Grows frame by frame, in single precision: one person takes some 90 MB for an hour, and no
    image is kept.
    """

    rows: list[int] = field(default_factory=list)  # index of each frame in the clip
    # (33, 6) pixels, confidence, world landmarks
    values: list[Float32Array] = field(default_factory=list)
    # (2,) middle of the trunk
    centers_px: list[FloatArray] = field(default_factory=list)
    sides_px: list[float] = field(default_factory=list)  # of the region
    # The sum over the frames.
    appearance: Float64Array = field(default_factory=lambda: np.zeros(APPEARANCE_SIZE))
    # Each with its row.
    references: list[tuple[int, PendingReference]] = field(default_factory=list)
    # (2, 21, 7), see `Observation`; empty if not wanted
    hands: list[Float32Array] = field(default_factory=list)
    masks: list[tuple[int, PersonMask]] = field(default_factory=list)  # each with its row
    # (RECORD,); empty if faces are not looked for
    faces: list[Float32Array] = field(default_factory=list)

    def add(self, row: int, observation: Observation) -> None:
        """Append the frame with index ``row``; an observation that is not finite counts as not
        seen.
        """
        o = observation
        values = np.concatenate(
            [o.keypoints_px, o.keypoints_confidence[:, None], o.world_landmarks], axis=1
        )
        if not np.isfinite(values).all():
            return
        self.rows.append(row)
        self.values.append(values.astype(np.float32))
        self.centers_px.append(trunk_px(o.keypoints_px))
        self.sides_px.append(o.region.side_px)
        if o.appearance is not None:
            self.appearance = self.appearance + o.appearance
        if o.reference_landmarks is not None:
            self.references.append((row, o.reference_landmarks))
        if o.mask is not None:
            self.masks.append((row, o.mask))
        if o.hands is not None:
            self.hands.append(o.hands)
        if o.face is not None:
            self.faces.append(o.face.astype(np.float32))

    def truncate(self, count: int) -> None:
        """Keep the first ``count`` frames."""
        if count < len(self.rows):
            end = self.rows[count]
            self.references = [(row, call) for row, call in self.references if row < end]
            self.masks = [(row, mask) for row, mask in self.masks if row < end]
            for name in _FOR_EACH_ROW:
                del getattr(self, name)[count:]

    def since(self, first: int, offset: int) -> Tracklet:
        """Return the frames from a row on as another tracklet, whose rows are larger by an
        offset.
        """
        at = bisect_left(self.rows, first)
        own = replace(
            self,
            references=[(row + offset, call) for row, call in self.references if row >= first],
            masks=[(row + offset, mask) for row, mask in self.masks if row >= first],
            **{name: getattr(self, name)[at:] for name in _FOR_EACH_ROW},
        )
        own.rows = [row + offset for row in own.rows]
        return own

    def extend(self, later: Tracklet) -> None:
        """Append another tracklet's frames, whose rows come after these."""
        for name in (*_FOR_EACH_ROW, "references", "masks"):
            getattr(self, name).extend(getattr(later, name))
        self.appearance = self.appearance + later.appearance


def trunk_px(keypoints_px: FloatArray) -> FloatArray:
    """Return the middle (2,) of the trunk, of keypoints (33, 2) in the image."""
    return keypoints_px[TRUNK].mean(axis=0)


def make_track(
    frames: Sequence[int], times: Sequence[float], tracklets: Sequence[Tracklet]
) -> Track:
    """Join one person's tracklets; waits for the reference network.

    :param frames: source frame index of each of the clip's T frames.
    :param tracklets: in order of time; their rows index ``frames``.
    """
    keypoints, confidence, world = (
        np.zeros((len(frames), KEYPOINT_COUNT, n), np.float32) for n in (2, 1, 3)
    )
    seen = np.zeros(len(frames), bool)
    acquired = np.zeros(len(frames), bool)
    references: list[tuple[int, NDArray[Any]]] = []
    shapes = {hands.shape for tracklet in tracklets for hands in tracklet.hands[:1]}
    hands = np.zeros((len(frames), *shapes.pop()), np.float32) if shapes else None
    face = (
        np.zeros((len(frames), RECORD), np.float32)
        if any(tracklet.faces for tracklet in tracklets)
        else None
    )
    for tracklet in tracklets:
        if tracklet.rows:
            for row, value in zip(tracklet.rows, tracklet.values, strict=True):
                keypoints[row], confidence[row], world[row] = np.split(value, (2, 3), axis=1)
            seen[tracklet.rows] = True
            acquired[tracklet.rows[0]] = True
            results = [(row, call.result()) for row, call in tracklet.references]
            references += [(row, landmarks) for row, landmarks in results if landmarks is not None]
        if hands is not None and tracklet.hands:
            hands[tracklet.rows] = tracklet.hands
        if face is not None and tracklet.faces:
            face[tracklet.rows] = tracklet.faces
    return Track(
        frames=np.array(frames, np.int64),
        times=np.array(times, float),
        seen=seen,
        keypoints_px=keypoints,
        confidence=confidence[..., 0],
        world_landmarks=world,
        acquired=acquired,
        reference_rows=np.array([row for row, _ in references], np.int64),
        reference_landmarks=np.array([w for _, w in references], float).reshape(
            -1, KEYPOINT_COUNT, 3
        ),
        hands=hands,
        masks=tuple(mask for tracklet in tracklets for mask in tracklet.masks),
        face=face,
    )


def track_of(times_s: Sequence[float], observations: Sequence[Observation]) -> Track:
    """Make a track of frames in all of which the person was seen.

    Hands, face and mask are left out, and reference landmarks, which may be pending.
    """
    tracklet = Tracklet()
    for row, observation in enumerate(observations):
        tracklet.add(
            row, replace(observation, reference_landmarks=None, hands=None, face=None, mask=None)
        )
    track = make_track(range(len(times_s)), times_s, [tracklet])
    track.acquired[:] = [observation.acquired for observation in observations]
    return track


def single_frame_track(observation: Observation) -> Track:
    """Make a track of one frame; see `track_of`."""
    return track_of([0.0], [observation])
