# SPDX-License-Identifier: GPL-3.0-or-later
"""Live captures against the offline one of the same footage and preset: with every frame, and
played in real time.

Pose2Sim's clips end before the first estimates do, so they are also played there and back, in real
time as well.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...scope_addon.capture.camera.intrinsics import choose_camera
from ...scope_addon.capture.media.video import open_video
from ...scope_addon.capture.options import CaptureOptions
from ...scope_addon.capture.pipeline import capture
from ...scope_addon.capture.tracking.tracker import PeopleTracker
from ...scope_addon.live.newest_frame import Pace
from ...scope_addon.live.people import LivePeople
from ...scope_addon.live.recording import Recording
from ...scope_addon.live.run import Listeners, LiveOptions, run_live
from ...scope_addon.live.source import FileSource
from ...scope_addon.motion import Motion
from ...solver import Body
from ..gate import clips
from ..perception.accuracy import evaluate_motion
from .clips import there_and_back_clip, there_and_back_truth
from .measures import common_rows, compared, seen_from_the_world
from .paced import EveryFrame, simulated

QUALITY = "fast"
FEWEST = 10  # poses of which anything can be said
# a clip that is played there and back as well, and for how long
SHORT_S = 4.0
LONG_S = 10.0


def against_offline(body: Body, quick: bool, say: Callable[[str], None]) -> dict[str, Any]:
    """Measure, and return the figures by clip.

    :param say: is told of each result as it comes.
    """
    figures: dict[str, Any] = {}
    for name, (video, truth) in reversed(clips().items()):
        if quick and name not in ("sample", "cam1"):
            continue
        offline = capture(video, body, CaptureOptions(quality=QUALITY)).motions[0]
        of_clip = figures[name] = {"offline": _against_truth(offline, truth)}
        of_clip["every_frame"] = _measured(every_frame(body, video), offline, body, truth)
        motion, told = in_real_time(body, video)
        of_clip["real_time"] = _measured(motion, offline, body, truth) | told
        if offline.timestamps[-1] < SHORT_S:
            of_clip["there_and_back"] = there_and_back_in_real_time(
                body, video, truth, len(offline)
            )
        say(f"{name}: {json.dumps(of_clip)}")
    return figures


def _measured(live: Motion, offline: Motion, body: Body, truth: Path) -> dict[str, Any]:
    """Return the figures of a live capture; nothing but their number if there are too few poses to
    say anything.
    """
    if (count := len(common_rows(live, offline)[0])) < FEWEST:
        return {"frames": count}
    return compared(live, offline, body) | _against_truth(live, truth)


def every_frame(body: Body, video: Path) -> Motion:
    """Return the recording of a live capture that takes as long for each frame as it needs."""
    source = FileSource(video)
    recording = Recording(Path(), body, source)
    with open_video(video) as footage:
        size = footage.width, footage.height
        camera = choose_camera(*size, metadata_focal_mm=footage.focal_35mm)
        people = LivePeople(body, PeopleTracker(QUALITY, os.cpu_count() or 1), camera, size)
        recording.begin(people.sessions[0], size)
        for frame in footage:
            recording.send(people.step(frame)[0], 0.0)
    assert recording.camera is not None
    return recording.motion(recording.camera)


def in_real_time(body: Body, video: Path) -> tuple[Motion, dict[str, Any]]:
    """Return the recording of a video that is played in real time on this machine, and how many
    poses there were.
    """
    source = FileSource(video)
    recording = Recording(Path(), body, source)
    load = os.getloadavg()[0]
    listeners = Listeners(camera=lambda people, size: recording.begin(people.sessions[0], size))
    report = run_live(source, body, LiveOptions(quality=QUALITY), [recording], listeners)
    assert recording.camera is not None
    told = {
        "load": load,
        "poses": report["poses"],
        "dropped": report["dropped"],
        "latency_ms": report["latency_ms"],
    }
    return recording.motion(recording.camera), told


def there_and_back_in_real_time(body: Body, video: Path, truth: Path, count: int) -> dict[str, Any]:
    """Return the figures of a clip of ``count`` frames that is played there and back in real
    time.
    """
    with tempfile.TemporaryDirectory() as folder:
        clip, offline, looped = _there_and_back(body, video, truth, count, Path(folder))
        motion, told = in_real_time(body, clip)
        slide_offline = _against_truth(offline, looped)["foot_slide_cm"]
        return (
            _measured(motion, offline, body, looped)
            | told
            | {"offline_foot_slide_cm": slide_offline}
        )


def _there_and_back(
    body: Body, video: Path, truth: Path, count: int, folder: Path
) -> tuple[Path, Motion, Path]:
    """Return a clip of ``count`` frames there and back, its offline capture, and its truth, written
    to the folder.
    """
    clip = there_and_back_clip(LONG_S, source=video)
    offline = capture(clip, body, CaptureOptions(quality=QUALITY)).motions[0]
    looped = folder / "truth.npz"
    there_and_back_truth(truth, count, len(offline), looped)
    return clip, offline, looped


def on_a_simulated_machine(body: Body, quick: bool, say: Callable[[str], None]) -> dict[str, Any]:
    """Measure clips there and back on a simulated machine, with its pace and without one; return
    the figures by clip.

    :param say: is told of each result as it comes.
    """
    figures: dict[str, Any] = {}
    for name, (video, truth) in reversed(clips().items()):
        if quick and name not in ("sample", "cam1"):
            continue
        with open_video(video) as footage:
            count = sum(1 for _ in footage)
        with tempfile.TemporaryDirectory() as folder:
            clip, offline, looped = _there_and_back(body, video, truth, count, Path(folder))
            figures[name] = {"offline": _against_truth(offline, looped)}
            for title, pace in (("newest_frames", EveryFrame), ("even_frames", Pace)):
                motion, told = simulated(body, clip, QUALITY, pace)
                figures[name][title] = _measured(motion, offline, body, looped) | told
        say(f"{name}: {json.dumps(figures[name])}")
    return figures


def _against_truth(motion: Motion, truth: Path) -> dict[str, float]:
    """Return how far feet that stand by the truth slide in the world, and PA-MPJPE.

    For the first, dropped frames are filled in: with every second one alone, no foot would stand
    long.
    """
    world = seen_from_the_world(motion)
    slide = evaluate_motion(_with_dropped_frames(world), truth)["foot_slide_cm"]
    return {"foot_slide_cm": slide, "pa_mpjpe_mm": evaluate_motion(world, truth)["pa_mpjpe"]}


def _with_dropped_frames(motion: Motion) -> Motion:
    """Return a motion with a row for every frame, whose joints lie between those beside it."""
    frames = np.arange(motion.frames[0], motion.frames[-1] + 1)
    before = np.searchsorted(motion.frames, frames, side="right") - 1
    after = np.minimum(before + 1, len(motion) - 1)
    step = np.maximum(motion.frames[after] - motion.frames[before], 1)
    share = ((frames - motion.frames[before]) / step)[:, None, None]
    joints = motion.joints_cam
    rows = {
        each.name: value[before]
        for each in fields(motion)
        if isinstance(value := getattr(motion, each.name), np.ndarray)
        and value.shape[:1] == (len(motion),)
    }
    rows |= {
        "frames": frames,
        "timestamps": np.interp(frames, motion.frames, motion.timestamps),
        "valid": np.ones(len(frames), bool),
        "joints_cam": (1 - share) * joints[before] + share * joints[after],
    }
    return replace(motion, **rows)
