# SPDX-License-Identifier: GPL-3.0-or-later
"""Observation: the people in every frame, and the camera as estimated from the background. No frame
is kept.
"""

from __future__ import annotations

from pathlib import Path

from ....solver.body import Body
from ...errors import NoPersonError
from ..fitting.background_estimators import BackgroundEstimators
from ..fitting.focal_length import FocalFits
from ..fitting.live_body import LiveBody
from ..media.opencv_threads import opencv_in_one_thread
from ..media.video import Video
from ..options import CaptureOptions
from ..perception.adapters.description import description_path
from ..tracking.track import Track
from .clock import StageClock
from .footage import Footage, Listeners, given_camera
from .windows.plan import plan_windows
from .windows.windowed_clip import WindowedClip


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

    :param unfinished: folder with what an earlier capture that was killed has found, and in which
        to keep what this one finds; None: nothing is kept.
    :param windows: folder with windows of the clip that were observed before.
    :raises VideoError: there is no frame in the chosen range.
    :raises NoPersonError: nobody was found.
    :raises CancelledError: raised by ``listeners.progress`` itself, passed on.
    """
    camera = given_camera(video, options)
    live = LiveBody(body, camera, next(iter(options.heights_m), None))
    fits = FocalFits(body)
    plan = plan_windows(video, options.window_s)
    with (
        BackgroundEstimators(camera, video.width, video.height, live, fits) as background,
        opencv_in_one_thread(),
    ):
        clip = WindowedClip(video, plan, options, clock, background.pool, unfinished)
        footage, tracks = clip.observe(background, live, listeners, windows)
    if not tracks:
        own_networks = [network for network in (options.detector, options.keypoints) if network]
        raise _no_person_error(Path(video.path), len(footage.timestamps), own_networks)
    return footage, tracks


def _no_person_error(path: Path, frames: int, own_networks: list[Path]) -> NoPersonError:
    where = f"in the {frames} frames of {path.name}" if frames > 1 else f"in {path.name}"
    networks = "".join(
        f"; if people are found without {own.name}, state in {description_path(own).name} which "
        "colours it expects"
        for own in own_networks
    )
    return NoPersonError(
        f"no person was found {where}: at least one person must be mostly in the image and at "
        "least "
        f"a tenth as tall as its shorter side; crop footage of smaller people{networks}"
    )
