# SPDX-License-Identifier: GPL-3.0-or-later
"""A live capture as motion files, one for each person, that begin together.

The rows are the frames that were processed, from the first to the last in which the person was
seen. Those in which the person was not seen are filled in and not valid, as in an offline capture;
dropped ones have no rows. After an interruption of the source, another scene begins. The motion is
the one that was given live, without its delay. Its world changes a little in the first seconds, so
that `world_from_camera` does, too; the shape is the final one.

Smoothing has delayed the poses: they are interpolated at the times of their source's frames, and
converted to the final shape.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...solver import Body
from ..arrays import Float64Array, FloatArray, IndexArray
from ..capture.camera.intrinsics import Camera
from ..capture.camera.line_segments import Lines
from ..capture.fitting.frame_sequence import FittedTrack
from ..capture.media.frame_readers import MEASURED_WITHIN, nearest_fps
from ..capture.perception.landmark_network import KEYPOINT_COUNT
from ..capture.tracking.track import Track
from ..capture.world.assemble import Shot, assemble_motion
from ..capture.world.camera_path import CameraPath
from ..capture.world.placement import MAX_STEP_S, RawMotion, place_track
from ..errors import NoPersonError, OutputError, UsageError
from ..kinematics.contact_points import SOLES, contact_point_positions, with_contact_points
from ..kinematics.smoothing import interpolate_rotations
from ..motion import Motion
from ..temporary import is_held, remove
from ..untrusted.body_file import load_body
from .journal import About, Journal, fingerprint, read_about, read_records, saved_elsewhere
from .people import LivePeople
from .pose import LivePose, Presence
from .session import LiveSession
from .smoothing import DELAY_S
from .source import Source
from .unfinished import Target, lock_of

_SAME_TIME_S = 1e-3
_SAME_SHAPE = 0.01
# Over which the frame rate is measured, about 1 to 10 s: the images of a network camera come
# unevenly, and several at once, so that times of neighbours say little.
_FEWEST_RATE_ROWS = 30
_MOST_RATE_ROWS = 300


class Recording:
    """Keeps every pose, some 3 kB each."""

    def __init__(self, path: Path, body: Body, source: Source | _Source) -> None:
        self.path = path
        self._body = body
        self._source = source
        self._poses: list[LivePose] = []
        # number and time of each frame since the first in which the person was not seen
        self._unseen: dict[int, float] = {}
        self._session: LiveSession | _LastCamera | None = None
        self._size = (1, 1)

    def begin(self, session: LiveSession | _LastCamera, size: tuple[int, int]) -> None:
        """Note where the poses come from."""
        self._session = session
        self._size = size

    def send(self, pose: LivePose, latency_ms: float) -> None:
        """Keep a pose in which the person is seen, and the time of others."""
        if pose.presence is Presence.SEEN:
            self._poses.append(pose)
        elif self._poses:
            self._unseen[pose.index] = pose.timestamp_s

    def result(self, origin: tuple[int, float] | None = None) -> Motion:
        """Return the motion to write.

        :param origin: the frame number and time that become 0; None: they are those of the source.
        :raises NoPersonError: nobody was seen.
        """
        if not self._poses or self._session is None or self._session.camera is None:
            raise NoPersonError(
                f"nobody was seen in {self._source.name}, so nothing was recorded; at least one "
                "person must be mostly in the image"
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
        seen = {pose.index: pose.timestamp_s for pose in poses}
        unseen = {k: time_s for k, time_s in self._unseen.items() if k < poses[-1].index}
        frames, times = np.array(sorted((seen | unseen).items())).T
        rows = np.searchsorted(frames, list(seen))
        T = len(frames)
        nearest = np.searchsorted(rows, np.arange(T), side="right") - 1
        T_world_frame = _stacked(poses, "T_world_camera")[nearest]
        T_first_frame = np.linalg.inv(T_world_frame[0]) @ T_world_frame
        path = CameraPath(T_first_frame[:, :3, :3], T_first_frame[:, :3, 3])
        given, raw = (self._fitted(poses, rows, nearest, prefix) for prefix in ("", "raw_"))
        track = self._track(poses, rows, frames.astype(int), times)
        placed = place_track(self._body, track, given, smoothing=False, path=path)
        contact = np.zeros((T, len(poses[0].contact)))
        contact[rows] = _stacked(poses, "contact")
        shot = Shot(
            self._body,
            camera,
            path,
            Lines.none(),
            self._fps(track),
            self._size,
            self._source.name,
            speed=self._source.speed,
        )
        raw_motion = RawMotion.of(track, raw, path)
        motion = assemble_motion(
            shot, track, self._body, raw_motion, placed, contact, T_world_frame[0]
        )
        return replace(motion, scene_starts=np.flatnonzero(np.diff(times) > MAX_STEP_S) + 1)

    def _fps(self, track: Track) -> Fraction:
        """Return the source's frame rate: by the times of its frames where these contradict it, as
        those of many cameras do in the dark.
        """
        said = self._source.fps
        scenes = np.cumsum(np.diff(track.times, prepend=track.times[0]) > MAX_STEP_S)
        longest = np.bincount(scenes).max()
        rows = int(np.clip(longest // 2, _FEWEST_RATE_ROWS, _MOST_RATE_ROWS))
        is_in_one_scene = scenes[rows:] == scenes[:-rows]
        if not is_in_one_scene.any():
            return said
        passed_frames = track.frames[rows:] - track.frames[:-rows]
        passed_s = track.times[rows:] - track.times[:-rows]
        measured = float(np.median((passed_frames / passed_s)[is_in_one_scene]))
        if abs(measured - said) < MEASURED_WITHIN * measured:
            return said
        return nearest_fps(measured) or said

    def _track(
        self,
        poses: list[LivePose],
        rows: IndexArray,
        frames: NDArray[np.int64],
        times: Float64Array,
    ) -> Track:
        T = len(frames)
        keypoints = np.zeros((T, KEYPOINT_COUNT, 3), np.float32)
        keypoints[rows] = _stacked(poses, "keypoints")
        seen = np.zeros(T, bool)
        seen[rows] = True
        return Track(
            frames=frames,
            times=times,
            seen=seen,
            keypoints_px=keypoints[..., :2],
            confidence=keypoints[..., 2],
            world_landmarks=np.zeros((T, KEYPOINT_COUNT, 3), np.float32),
            acquired=np.zeros(T, bool),
        )

    def _fitted(
        self, poses: list[LivePose], rows: IndexArray, nearest: IndexArray, prefix: str
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


def _between(poses: Sequence[LivePose], k: int, after: int, since: Float64Array) -> LivePose:
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
    return replace(
        poses[k],
        betas=later.betas,
        rotations=interpolate_rotations(before, later.rotations, share),
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
            pose = replace(
                pose,
                betas=final,
                root_cam=_raised(body, pose, pose.rotations, pose.root_cam, final),
                raw_root_cam=_raised(body, pose, pose.raw_rotations, pose.raw_root_cam, final),
            )
        out.append(pose)
    return out


def _raised(
    body: Body,
    pose: LivePose,
    rotations: FloatArray,
    root_cam: FloatArray,
    betas: FloatArray,
) -> FloatArray:
    """Return the pelvis (3,) with which the lowest sole is as high in a shape as in the pose's own.

    :param rotations: (K+1, 3, 3) of the pose, or those before smoothing.
    :param root_cam: (3,) the pelvis that belongs to them.
    :param betas: (P,) the other shape.
    """
    up = pose.T_world_camera[2, :3]

    def lowest_sole(betas: FloatArray) -> float:
        with_points = with_contact_points(body, betas)
        R, t = with_points.forward_kinematics(
            rotations, root_cam - with_points.rest_joints(betas)[0], betas
        )
        return float((contact_point_positions(with_points, R, t)[: len(SOLES)] @ up).min())

    return root_cam + (lowest_sole(pose.betas) - lowest_sole(betas)) * up


@dataclass(frozen=True)
class Keep:
    """How a recording is kept on the disk while it runs.

    :param file: see `Journal`.
    :param body: see `About`.
    :param say: gets sentences, also from another thread.
    :param footage: gives the file in which the images are; empty: in none.
    """

    file: Path
    body: str
    say: Callable[[str], None] = lambda _: None
    footage: Callable[[], str] = lambda: ""


class PeopleRecording:
    """Keeps every pose.

    :param paths: a file for each person.
    :param origin: the frame number and time that become 0; None: they are those of the source.
    :param keep: None: in memory alone.
    """

    def __init__(
        self,
        paths: Sequence[Path],
        body: Body,
        source: Source | _Source,
        *,
        origin: tuple[int, float] | None = None,
        keep: Keep | None = None,
    ) -> None:
        self._recordings = [Recording(path, body, source) for path in paths]
        self._targets = {path: Target(path) for path in paths}
        self._body = body
        self._source = source
        self.origin = origin
        self._keep = keep
        self._journal: Journal | None = None
        self._size = (1, 1)
        self.is_over = False  # whether pictures of another size have ended it

    def begin(self, people: LivePeople, size: tuple[int, int]) -> None:
        """Note where the poses come from; once there are some, those of pictures of another size
        are left out.
        """
        self.is_over = any(recording.first is not None for recording in self._recordings)
        if self.is_over:
            return
        self._size = size
        for recording, session in zip(self._recordings, people.sessions, strict=True):
            recording.begin(session, size)

    def send(self, pose: LivePose, latency_ms: float) -> None:
        """Keep a pose in which the person is seen, and the time of others."""
        if self.is_over:
            return
        recording = self._recordings[pose.person]
        recording.send(pose, latency_ms)
        if recording.first is not None and self._keep is not None and recording.camera:
            self._journal = self._journal or self._new_journal(self._keep)
            self._journal.add(pose, recording.camera)

    def _new_journal(self, keep: Keep) -> Journal:
        about = About(
            keep.body,
            fingerprint(self._body),
            self._source.name,
            str(self._source.fps),
            self._size,
            self._source.speed,
            self.origin,
            len(self._recordings),
            keep.footage(),
        )
        return Journal(keep.file, about, self._body, keep.say)

    def save(self, keeps_journal: bool = False) -> list[Path]:
        """Write the motion files of those who were seen, each in another place if its own refuses.

        :param keeps_journal: leave the growing file to whoever reads the motion files, unless the
            disk is full.
        :raises NoPersonError: nobody was seen.
        :raises OutputError: a file is not in its own place; says where the recording is.
        """
        if self._journal is not None:
            self._journal.close()
        seen = [recording for recording in self._recordings if recording.first is not None]
        motions = {each.path: each.result(self.origin) for each in seen or self._recordings[:1]}
        elsewhere = self._saved(motions)
        if self._journal is not None and (elsewhere or not keeps_journal):
            self._journal.remove()  # which may have been what has filled the disk
        moved = [self._moved(motions[path], path, other) for path, other in elsewhere.items()]
        if problems := [problem for problem in moved if problem]:
            raise OutputError("; ".join(problems))
        return list(motions)

    def _saved(self, motions: dict[Path, Motion]) -> dict[Path, Path]:
        """Save motions, and return where those are that could not be saved where they should be.

        :raises OutputError: one cannot be saved anywhere.
        """
        elsewhere = {}
        for path, motion in motions.items():
            try:
                self._replace(path, motion)
            except OutputError as error:
                try:
                    elsewhere[path] = saved_elsewhere(path, motion.save)
                except OutputError:
                    raise OutputError(f"{error}; {self.whereabouts}") from error
        return elsewhere

    def _moved(self, motion: Motion, path: Path, other: Path) -> str:
        """Save a motion where it should be after all, and remove the other file; say why not."""
        try:
            self._replace(path, motion)
        except OutputError as error:
            return f"{error}; the recording is in {other}"
        remove(other)
        return ""

    def _replace(self, path: Path, motion: Motion) -> None:
        """Save a motion where it should be.

        :raises OutputError: it cannot be written, or was since the capture began.
        """
        self._targets[path].check()
        motion.save(path)
        self._targets[path] = Target(path)

    @property
    def whereabouts(self) -> str:
        """Say where the recording is while it is not finished."""
        kept = None if self._journal is None else self._journal.path
        if kept is None:
            return "the recording is lost"
        return f"what was recorded is in {kept}: finish it with scope live {kept}"

    @property
    def seconds(self) -> float:
        """Duration so far."""
        return max(recording.seconds for recording in self._recordings)

    @property
    def camera(self) -> Camera | None:
        """The camera as it is known now; None before somebody was seen."""
        return self._recordings[0].camera


@dataclass(frozen=True)
class _Source:
    """The source of a recording that was not finished."""

    name: str
    fps: Fraction
    speed: float


@dataclass(frozen=True)
class _LastCamera:
    """The camera as it was known last."""

    camera: Camera


def unfinished_recording(
    journal: Path, paths: Callable[[int], Sequence[Path]]
) -> tuple[PeopleRecording, About]:
    """Read a recording that was not finished, and return it to be saved.

    :param paths: gives a file for each of some people.
    :raises InputError: it cannot be read.
    :raises NoPersonError: there is no whole pose.
    :raises UsageError: it still grows, or its body has changed.
    """
    lock = lock_of(journal)
    if is_held(lock):
        raise UsageError(
            f"{journal} is still being recorded, as {lock} says; end that live capture first, or "
            "remove that file if none runs"
        )
    about = read_about(journal)
    body = load_body(about.body)
    records = read_records(journal, about, body)
    if not records:
        raise NoPersonError(f"{journal} ends before its first pose, so nothing can be finished")
    source = _Source(about.source, Fraction(about.fps), about.speed)
    found = PeopleRecording(paths(about.people), body, source, origin=about.origin)
    for recording in found._recordings:
        recording.begin(_LastCamera(records[-1][1]), about.size)
    for pose, _ in records:
        found._recordings[pose.person].send(pose, 0.0)
    return found, about
