# SPDX-License-Identifier: GPL-3.0-or-later
"""Observation: the people in every frame, and the camera as estimated from the background. No frame is kept."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ....solver.body import Body
from ...errors import NoPersonError, VideoError
from ...options.capture import LARGEST
from ..camera.camera_rotation import CameraMotion
from ..camera.intrinsics import Camera, choose_camera
from ..camera.line_segments import Lines
from ..fitting.background_estimators import BackgroundEstimators
from ..fitting.focal_fits import FocalFits
from ..fitting.live_body import LiveBody
from ..media.exposure import AutoExposure
from ..media.frame import Frame
from ..media.opencv_threads import opencv_in_one_thread
from ..media.video import Video
from ..options import CaptureOptions, most_people
from ..perception.adapters.description import description_path
from ..perception.execution import Execution
from ..perception.kept.kept_estimates import KeptEstimates
from ..perception.observation import Observation
from ..tracking.face.face_tracker import FaceTracker
from ..tracking.hand_tracker import HandTracker
from ..tracking.landmarks.mask_schedule import MaskSchedule
from ..tracking.people import PeopleBuilder
from ..tracking.scene_cuts import SceneCuts
from ..tracking.track import Track
from ..tracking.tracker import PeopleTracker
from .clock import COMPILING, Progress, StageClock

_KERNELS = 85  # that fitting a clip compiles

# Called with each decoded frame, its largest person, and the object that fits the body to such an observation.
Watch = Callable[[Frame, Observation | None, LiveBody], None]


@dataclass(frozen=True)
class Listeners:
    """Callbacks that report the work in progress."""

    progress: Progress
    watch: Watch


@dataclass(frozen=True)
class Footage:
    """What is known of the footage once all frames were observed, apart from its people."""

    timestamps: NDArray[np.float64]  # (T,) seconds
    camera: Camera
    camera_motion: CameraMotion
    lines: Lines  # of the background, in the first frame's camera axes
    cuts_s: list[float]
    execution: str  # what the networks ran on, for the report
    warnings: list[str]


def observe(
    video: Video,
    body: Body,
    options: CaptureOptions,
    clock: StageClock,
    listeners: Listeners,
    kept: KeptEstimates | None = None,
) -> tuple[Footage, list[Track]]:
    """Detect and track the people of all frames, the most prominent one first.

    :param kept: estimates of an earlier capture that was killed, and where to keep those of this one.
    :raises VideoError: there is no frame in the chosen range.
    :raises NoPersonError: nobody was found.
    :raises CancelledError: raised by ``listeners.progress`` itself, passed on.
    """
    execution = Execution(options.provider)
    threads = _network_threads(options, execution)
    camera = choose_camera(
        video.width,
        video.height,
        focal_mm=options.focal_mm,
        fov_deg=options.fov_deg,
        calibration=options.calibration,
        metadata_focal_mm=video.focal_35mm,
    )
    live = LiveBody(body, camera, options.ablation, next(iter(options.heights_m), None))
    fits = FocalFits(body, options.ablation)
    with BackgroundEstimators(camera, video.width, video.height, live, fits) as background, opencv_in_one_thread():
        tracker = _tracker(options, threads, execution, kept)
        network = tracker.mask_network if options.ablation.outline else None
        masks = MaskSchedule(network, video.expected_frames)
        parts = _part_trackers(options, threads, execution)
        frames = _Frames(tracker, parts, masks, background, clock)
        frames.run(video, live, listeners)
    with clock.stage("solver"):
        camera = background.camera()
        motion = background.tracker.motion(camera)
        footage = Footage(
            np.array(frames.people.timestamps),
            camera,
            motion,
            background.tracker.lines(motion, camera),
            frames.cuts.times_s,
            execution.describe(threads),
            execution.warnings + list(video.warnings),
        )
        tracks = frames.people.build(most_people(options.people))
    if not len(footage.timestamps):
        raise VideoError(f"{video.path} has no frames between the given start and end; change one of them")
    if not tracks:
        own_networks = [network for network in (options.detector, options.keypoints) if network]
        raise _no_person_error(Path(video.path), len(footage.timestamps), own_networks)
    return footage, tracks


class _Parts(NamedTuple):
    """The trackers of what is captured only on request."""

    hands: HandTracker | None
    faces: FaceTracker | None


class _Frames:
    """Runs the networks on each frame. No frame is kept, so an hour takes no more memory than a minute."""

    def __init__(
        self,
        tracker: PeopleTracker,
        parts: _Parts,
        masks: MaskSchedule,
        background: BackgroundEstimators,
        clock: StageClock,
    ) -> None:
        self._tracker, self._parts, self._masks = tracker, parts, masks
        self._background, self._clock = background, clock
        self.people, self.cuts = PeopleBuilder(), SceneCuts()

    def run(self, video: Video, live: LiveBody, listeners: Listeners) -> None:
        """Process all frames; each is decoded while the networks run on the previous one."""
        expected, exposure = video.expected_frames, AutoExposure()
        frames = ((frame, exposure.brighten(frame.image_rgb)) for frame in video)
        with self._clock.stage("decode"):
            upcoming = next(frames, None)
        while upcoming is not None:
            frame, lit = upcoming
            with self._clock.stage("decode"):
                upcoming = next(frames, None)
            largest = self._process(frame, lit, upcoming)
            listeners.watch(frame, largest, live)
            listeners.progress("finding the person", len(self.people), max(expected, len(self.people)))
        self._background.wait()
        self._background.wait_for_solver(lambda done: listeners.progress(COMPILING, min(done, _KERNELS), _KERNELS))

    def _process(
        self, frame: Frame, lit: NDArray[np.uint8], upcoming: tuple[Frame, NDArray[np.uint8]] | None
    ) -> Observation | None:
        """Add one frame and return its largest person."""
        upcoming_rgb, upcoming_lit = (upcoming[0].image_rgb, upcoming[1]) if upcoming else (None, None)
        with self._clock.stage("networks"):
            is_cut = self.cuts.is_cut(frame.image_rgb, upcoming_rgb, frame.timestamp_s)
            if is_cut:
                self._tracker.forget()
                self.people.cut()
            observations = self._tracker.step(lit, upcoming_lit, frame.timestamp_s, self._masks.upcoming_is_due)
            observations = self._masks.add(lit, observations)
        if self._parts.hands is not None:
            with self._clock.stage("hands"):
                observations = self._parts.hands.step(lit, observations, frame.timestamp_s)
        if self._parts.faces is not None:
            with self._clock.stage("face"):
                observations = self._parts.faces.step(lit, observations, frame.timestamp_s)
        self.people.add(frame.index, frame.timestamp_s, observations)
        people = [observation for _, observation in observations]
        largest = max(people, key=lambda observation: observation.region.side_px, default=None)
        with self._clock.stage("background"):
            self._background.add(frame, people, largest, is_cut)
        return largest


def _network_threads(options: CaptureOptions, execution: Execution) -> int:
    """Use at most as many threads as there are cores, since more would only wait for each other."""
    cores = os.cpu_count() or 1
    if options.threads > cores:
        execution.warnings.append(f"{options.threads} threads were requested, but there are only {cores} cores")
    return min(options.threads or cores, cores)


def _tracker(options: CaptureOptions, threads: int, execution: Execution, kept: KeptEstimates | None) -> PeopleTracker:
    return PeopleTracker(
        options.quality,
        threads,
        None if options.people == LARGEST else most_people(options.people),
        detector=options.detector,
        keypoints=options.keypoints,
        execution=execution,
        kept=kept,
    )


def _part_trackers(options: CaptureOptions, threads: int, execution: Execution) -> _Parts:
    hands = HandTracker(threads, execution=execution) if options.hands else None
    # The face's small layers take twice the processor time in two threads, which mostly wait for each other.
    return _Parts(hands, FaceTracker(1, execution=execution) if options.face else None)


def _no_person_error(path: Path, frames: int, own_networks: list[Path]) -> NoPersonError:
    where = f"in the {frames} frames of {path.name}" if frames > 1 else f"in {path.name}"
    networks = "".join(
        f"; if people are found without {own.name}, state in {description_path(own).name} which colours it expects"
        for own in own_networks
    )
    return NoPersonError(
        f"no person was found {where}: at least one person must be mostly in the image and at least "
        f"a tenth as tall as its shorter side; crop footage of smaller people{networks}"
    )
