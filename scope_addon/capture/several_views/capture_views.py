# SPDX-License-Identifier: GPL-3.0-or-later
"""Several cameras in, one motion per person out: each video is observed as always, then clocks and
places of the cameras are found, and each person is fitted to all cameras that show them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ....solver.body import Body
from ...arrays import Float64Array
from ...errors import UsageError
from ...footage import display_text
from ...notices import Notice, notice
from ..camera.intrinsics import Camera
from ..fitting.keypoint_offsets import with_keypoint_offsets
from ..fitting.prepared_track import prepare_track
from ..media.video import Video, open_video
from ..options import CaptureOptions, check_options
from ..perception.landmark_network import KEYPOINT_NAMES
from ..pipeline import Capture, repaired, shot_of
from ..stages.clock import Progress, StageClock
from ..stages.observe import Footage, Listeners, Watch, observe
from ..stages.report import make_report
from ..stages.solve import progress_of_person, solve_people
from ..tracking.track import Track
from ..world.assemble import Shot
from .bundle import CameraPlace
from .calibrate import Calibration, calibrate, contradicting_spans, same_people
from .person_in_views import PersonInViews, with_focal_scale
from .seen_person import KEYPOINTS, SeenPerson, bone_lengths, seen_person

MOST_VIEWS = 8
# Of the standard deviation of a camera's rotation, from which on the report warns.
WEAK_ROTATION = np.radians(5.0)


@dataclass
class _View:
    """What one video shows."""

    video: Video
    footage: Footage
    tracks: list[Track]
    people: list[SeenPerson]

    @property
    def name(self) -> str:
        return display_text(Path(self.video.path).name)

    @property
    def camera(self) -> Camera:
        return self.footage.camera


def capture_views(
    paths: Sequence[str | Path],
    body: Body,
    options: CaptureOptions,
    progress: Progress = lambda *_: None,
    watch: Watch = lambda *_: None,
) -> Capture:
    """Capture the people whom several videos of the same moment show; the motion has the frames of
    the first one.

    :param paths: two or more videos, of cameras that do not move.
    :raises UsageError: an option has an impossible value, or a video does not suit: it is a still
        image, or its camera moves.
    :raises VideoError: footage cannot be used.
    :raises NoPersonError: a video shows nobody.
    :raises CancelledError: raised by ``progress`` itself, passed on.
    """
    check_options(body, options)
    _check_paths(paths, options)
    clock = StageClock()
    views = [_observe_view(Path(path), body, options, clock, progress, watch) for path in paths]
    with clock.stage("solver"):
        progress("placing the cameras", 0, 0)
        calibration = calibrate(
            [view.people for view in views],
            [view.camera.focal_deviation for view in views],
            bone_lengths(_rest_keypoints(body, options)),
        )
        first = views[0]
        camera = with_focal_scale(first.camera, calibration.places[0] or CameraPlace.first())
        footage = replace(first.footage, camera=camera)
        shot = shot_of(first.video, body, options, footage)
        everyone = same_people([view.people for view in views], calibration)
        people, notices = _people_in_views(shot, views, calibration, everyone, options, progress)
        solved = solve_people(shot, people, 0)
        times_s = footage.timestamps / shot.speed
        motions = [replace(motion, timestamps=times_s) for motion in solved.motions]
    rates = clock.rates(len(footage.timestamps))
    report = make_report(
        first.video, body, options, footage, replace(solved, motions=motions), rates
    )
    warnings = [*_about_cameras(views, calibration), *notices, *report.warnings]
    about = [_about_view(view, k, calibration) for k, view in enumerate(views)]
    return Capture(motions, replace(report, views=about, warnings=warnings))


def _check_paths(paths: Sequence[str | Path], options: CaptureOptions) -> None:
    """Check all videos before the first one is observed.

    :raises UsageError: there are too few or too many, or one was given twice.
    :raises VideoError: footage cannot be read.
    """
    if not 2 <= len(paths) <= MOST_VIEWS:
        raise UsageError(
            f"several cameras are 2 to {MOST_VIEWS} videos of the same moment, but {len(paths)} "
            "were given"
        )
    seen: set[Path] = set()
    for path in paths:
        real = Path(path).resolve()
        if real in seen:
            raise UsageError(f"{path} was given twice; each camera has a video of its own")
        seen.add(real)
        with open_video(Path(path), options.wanted):
            pass


def _observe_view(
    path: Path,
    body: Body,
    options: CaptureOptions,
    clock: StageClock,
    progress: Progress,
    watch: Watch,
) -> _View:
    """Observe one video, as a capture of it alone does."""
    with open_video(path, options.wanted) as video:
        footage, tracks = observe(video, body, options, clock, Listeners(progress, watch))
    name = display_text(path.name)
    if len(footage.timestamps) < 2:
        raise UsageError(f"{name} is a still image; several cameras need videos")
    if not footage.camera_motion.is_static:
        raise UsageError(
            f"the camera of {name} moves; several cameras must stand still: put them on tripods, "
            "or capture this video alone"
        )
    with clock.stage("solver"):
        tracks = repaired(shot_of(video, body, options, footage), tracks)
        people = [
            seen_person(prepare_track(body, track, footage.camera, None, False), footage.camera)
            for track in tracks
        ]
    return _View(video, footage, tracks, people)


def _rest_keypoints(body: Body, options: CaptureOptions) -> Float64Array:
    """Return the keypoints (n, 3) of the mean body at rest, or of one of the given stature."""
    with_offsets = with_keypoint_offsets(body)
    scale = 1.0
    if options.heights_m:
        scale = options.heights_m[0] / body.stature()
    at = with_offsets.keypoint_set("blazepose")
    indices = [at[KEYPOINT_NAMES[k]] for k in KEYPOINTS]
    identity = np.tile(np.eye(3), (body.K + 1, 1, 1))
    rest: Float64Array = with_offsets.keypoints(identity, body.rest_joints(), which=indices)
    return scale * rest


def _people_in_views(
    shot: Shot,
    views: Sequence[_View],
    calibration: Calibration,
    everyone: Sequence[Sequence[int | None]],
    options: CaptureOptions,
    progress: Progress,
) -> tuple[list[PersonInViews], list[Notice]]:
    """Return the people of the first camera with what the others see of them, and what to say
    about it.
    """
    people = []
    notices = []
    heights = [*options.heights_m, *[None] * len(everyone)]
    for k, numbers in enumerate(everyone):
        seen = [
            view.people[number] if number is not None else None
            for view, number in zip(views, numbers, strict=True)
        ]
        spans = contradicting_spans(seen, calibration.places)
        others = []
        for v in range(1, len(views)):
            number = numbers[v]
            place = calibration.places[v]
            person = 0 if len(everyone) == 1 else k + 1
            if number is None or place is None:
                if place is not None:
                    notices.append(notice("not_in_view", footage=views[v].name, person=person))
                continue
            if spans[v]:
                notices.append(
                    notice(
                        "view_contradicts",
                        footage=views[v].name,
                        person=person,
                        times=[start for start, _ in spans[v]],
                    )
                )
            track = _without(views[v].tracks[number], spans[v], place.offset_s)
            others.append((track, with_focal_scale(views[v].camera, place), place))
        track = _without(views[0].tracks[k], spans[0], 0.0)
        own_progress = progress_of_person(progress, k, len(everyone))
        people.append(PersonInViews(shot, track, others, heights[k], own_progress))
    return people, notices


def _without(track: Track, spans: Sequence[tuple[float, float]], offset_s: float) -> Track:
    """Return a track that does not see the person in spans of the first camera's clock."""
    if not spans:
        return track
    times = np.asarray(track.times, float) - offset_s
    wrong = np.zeros(len(times), bool)
    for start, end in spans:
        wrong |= (times >= start) & (times <= end)
    confidence = np.where(wrong[:, None], 0.0, track.confidence)
    return replace(track, confidence=confidence, seen=track.seen & ~wrong)


def _about_cameras(views: Sequence[_View], calibration: Calibration) -> list[Notice]:
    """Warn of cameras that could not be placed, or hardly."""
    warnings = []
    for v in range(1, len(views)):
        place = calibration.places[v]
        name = views[v].name
        if place is None:
            warnings.append(notice("view_without_place", footage=name))
            continue
        if not calibration.is_offset_certain[v]:
            warnings.append(notice("uncertain_offset", footage=name, offset_s=place.offset_s))
        if place.rotation_sigma > WEAK_ROTATION:
            degrees = float(np.degrees(place.rotation_sigma))
            warnings.append(notice("weak_place", footage=name, degrees=degrees))
    return warnings


def _about_view(view: _View, number: int, calibration: Calibration) -> dict[str, Any]:
    """Return what the report says about one camera."""
    about: dict[str, Any] = {"source": str(view.video.path)}
    place = calibration.places[number]
    if place is None:
        return about | {"is_used": False}
    about |= {
        "is_used": True,
        "offset_s": round(place.offset_s, 4),
        "offset_sigma_s": round(place.offset_sigma_s, 4),
        "focal_px": round(float(with_focal_scale(view.camera, place).intrinsics[0, 0]), 1),
        "focal_deviation": round(place.focal_sigma, 3),
        "R_camera_first": np.round(place.R_camera_first, 6).tolist(),
        "t_camera_first_m": np.round(place.t_camera_first, 4).tolist(),
        "rotation_sigma_deg": round(float(np.degrees(place.rotation_sigma)), 2),
        "position_sigma_m": round(place.position_sigma_m, 3),
    }
    return about
