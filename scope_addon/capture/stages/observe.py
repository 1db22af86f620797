# SPDX-License-Identifier: GPL-3.0-or-later
"""Observation: the people in every frame, and the camera as estimated from the background. No frame is kept."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ....solver.body import Body
from ...errors import NoPersonError
from ..fitting.background_estimators import KERNELS, BackgroundEstimators
from ..fitting.focal_fits import FocalFits
from ..fitting.live_body import LiveBody
from ..media.exposure import AutoExposure
from ..media.opencv_threads import opencv_in_one_thread
from ..media.video import Video
from ..options import CaptureOptions, most_people
from ..perception.adapters.description import description_path
from ..perception.execution import Execution
from ..perception.kept.kept_estimates import KeptEstimates
from ..perception.observation import Observation
from ..tracking.landmarks.mask_schedule import MaskSchedule
from ..tracking.people import PeopleBuilder
from ..tracking.track import Track
from .clock import COMPILING, StageClock
from .footage import Footage, Listeners, given_camera, no_frames_error
from .frame_observer import BrightenedFrame, FrameObserver, largest_of
from .networks import network_threads, open_trackers
from .windows.long_clip import LongClip
from .windows.plan import plan_windows
from .windows.window_sequence import frame_pairs


def observe(
    video: Video,
    body: Body,
    options: CaptureOptions,
    clock: StageClock,
    listeners: Listeners,
    unfinished: Path | None = None,
    windows: Path | None = None,
) -> tuple[Footage, list[Track]]:
    """Detect and track the people of all frames, the most prominent one first.

    :param unfinished: folder with what an earlier capture that was killed has found, and in which to keep what this one
        finds; None: nothing is kept.
    :param windows: folder with windows of a long clip that were observed before.
    :raises VideoError: there is no frame in the chosen range.
    :raises NoPersonError: nobody was found.
    :raises CancelledError: raised by ``listeners.progress`` itself, passed on.
    """
    camera = given_camera(video, options)
    live = LiveBody(body, camera, options.ablation, next(iter(options.heights_m), None))
    fits = FocalFits(body, options.ablation)
    plan = plan_windows(video, options.window_s)
    with BackgroundEstimators(camera, video.width, video.height, live, fits) as background, opencv_in_one_thread():
        if len(plan) > 1:
            clip = LongClip(video, plan, options, clock, background.pool, unfinished)
            footage, tracks = clip.observe(background, fits, live, listeners, windows)
        else:
            kept = KeptEstimates(unfinished)
            footage, tracks = _observe_short(video, options, background, (clock, live, listeners), kept)
    if not len(footage.timestamps):
        raise no_frames_error(video)
    if not tracks:
        own_networks = [network for network in (options.detector, options.keypoints) if network]
        raise _no_person_error(Path(video.path), len(footage.timestamps), own_networks)
    return footage, tracks


def _observe_short(
    video: Video,
    options: CaptureOptions,
    background: BackgroundEstimators,
    observers: tuple[StageClock, LiveBody, Listeners],
    kept: KeptEstimates,
) -> tuple[Footage, list[Track]]:
    """Observe a clip of one window."""
    clock, live, listeners = observers
    execution = Execution(options.provider)
    threads = network_threads(options, execution)
    trackers = open_trackers(options, threads, execution, kept)
    masks = MaskSchedule(trackers.people.mask_network if options.ablation.outline else None, video.expected_frames)
    frames = _Frames(FrameObserver(trackers, masks, clock), background, clock)
    frames.run(video, live, listeners)
    with clock.stage("solver"):
        camera = background.camera()
        motion = background.tracker.motion(camera)
        footage = Footage(
            np.array(frames.people.timestamps),
            camera,
            motion,
            background.tracker.lines(motion, camera),
            frames.observer.cuts.times_s,
            execution.describe(threads),
            execution.warnings + list(video.warnings),
        )
        return footage, frames.people.build(most_people(options.people))


class _Frames:
    """Observes the frames of a short clip. No frame is kept."""

    def __init__(self, observer: FrameObserver, background: BackgroundEstimators, clock: StageClock) -> None:
        self.observer, self._background, self._clock = observer, background, clock
        self.people = PeopleBuilder()

    def run(self, video: Video, live: LiveBody, listeners: Listeners) -> None:
        """Process all frames; each is decoded while the networks run on the previous one."""
        expected, exposure = video.expected_frames, AutoExposure()
        frames = (BrightenedFrame(frame, exposure.brighten(frame.image_rgb)) for frame in video)
        for now, upcoming in frame_pairs(frames, self._clock):
            largest = self._process(now, upcoming)
            listeners.watch(now.frame, largest, live)
            listeners.progress("finding the person", len(self.people), max(expected, len(self.people)))
        self._background.wait()
        self._background.wait_for_solver(lambda done: listeners.progress(COMPILING, min(done, KERNELS), KERNELS))

    def _process(self, now: BrightenedFrame, upcoming: BrightenedFrame | None) -> Observation | None:
        """Add one frame and return its largest person."""
        observations, is_cut = self.observer.step(now, upcoming)
        if is_cut:
            self.people.cut()
        self.people.add(now.frame.index, now.frame.timestamp_s, observations)
        people = [observation for _, observation in observations]
        largest = largest_of(people)
        with self._clock.stage("background"):
            self._background.add(now.frame, people, largest, is_cut)
        return largest


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
