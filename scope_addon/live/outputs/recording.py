# SPDX-License-Identifier: GPL-3.0-or-later
"""A live capture as a motion file.

The rows are the source's frames, from the first to the last in which the person was seen. Frames
that were dropped, and those in which the person was not seen, are filled in and not valid, as in an
offline capture. The motion is the one that was given live, without its delay. Its world changes a
little in the first seconds, so that `world_from_camera` does, too; the shape is the final one.

Smoothing has delayed the poses: they are interpolated at the times of their source's frames, and
converted to the final shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ....solver import Body
from ....solver.rotations import exp, log
from ...capture.camera.intrinsics import Camera
from ...capture.camera.line_segments import Lines
from ...capture.fitting.frame_sequence import FittedTrack
from ...capture.perception.landmark_network import KEYPOINT_COUNT
from ...capture.tracking.track import Track
from ...capture.world.assemble import FittedPerson, Shot, assemble_motion
from ...capture.world.camera_path import CameraPath
from ...capture.world.placement import RawMotion, place_track
from ...errors import NoPersonError
from ...kinematics.contact_points import SOLES, contact_point_positions, with_contact_points
from ...motion import Motion
from ..pose import LivePose, Presence
from ..smoothing import DELAY_S

_SAME_TIME_S = 1e-3
_SAME_SHAPE = 0.01


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


def at_frames(poses: Sequence[LivePose], delay_s: float) -> list[LivePose]:
    """Return the poses that the body had in their frames.

    Each given pose is that of a time ``delay_s`` before its frame. At the time of a frame, the pose
    lies between two of them; what was measured in the frame stays. The last frames, whose poses
    would have been given later, are left out.

    :param poses: in the order of their frames, at least one.
    :return: at least one.
    """
    times = np.array([pose.timestamp_s for pose in poses])
    given_at = times - delay_s
    count = max(int(np.searchsorted(times, given_at[-1] + _SAME_TIME_S)), 1)
    after = np.minimum(np.searchsorted(given_at, times[:count] - _SAME_TIME_S), len(poses) - 1)
    return [_between(poses, k, int(after[k]), times[k] - given_at) for k in range(count)]


def _between(poses: Sequence[LivePose], k: int, after: int, since: NDArray[np.float64]) -> LivePose:
    """Return the pose in frame ``k``, before which ``poses[after - 1]`` was given, and
    ``poses[after]`` was not.

    :param since: (n,) seconds since each given pose.
    """
    later = poses[after]
    earlier = poses[max(after - 1, 0)]
    span = float(since[max(after - 1, 0)] - since[after])
    share = float(np.clip(since[max(after - 1, 0)] / span, 0.0, 1.0)) if span > 0 else 1.0
    # In the world, which may have moved between the two.
    R = later.T_world_camera[:3, :3]
    t = later.T_world_camera[:3, 3]
    R_earlier = earlier.T_world_camera[:3, :3]
    t_earlier = earlier.T_world_camera[:3, 3]
    before = earlier.rotations.copy()
    before[0] = R.T @ R_earlier @ before[0]
    root_before = (R_earlier @ earlier.root_cam + t_earlier - t) @ R
    turn = log(np.swapaxes(before, 1, 2) @ later.rotations)
    return replace(
        poses[k],
        betas=later.betas,
        rotations=before @ exp(share * turn),
        root_cam=root_before + share * (later.root_cam - root_before),
        T_world_camera=later.T_world_camera,
        joints=earlier.joints + share * (later.joints - earlier.joints),
        contact=earlier.contact + share * (later.contact - earlier.contact),
    )


def in_last_shape(poses: Sequence[LivePose], body: Body) -> list[LivePose]:
    """Return the poses in the shape of the last one, raised or lowered so that their lowest sole
    stays where it was.
    """
    final = poses[-1].betas
    out = []
    for pose in poses:
        if np.abs(pose.betas - final).max(initial=0.0) > _SAME_SHAPE:
            rise = _lowest_sole(body, pose, pose.betas) - _lowest_sole(body, pose, final)
            pose = replace(
                pose, betas=final, root_cam=pose.root_cam + rise * pose.T_world_camera[2, :3]
            )
        out.append(pose)
    return out


def _lowest_sole(body: Body, pose: LivePose, betas: NDArray[np.floating[Any]]) -> float:
    """Return the height of the lowest sole of a pose in a shape, relative to the camera, metres."""
    with_points = with_contact_points(body, betas)
    R, t = with_points.forward_kinematics(
        pose.rotations, pose.root_cam - with_points.rest_joints(betas)[0], betas
    )
    return float(
        (
            contact_point_positions(with_points, R, t)[: len(SOLES)] @ pose.T_world_camera[2, :3]
        ).min()
    )
