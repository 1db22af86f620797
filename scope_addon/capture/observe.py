# SPDX-License-Identifier: GPL-3.0-or-later
"""Observation: the people in every frame, and the camera as estimated from the background. No frame
is kept.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...solver.body import Body
from ...solver.rotations import log
from ..arrays import Float64Array
from ..clock import COMPILING, FINDING, Progress, StageClock
from ..errors import NoPersonError
from ..footage import display_text
from ..machine_code.kernel_count import kernel_count
from ..notices import Notice, notice
from ..options.capture import AUTO, LARGEST, OFF
from .camera.background_record import CameraMotion
from .camera.given_path import GivenPath, read_camera_path
from .camera.intrinsics import Camera, choose_camera
from .camera.line_segments import Lines
from .camera.zoom import Zoom
from .fitting.focal_length import BackgroundEstimators
from .fitting.live_body import LiveBody
from .frame_observer import FrameObserver, Observed, Trackers
from .media.frame import Frame
from .media.video import Video, no_frames_error, opencv_in_one_thread
from .options import CaptureOptions, most_people
from .perception.adapters.description import description_path
from .perception.landmark_network import EstimateMemory
from .perception.observation import Observation
from .perception.sessions import Execution
from .tracking.chosen_person import ChosenPerson, needed_turn
from .tracking.face_tracker import FaceTracker
from .tracking.hand_tracker import LARGE_HAND_PX, SMALLEST_HAND_PX, HandTracker
from .tracking.track import Track
from .tracking.tracker import MAX_PEOPLE, PeopleTracker

# Between a given camera's rotation and that of the background, from which on the report warns; a
# share of the largest turn, by which the background's drifts, comes on top.
PATH_OFF_DEG = 2.0
PATH_OFF_SHARE = 0.1
LENGTH_TOLERANCE_S = 1.0  # by which a container may say that footage is too long

# Called with each decoded frame, its people, the largest first, and the object that fits the body
# to such an observation.
Watch = Callable[[Frame, Sequence[Observation], LiveBody], None]


@dataclass(frozen=True)
class Footage:
    """What is known of the footage once all frames were observed, apart from its people."""

    timestamps: Float64Array  # (T,) seconds
    camera: Camera  # with the lens of the first frame
    camera_motion: CameraMotion
    zoom: Zoom | None  # None: the focal length is constant
    # (T, 4, 4) metres, z up, where the user gives the camera's path; None: it is estimated
    world_from_camera: Float64Array | None
    lines: Lines  # of the background, in the first frame's camera axes
    scene_starts: NDArray[np.int64]  # (M,) rows of the frames that begin another scene
    execution: str  # what the networks ran on, for the report
    warnings: list[Notice]
    picture_changes: Float64Array  # (T,), see `SceneCuts`

    @property
    def cuts_s(self) -> list[float]:
        """Times of the frames that begin another scene."""
        return self.timestamps[self.scene_starts].tolist()


def given_camera(video: Video, options: CaptureOptions) -> Camera:
    """Return the camera as options and footage describe it."""
    return choose_camera(
        video.width,
        video.height,
        focal_mm=options.focal_mm,
        fov_deg=options.fov_deg,
        calibration=options.known_calibration or options.calibration,
        camera_path=options.camera_path,
        metadata_focal_mm=video.focal_35mm,
        view=video.wanted.view,
    )


def network_threads(wanted: int, execution: Execution) -> int:
    """Return how many threads to use: at most as many as there are cores, since more would wait for
    each other.
    """
    cores = os.cpu_count() or 1
    if wanted > cores:
        execution.warnings.append(notice("too_many_threads", threads=wanted, cores=cores))
    return min(wanted or cores, cores)


def open_trackers(
    options: CaptureOptions,
    threads: int,
    execution: Execution,
    memory: EstimateMemory | None,
) -> Trackers:
    """Open the networks for people, and for what is captured only on request.

    :param memory: of the estimates of an earlier capture.
    """
    people = PeopleTracker(
        options.quality,
        threads,
        _followed_people(options),
        detector=options.detector,
        keypoints=options.keypoints,
        execution=execution,
        crop=options.part,
    )
    people.remember_in(memory)
    least_px = LARGE_HAND_PX if options.hands == AUTO else SMALLEST_HAND_PX
    hands = (
        None
        if options.hands == OFF
        else HandTracker(threads, execution=execution, least_px=least_px)
    )
    return Trackers(people, hands, FaceTracker(execution) if options.face else None)


def _followed_people(options: CaptureOptions) -> int | None:
    """Return how many people the tracker follows; None: those who may be the most prominent one."""
    if options.chosen is not None:
        return MAX_PEOPLE
    return None if options.people == LARGEST else most_people(options.people)


@dataclass(frozen=True)
class ObservationJob:
    """A clip that is to be observed, and what takes part in it."""

    video: Video
    options: CaptureOptions
    clock: StageClock
    progress: Progress
    watch: Watch
    camera: Camera  # as options and footage describe it
    live: LiveBody
    background: BackgroundEstimators


# Observes all frames of a clip. The plain one is `observe_in_one_pass`; `long_clips` has another.
ObserveFrames = Callable[[ObservationJob], Observed]


def observe(
    video: Video,
    body: Body,
    options: CaptureOptions,
    clock: StageClock,
    progress: Progress,
    watch: Watch,
    observe_frames: ObserveFrames | None = None,
) -> tuple[Footage, list[Track]]:
    """Detect and track the people of all frames, the most prominent one first.

    :param observe_frames: another way to observe the frames than all in one pass.
    :raises VideoError: there is no frame in the chosen range.
    :raises UsageError: the part of the picture reaches beyond it.
    :raises InputError: the given path of the camera cannot be used, or leaves frames out.
    :raises NoPersonError: nobody was found.
    :raises CancelledError: raised by ``progress`` itself, passed on.
    """
    camera = given_camera(video, options)
    path = _given_path(video, options)
    if options.part is not None:
        options.part.check(video.width, video.height)
    live = LiveBody(body, camera, next(iter(options.heights_m), None))
    with (
        BackgroundEstimators(camera, video.width, video.height, live) as background,
        opencv_in_one_thread(),
    ):
        job = ObservationJob(video, options, clock, progress, watch, camera, live, background)
        observed = (observe_frames or observe_in_one_pass)(job)
        if not observed.timestamps:
            raise no_frames_error(video)
        background.wait_for_solver(
            lambda done: progress(COMPILING, min(done, kernel_count()), kernel_count())
        )
        with clock.stage("solver"):
            footage = _footage(job, path, observed)
            speed = options.speed or video.recorded_speed
            tracks, left_out = observed.tracks(most_people(options.people), options.chosen, speed)
    if not tracks:
        raise _no_person_error(video, options, len(observed.timestamps))
    footage.warnings.extend(video.gap_notices(observed.timestamps))
    footage.warnings.extend(_warnings_about_people(video, options, tracks, left_out))
    if footage.zoom is not None:
        tracks = [track.steadied(footage.camera, footage.zoom.factors) for track in tracks]
    return footage, tracks


def _given_path(video: Video, options: CaptureOptions) -> GivenPath | None:
    """Return the path of the camera that is given, and refuse one that leaves frames out, before
    they are observed.

    :raises InputError: it cannot be read, or leaves frames out, as far as the container's length is
        right.
    """
    if options.camera_path is None:
        return None
    path = read_camera_path(options.camera_path)
    start_s = video.wanted.start_s
    length_s = max(0.0, video.length_s - LENGTH_TOLERANCE_S)
    path.at(np.array([start_s, start_s + length_s]))
    return path


def observe_in_one_pass(job: ObservationJob, memory: EstimateMemory | None = None) -> Observed:
    """Observe all frames, one after another.

    :param memory: of the estimates of an earlier capture.
    """
    video = job.video
    expected = video.expected_frames
    job.progress(FINDING, 0, expected)
    execution = Execution(job.options.provider)
    threads = network_threads(job.options.threads, execution)
    trackers = open_trackers(job.options, threads, execution, memory)
    observer = FrameObserver(video, trackers, job.camera, job.background.pool, job.clock)
    for done, (frame, upcoming) in enumerate(frame_pairs(iter(video), job.clock), start=1):
        people = observer.add(frame, upcoming)
        with job.clock.stage("background"):
            job.background.use_edges(observer.background)
        job.watch(frame, people, job.live)
        job.progress(FINDING, done, max(expected, done))
    return observer.observed(execution.describe(threads), execution.warnings + video.warnings)


def frame_pairs(frames: Iterator[Frame], clock: StageClock) -> Iterator[tuple[Frame, Frame | None]]:
    """Yield every frame with the one after it; each is decoded while the networks run on the
    previous one.
    """
    with clock.stage("decode"):
        upcoming = next(frames, None)
    while upcoming is not None:
        frame = upcoming
        with clock.stage("decode"):
            upcoming = next(frames, None)
        yield frame, upcoming


def _footage(job: ObservationJob, path: GivenPath | None, observed: Observed) -> Footage:
    """Return what is known of the footage apart from its people."""
    record = observed.background
    image_size = (job.video.width, job.video.height)
    zoom = None
    if path is None:
        record, zoom = record.steadied(job.camera, image_size)
    camera = job.background.camera(observed.background, zoom)
    if path is None and zoom is None:
        record, camera = job.background.by_turns(record, camera)
    times_s = np.array(observed.timestamps)
    given = None
    seen = motion = record.motion(job.camera, camera, image_size)
    warnings = list(observed.warnings)
    if path is not None:
        given = path.at(times_s)
        motion = CameraMotion.given(given)
        warnings += _doubts_about_path(job, motion, seen, observed.scene_starts)
    return Footage(
        timestamps=times_s,
        camera=camera,
        camera_motion=motion,
        zoom=zoom,
        world_from_camera=given,
        lines=record.lines(motion, camera),
        scene_starts=observed.scene_starts,
        execution=observed.execution,
        warnings=warnings,
        picture_changes=np.array(observed.picture_changes),
    )


def _doubts_about_path(
    job: ObservationJob, given: CameraMotion, seen: CameraMotion, scene_starts: NDArray[np.int64]
) -> list[Notice]:
    """Return a warning if the given camera turns otherwise than the background shows within the
    scenes: how the camera of one scene is turned to that of another, the background does not show.

    :param scene_starts: (M,) rows of the frames that begin another scene.
    """
    if not seen.known.any() or job.options.camera_path is None:
        return []
    R_seen = seen.R_first_camera.copy()
    for rows in np.split(np.arange(len(R_seen)), scene_starts):
        first = rows[seen.known[rows].argmax()]
        R_seen[rows] = given.R_first_camera[first] @ R_seen[first].T @ R_seen[rows]
    turns = np.swapaxes(given.R_first_camera, 1, 2) @ R_seen
    off_deg = float(np.degrees(np.median(np.linalg.norm(log(turns[seen.known]), axis=-1))))
    if off_deg < PATH_OFF_DEG + PATH_OFF_SHARE * seen.largest_turn_deg:
        return []
    return [
        notice(
            "path_contradicts",
            path=display_text(job.options.camera_path.name),
            footage=display_text(Path(job.video.path).name),
            degrees=off_deg,
        )
    ]


def _warnings_about_people(
    video: Video, options: CaptureOptions, tracks: list[Track], left_out: list[ChosenPerson]
) -> list[Notice]:
    """Say who was seen but left out, and whether the footage seems to be turned."""
    name = Path(video.path).name
    warnings = []
    if left_out:
        others = len(left_out)
        place = str(left_out[0])
        if len(tracks) < most_people(options.people):
            said = notice("seen_briefly", footage=name, others=others, place=place)
        elif options.chosen is None:
            said = notice("left_out", footage=name, others=others, place=place)
        else:
            said = notice("left_out_of_views", footage=name, others=others, place=place)
        warnings.append(said)
    turn_deg = needed_turn(tracks[0])
    if turn_deg:
        view = video.wanted.view
        sign = -1 if view.is_mirrored else 1
        degrees = (view.clockwise_deg + sign * turn_deg) % 360
        warnings.append(notice("turned_footage", footage=name, degrees=degrees))
    return warnings


def _no_person_error(video: Video, options: CaptureOptions, frames: int) -> NoPersonError:
    name = Path(video.path).name
    where = f"in the {frames} frames of {name}" if frames > 1 else f"in {name}"
    networks = "".join(
        f"; if people are found without {own.name}, state in {description_path(own).name} which "
        "colours it expects"
        for own in (options.detector, options.keypoints)
        if own
    )
    return NoPersonError(
        f"no person was found {where}: at least one person must be mostly in the image and at "
        f"least a tenth as tall as its shorter side; crop footage of smaller people{networks}"
    )
