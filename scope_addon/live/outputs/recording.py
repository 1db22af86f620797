# SPDX-License-Identifier: GPL-3.0-or-later
"""A live capture as a motion file.

The rows are the source's frames, from the first to the last in which the person was seen. Frames
that were dropped, and those in which the person was not seen, are filled in and not valid, as in an
offline capture. The motion is the one that was given live, without its delay. Its world changes a
little in the first seconds, so that `world_from_camera` does, too; the shape is the final one.
"""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ....solver import Body
from ...capture.camera.intrinsics import Camera
from ...capture.camera.line_segments import Lines
from ...capture.fitting.frame_sequence import FittedTrack
from ...capture.perception.landmark_network import KEYPOINT_COUNT
from ...capture.tracking.track import Track
from ...capture.world.assemble import FittedPerson, Shot, assemble_motion
from ...capture.world.camera_path import CameraPath
from ...capture.world.placement import RawMotion, place_track
from ...errors import NoPersonError
from ...motion import Motion
from ..pose import LivePose, Presence
from ..smoothing import DELAY_S
from .frame_poses import at_frames, in_last_shape


class Recorded(Protocol):
    """What a recording has to know of its source."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def fps(self) -> Fraction:
        """Its frames per second."""


class WithCamera(Protocol):
    """Where a recording's camera comes from, as from a `LiveSession`."""

    @property
    def camera(self) -> Camera | None:
        """The camera as it is known now."""


class Recording:
    """Keeps every pose, some 3 kB each."""

    def __init__(self, path: Path, body: Body, source: Recorded) -> None:
        self.path = path
        self._body = body
        self._source = source
        self._poses: list[LivePose] = []
        self._session: WithCamera | None = None
        self._size = (1, 1)

    def begin(self, session: WithCamera, size: tuple[int, int]) -> None:
        """Note where the poses come from."""
        self._session = session
        self._size = size

    def send(self, pose: LivePose, latency_ms: float) -> None:
        """Keep a pose in which the person is seen."""
        if pose.presence is Presence.SEEN:
            self._poses.append(pose)

    def result(self, origin: tuple[int, float] | None = None) -> Motion:
        """Return the motion to write.

        :param origin: the frame number and time that become 0; None: they are those of the source.
        :raises NoPersonError: nobody was seen.
        """
        if not self._poses or self._session is None or self._session.camera is None:
            raise NoPersonError(
                f"nobody was seen in {self._source.name}, so nothing was recorded; at least one "
                "person must be mostly "
                "in the image"
            )
        motion = self.motion(self._session.camera)
        if origin is not None:
            motion.frames -= origin[0]
            motion.timestamps -= origin[1]
        return motion

    @property
    def first(self) -> tuple[int, float] | None:
        """Number and time of the first frame; None before there is one."""
        return (self._poses[0].index, self._poses[0].timestamp_s) if self._poses else None

    @property
    def seconds(self) -> float:
        """Duration so far."""
        return self._poses[-1].timestamp_s - self._poses[0].timestamp_s if self._poses else 0.0

    @property
    def camera(self) -> Camera | None:
        """The camera as it is known now; None before somebody was seen."""
        return None if self._session is None else self._session.camera

    def motion(self, camera: Camera) -> Motion:
        """Return the motion so far, at least one pose.

        :param camera: as estimated at the end.
        """
        poses = in_last_shape(at_frames(self._poses, DELAY_S), self._body)
        rows = np.array([pose.index for pose in poses])
        rows -= rows[0]
        T = int(rows[-1]) + 1
        nearest = np.maximum(np.searchsorted(rows, np.arange(T), side="right") - 1, 0)
        T_world_frame = _stacked(poses, "T_world_camera")[nearest]
        T_first_frame = np.linalg.inv(T_world_frame[0]) @ T_world_frame
        path = CameraPath(T_first_frame[:, :3, :3], T_first_frame[:, :3, 3])
        given, raw = (self._fitted(poses, rows, nearest, prefix) for prefix in ("", "raw_"))
        track = self._track(poses, rows, T)
        placed = place_track(self._body, track, given, smoothing=False, path=path)
        contact = np.zeros((T, len(poses[0].contact)))
        contact[rows] = _stacked(poses, "contact")
        shot = Shot(
            self._body, camera, path, Lines.none(), self._source.fps, self._size, self._source.name
        )
        person = FittedPerson(track, RawMotion.of(track, raw, path), self._body)
        return assemble_motion(shot, person, placed, contact, T_world_frame[0])

    def _track(self, poses: list[LivePose], rows: NDArray[np.intp], T: int) -> Track:
        first = poses[0].index
        times = np.array([pose.timestamp_s for pose in poses])
        keypoints = np.zeros((T, KEYPOINT_COUNT, 3), np.float32)
        keypoints[rows] = _stacked(poses, "keypoints")
        seen = np.zeros(T, bool)
        seen[rows] = True
        return Track(
            frames=first + np.arange(T),
            times=np.interp(np.arange(T), rows, times),
            seen=seen,
            keypoints_px=keypoints[..., :2],
            confidence=keypoints[..., 2],
            world_landmarks=np.zeros((T, KEYPOINT_COUNT, 3), np.float32),
            acquired=np.zeros(T, bool),
        )

    def _fitted(
        self, poses: list[LivePose], rows: NDArray[np.intp], nearest: NDArray[np.intp], prefix: str
    ) -> FittedTrack:
        valid = np.zeros(len(nearest), bool)
        valid[rows] = True
        confidence = _stacked(poses, "joint_confidence")[nearest] * valid[:, None]
        return FittedTrack(
            _stacked(poses, f"{prefix}rotations")[nearest],
            _stacked(poses, f"{prefix}root_cam")[nearest],
            poses[-1].betas,
            valid,
            confidence,
            0.0,
        )


def _stacked(poses: list[LivePose], name: str) -> NDArray[Any]:
    return np.array([getattr(pose, name) for pose in poses])
