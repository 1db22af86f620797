# SPDX-License-Identifier: GPL-3.0-or-later
"""The main job: footage in, motions and a report out. This module only knows the order of the
stages.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

from ...solver.body import Body
from ..capture_report import Report
from ..clock import Progress, StageClock
from ..footage import display_text
from ..motion import Motion
from .media.video import Video, open_video
from .observe import Footage, ObserveFrames, Watch, observe
from .options import CaptureOptions, check_options
from .repair import repair
from .reporting import make_report
from .solve import solve
from .tracking.track import Track
from .world.assemble import Shot
from .world.camera_path import CameraPath


@dataclass
class Capture:
    """One motion per person and the report."""

    motions: list[Motion]
    report: Report


def capture(
    path: str | Path,
    body: Body,
    options: CaptureOptions,
    progress: Progress = lambda *_: None,
    watch: Watch = lambda *_: None,
    observe_frames: ObserveFrames | None = None,
) -> Capture:
    """Capture the people of a video or still image, the most prominent one first.

    :param observe_frames: another way to observe the frames than all in one pass, such as `lasting`
        of `long_clips`.
    :raises UsageError: an option has an impossible value, contradicts another one or does not suit
        the body.
    :raises VideoError: the footage cannot be used.
    :raises InputError: the calibration or the camera's path cannot be used.
    :raises NoPersonError: nobody was found.
    :raises CancelledError: raised by ``progress`` itself, passed on.
    """
    check_options(body, options)
    clock = StageClock()
    with open_video(Path(path), options.wanted) as video:
        footage, tracks = observe(video, body, options, clock, progress, watch, observe_frames)
    with clock.stage("solver"):
        shot = shot_of(video, body, options, footage)
        solved = solve(shot, repaired(shot, tracks), progress, options.heights_m)
        times_s = footage.timestamps / shot.speed
        motions = [
            replace(motion, timestamps=times_s, scene_starts=footage.scene_starts)
            for motion in solved.motions
        ]
        solved = replace(solved, motions=motions)
    rates = clock.rates(len(footage.timestamps))
    return Capture(motions, make_report(video, body, options, footage, solved, rates))


def repaired(shot: Shot, tracks: list[Track]) -> list[Track]:
    """Return tracks by the clock of what was filmed, without what networks confuse."""
    filmed = [replace(track, times=track.times / shot.speed) for track in tracks]
    return [repair(track, shot.camera) for track in filmed]


def shot_of(video: Video, body: Body, options: CaptureOptions, footage: Footage) -> Shot:
    """Assemble what is known of observed footage; the camera's path so far contains only its
    rotation, unless it is given.
    """
    frames = len(footage.timestamps)
    speed = options.speed or video.recorded_speed
    path = CameraPath.static(frames)
    poses = footage.world_from_camera
    if poses is not None:
        path = CameraPath.given(poses)
    elif not footage.camera_motion.is_static:
        path = CameraPath.rotating(footage.camera_motion.R_first_camera)
    return Shot(
        body=body,
        camera=footage.camera,
        path=path,
        lines=footage.lines,
        fps=video.fps * Fraction(speed).limit_denominator(1000),
        image_size=(video.width, video.height),
        source=display_text(Path(video.path).name),
        smoothing=options.smoothing and frames > 1,
        uneven_ground=options.uneven_ground,
        treadmill=options.treadmill,
        belt_m_s=options.belt_speed_m_s,
        view=video.wanted.view,
        speed=speed,
        travel=footage.camera_motion.travel,
        at_rest=footage.camera_motion.at_rest,
        T_world_first=None if poses is None else poses[0],
    )
