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
from numpy.typing import NDArray

from ....solver.body import Body
from ...arrays import Float32Array, Float64Array
from ...clock import FINDING, PLACING, Progress, StageClock
from ...errors import UsageError
from ...footage import display_text
from ...notices import Notice, notice
from ...options.capture import ALL, MOST_VIEWS
from ..camera.calibration import Calibration, placed_cameras, read_calibration
from ..camera.intrinsics import Camera
from ..fitting.keypoint_offsets import with_keypoint_offsets
from ..fitting.prepared_track import prepare_track
from ..media.sound import loudness
from ..media.video import Video, open_video
from ..observe import Footage, Watch, observe
from ..options import CaptureOptions, check_options
from ..perception.landmark_network import KEYPOINT_NAMES
from ..pipeline import Capture, repaired, shot_of
from ..reporting import make_report, speed_warnings, standstill_warnings
from ..solve import progress_of_person, solve_people
from ..tracking.track import Track
from ..world.assemble import Shot
from .bundle import CameraPlace, Given
from .calibrate import (
    Clock,
    Match,
    adjusted_first_place,
    calibrate,
    contradicting_spans,
    contradicts,
    relative_distance,
    same_people,
    unseen_spans,
)
from .person_in_views import PersonInViews, with_focal_scale
from .seen_person import KEYPOINTS, SeenPerson, bone_lengths, seen_person
from .synchronize import APART_S, offset_by_sound

# Of the speeds of slow motion: files state the rate at which they play with errors of a thousandth.
MOST_SPEED_DIFFERENCE = 0.02
# Of the standard deviation of a camera's rotation, from which on the report warns.
WEAK_ROTATION = np.radians(5.0)
# By given places, of a person's distance to that by the usual size of people: other units than
# metres give 10 or more, true places 0.95 to 1.06 with two adults before six real cameras.
MOST_RELATIVE_DISTANCE = 3.0
LIKELY_RELATIVE_DISTANCE = 1.33


@dataclass
class _View:
    """What one video shows."""

    video: Video
    footage: Footage
    tracks: list[Track]
    people: list[SeenPerson]
    speed: float  # how many times as fast as it plays it was recorded

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
    check_options(body, options, has_views=True)
    _check_paths(paths, options)
    # Once for all videos: the file may be written again before the last one is observed.
    calibrations = _calibrations(paths, options)
    clock = StageClock()
    views = [
        _observe_view(
            Path(path),
            body,
            _options_of_view(options, number, lens),
            clock,
            _progress_of_view(progress, number, len(paths)),
            watch,
        )
        for number, (path, (lens, _)) in enumerate(zip(paths, calibrations, strict=True))
    ]
    with clock.stage("solver"):
        progress(PLACING, 0, 0)
        given = _given(views, options, [T for _, T in calibrations])
        matches = calibrate(
            [view.people for view in views],
            given,
            bone_lengths(_rest_keypoints(body, options)),
            lambda: progress(PLACING, 0, 0),
        )
        doubts = _doubts_about_file(views, given, matches, body, options)
        places = [None if match is None else match.place for match in matches]
        first = views[0]
        first_place = adjusted_first_place(matches)
        footage = replace(
            first.footage,
            camera=with_focal_scale(first.camera, first_place),
            lines=first.footage.lines.with_focal_scale(np.exp(first_place.log_focal)),
        )
        shot = shot_of(first.video, body, options, footage)
        everyone = same_people([view.people for view in views], matches)
        people, notices = _people_in_views(shot, views, places, everyone, options, progress)
        solved = solve_people(shot, people)
        times_s = footage.timestamps / shot.speed
        further = _further_cameras(views, places)
        # No scene begins where the first camera's picture cuts: people move on meanwhile.
        motions = [replace(motion, timestamps=times_s, views=further) for motion in solved.motions]
    rates = clock.rates(len(footage.timestamps))
    report = make_report(
        first.video, body, options, footage, replace(solved, motions=motions), rates
    )
    warnings = [*_about_cameras(views, matches, given), *doubts, *notices, *report.warnings]
    warnings += _about_footage(views[1:], options, warnings)
    about = [_about_view(view, match) for view, match in zip(views, matches, strict=True)]
    if first_place.log_focal:
        report = replace(
            report,
            camera=f"{first.camera.source}, adjusted to the other cameras",
            focal_deviation=round(first_place.focal_sigma, 3),
        )
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
    if len(options.offsets_s) not in (0, len(paths) - 1):
        raise UsageError(
            f"--offset gives {len(options.offsets_s)} offsets, but there are {len(paths) - 1} "
            "further videos: give one for each, or auto"
        )
    seen: set[Path] = set()
    speeds: list[float] = []
    for path in paths:
        real = Path(path).resolve()
        if real in seen:
            raise UsageError(f"{path} was given twice; each camera has a video of its own")
        seen.add(real)
        with open_video(Path(path), options.wanted) as video:
            speeds.append(options.speed or video.recorded_speed)
        if abs(speeds[-1] / speeds[0] - 1.0) > MOST_SPEED_DIFFERENCE:
            raise UsageError(
                f"{path} was recorded {speeds[-1]:g} times as fast as it plays, and {paths[0]} "
                f"{speeds[0]:g} times; videos of several cameras need the same speed: export the "
                "slow motion at its true speed"
            )


def _options_of_view(
    options: CaptureOptions, number: int, lens: Calibration | None
) -> CaptureOptions:
    """Return the options of one of the videos, with its calibration."""
    of_view = replace(options, known_calibration=lens)
    if number == 0:
        return of_view
    # Who is captured is known from the first video, and the part of the picture is of that one; the
    # others may show anybody nearer, anywhere.
    return replace(of_view, people=ALL, part=None)


def _progress_of_view(progress: Progress, number: int, count: int) -> Progress:
    """Return the progress of observing one of several videos, as part of that of all of them."""
    finding = progress_of_person(progress, number, count)

    def report(stage: str, done: int, total: int) -> None:
        (finding if stage == FINDING else progress)(stage, done, total)

    return report


def _calibrations(
    paths: Sequence[str | Path], options: CaptureOptions
) -> list[tuple[Calibration | None, Float64Array | None]]:
    """Return each video's calibration, and its (4, 4) world to camera, as far as they are given.

    :raises UsageError: the footage is mirrored, which no place of a camera is.
    :raises InputError: the calibration cannot be used.
    """
    if options.calibration is None:
        return [(None, None)] * len(paths)
    stems = [Path(path).stem for path in paths]
    calibrations: list[tuple[Calibration | None, Float64Array | None]] = []
    for file, T_camera_world in placed_cameras(options.calibration, stems):
        lens = read_calibration(file)
        if T_camera_world is None:
            calibrations.append((lens, None))
            continue
        if options.wanted.view.is_mirrored:
            raise UsageError(
                "--mirror contradicts a calibration with the places of several cameras: capture "
                "without one of them"
            )
        T_view_world = T_camera_world.copy()
        T_view_world[:3] = options.wanted.view.axes @ T_camera_world[:3]
        calibrations.append((lens, T_view_world))
    if calibrations[0][1] is None and any(T is not None for _, T in calibrations):
        raise UsageError(
            f"{options.calibration} has places of cameras, but none of {stems[0]}, the first "
            "video: add its rotation and translation, or remove those of all"
        )
    return calibrations


def _given(
    views: Sequence[_View],
    options: CaptureOptions,
    T_camera_world: Sequence[Float64Array | None],
) -> list[Given]:
    """Return what options and sound say about each camera."""
    given = []
    for v, view in enumerate(views):
        T, T_first = T_camera_world[v], T_camera_world[0]
        known = Given(view.camera.focal_deviation)
        if T is not None and T_first is not None:
            known = replace(known, T_camera_first=T @ np.linalg.inv(T_first))
        if v == 0:
            known = replace(known, offset_s=0.0)
        elif options.offsets_s and (played_s := options.offsets_s[v - 1]) is not None:
            known = replace(known, offset_s=played_s / view.speed)
        given.append(known)
    unknown = [v for v, known in enumerate(given) if known.offset_s is None]
    first_sound = _sound_of(views[0]) if unknown else None
    for v in unknown:
        own_sound = _sound_of(views[v])
        if first_sound is None or own_sound is None:
            continue
        heard = offset_by_sound(first_sound, own_sound)
        if heard is not None:
            given[v] = replace(
                given[v],
                offset_s=heard.seconds,
                drift=heard.drift,
                offset_sigma_s=heard.sigma_s,
            )
    return given


def _sound_of(view: _View) -> Float32Array | None:
    """Return how loud a video is; None without sound, and of slow motion, whose sound is stretched
    in several ways.
    """
    return loudness(view.video.path) if view.speed == 1.0 else None


def _doubts_about_file(
    views: Sequence[_View],
    given: Sequence[Given],
    matches: Sequence[Match | None],
    body: Body,
    options: CaptureOptions,
) -> list[Notice]:
    """Compare given places of cameras with the people whom they show; return warnings.

    :raises UsageError: the places have another unit than metres.
    """
    doubts = []
    scales = []
    name = display_text(Path(str(options.calibration)).name)
    who = 0 if len(views[0].people) == 1 else 1
    first = views[0].people[0]
    first_camera = adjusted_first_place(matches)
    for v in range(1, len(views)):
        match = matches[v]
        if given[v].T_camera_first is None or match is None:
            continue
        person = views[v].people[match.number]
        cameras = first_camera, match.place
        size = relative_distance(first, person, cameras)
        off = size / _given_scale(body, options)
        if not 1.0 / MOST_RELATIVE_DISTANCE < abs(off) < MOST_RELATIVE_DISTANCE:
            raise UsageError(
                f"{options.calibration} makes people {size:.3g} times as large as people are; its "
                "translations must be in metres"
            )
        if contradicts(first, person, cameras):
            doubts.append(
                notice(
                    "calibration_contradicts",
                    calibration=name,
                    footage=views[v].name,
                    person=who,
                )
            )
        elif not 1.0 / LIKELY_RELATIVE_DISTANCE < off < LIKELY_RELATIVE_DISTANCE:
            scales.append(size)
    if scales:
        factor = float(np.median(scales))
        doubts.append(notice("calibration_scale", calibration=name, person=who, factor=factor))
    return doubts


def _further_cameras(
    views: Sequence[_View], places: Sequence[CameraPlace | None]
) -> dict[str, NDArray[Any]]:
    """Return `Motion.views`: the cameras that could be placed, without the first one."""
    placed = [
        (view, place)
        for view, place in zip(views[1:], places[1:], strict=True)
        if place is not None
    ]
    if not placed:
        return {}
    T_view_camera = np.tile(np.eye(4), (len(placed), 1, 1))
    T_view_camera[:, :3, :3] = [place.R_camera_first for _, place in placed]
    T_view_camera[:, :3, 3] = [place.t_camera_first for _, place in placed]
    cameras = [with_focal_scale(view.camera, place) for view, place in placed]
    return {
        "view_sources": np.array([view.name for view, _ in placed]),
        "view_intrinsics": np.array([camera.intrinsics for camera in cameras]),
        "view_dist": np.array([camera.dist for camera in cameras]),
        "view_image_sizes": np.array([(view.video.width, view.video.height) for view, _ in placed]),
        # By which the motion's speed is multiplied, which is that of the first video.
        "view_frame_rates": np.array(
            [float(view.video.source_fps) * view.speed / views[0].speed for view, _ in placed]
        ),
        "view_from_camera": T_view_camera,
        "view_offsets_s": np.array([place.offset_s for _, place in placed]),
    }


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
        footage, tracks = observe(video, body, options, clock, progress, watch)
    footage.warnings[:] = map(_with_possible_advice, footage.warnings)
    name = display_text(path.name)
    if len(footage.timestamps) < 2:
        raise UsageError(f"{name} is a still image; several cameras need videos")
    if not footage.camera_motion.is_static:
        raise UsageError(
            f"the camera of {name} moves; several cameras must stand still: put them on tripods, "
            "or capture this video alone"
        )
    if footage.zoom is not None:
        raise UsageError(
            f"the lens of {name} zooms; several cameras must keep their focal lengths: "
            "capture this video alone"
        )
    with clock.stage("solver"):
        shot = shot_of(video, body, options, footage)
        # People move on while a picture cuts, so that its times have no gap there.
        times_s = footage.timestamps / shot.speed
        tracks = [replace(track, times=times_s) for track in repaired(shot, tracks)]
        people = [
            seen_person(prepare_track(body, track, footage.camera, None, False), footage.camera)
            for track in tracks
        ]
    return _View(video, footage, tracks, people, shot.speed)


def _with_possible_advice(warning: Notice) -> Notice:
    """Return a warning about one video without the advice that is impossible with several: there
    is no Person, and Turn turns all videos.
    """
    if warning.code == "left_out":
        return notice("left_out_of_views", **warning.values)
    if warning.code == "turned_footage":
        return notice("turned_view", footage=warning.values["footage"])
    return warning


def _rest_keypoints(body: Body, options: CaptureOptions) -> Float64Array:
    """Return the keypoints (n, 3) of the mean body at rest, or of one of the given stature."""
    with_offsets = with_keypoint_offsets(body)
    at = with_offsets.keypoint_set("blazepose")
    indices = [at[KEYPOINT_NAMES[k]] for k in KEYPOINTS]
    identity = np.tile(np.eye(3), (body.K + 1, 1, 1))
    rest: Float64Array = with_offsets.keypoints(identity, body.rest_joints(), which=indices)
    return _given_scale(body, options) * rest


def _given_scale(body: Body, options: CaptureOptions) -> float:
    """Return the stature given of the first person, divided by the mean body's; 1 if none is."""
    return options.heights_m[0] / body.stature() if options.heights_m else 1.0


def _people_in_views(
    shot: Shot,
    views: Sequence[_View],
    places: Sequence[CameraPlace | None],
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
        spans = contradicting_spans(seen, places)
        others = []
        person = 0 if len(everyone) == 1 else k + 1
        for v in range(1, len(views)):
            number = numbers[v]
            place = places[v]
            if place is None:
                continue
            where: dict[str, str | int] = {"footage": views[v].name, "person": person}
            if number is None:
                notices.append(notice("not_in_view", **where))
                continue
            unseen = unseen_spans(views[0].people[k], views[v].people[number], place)
            if unseen:
                times_s = [start * shot.speed for start, _ in unseen]
                notices.append(notice("unseen_in_view", **where, times=times_s))
            if spans[v]:
                times_s = [start * shot.speed for start, _ in spans[v]]
                notices.append(notice("view_contradicts", **where, times=times_s))
            track = _without(views[v].tracks[number], spans[v], place)
            others.append((track, with_focal_scale(views[v].camera, place), place))
        track = _without(views[0].tracks[k], spans[0], CameraPlace.first())
        own_progress = progress_of_person(progress, k, len(everyone))
        people.append(PersonInViews(shot, track, others, heights[k], own_progress))
    if options.people == ALL:
        notices += _left_out(views, places, everyone)
    return people, notices


def _left_out(
    views: Sequence[_View],
    places: Sequence[CameraPlace | None],
    everyone: Sequence[Sequence[int | None]],
) -> list[Notice]:
    """Return how many people each further camera shows that are none of the first one's."""
    notices = []
    for v in range(1, len(views)):
        known = sum(numbers[v] is not None for numbers in everyone)
        others = len(views[v].people) - known
        if others and places[v] is not None:
            notices.append(notice("only_in_view", footage=views[v].name, others=others))
    return notices


def _without(track: Track, spans: Sequence[tuple[float, float]], place: CameraPlace) -> Track:
    """Return a track that does not see the person in spans of the first camera's clock."""
    if not spans:
        return track
    times = place.first_times(np.asarray(track.times, float))
    wrong = np.zeros(len(times), bool)
    for start, end in spans:
        wrong |= (times >= start) & (times <= end)
    confidence = np.where(wrong[:, None], 0.0, track.confidence)
    hands = face = None
    if track.hands is not None:
        hands = np.where(wrong[:, None, None, None], 0.0, track.hands)
    if track.face is not None:
        face = np.where(wrong[:, None], 0.0, track.face)
    return replace(track, confidence=confidence, seen=track.seen & ~wrong, hands=hands, face=face)


def _about_cameras(
    views: Sequence[_View], matches: Sequence[Match | None], given: Sequence[Given]
) -> list[Notice]:
    """Warn of cameras whose picture cuts, that could not be placed, or hardly, or whose sound says
    something else.
    """
    warnings = []
    for view, match, known in zip(views[1:], matches[1:], given[1:], strict=True):
        name = view.name
        if cuts_s := _cuts_by_first_clock(views[0], view, match):
            warnings.append(notice("cuts", footage=name, times=cuts_s))
        if match is None:
            warnings.append(notice("view_without_place", footage=name))
            continue
        offset_s = match.place.offset_s * view.speed
        if match.clock == Clock.MOTION and known.offset_s is not None:
            sound_s = known.offset_s * view.speed
            if abs(sound_s - offset_s) > APART_S:
                warnings.append(
                    notice("sound_contradicts", footage=name, offset_s=offset_s, sound_s=sound_s)
                )
        if not match.is_offset_certain:
            warnings.append(notice("uncertain_offset", footage=name, offset_s=offset_s))
        if match.place.rotation_sigma > WEAK_ROTATION:
            degrees = float(np.degrees(match.place.rotation_sigma))
            warnings.append(notice("weak_place", footage=name, degrees=degrees))
    return warnings


def _cuts_by_first_clock(first: _View, view: _View, match: Match | None) -> list[float]:
    """Return when a further camera's picture cuts, in seconds of the first video, as all warnings
    give times; without the cuts before and after it. Of a camera without a place, whose clock is
    not known, they are those of its own video.
    """
    if match is None:
        return view.footage.cuts_s
    own_s = np.array(view.footage.cuts_s) / view.speed
    times_s = match.place.first_times(own_s) * first.speed
    played_s = first.footage.timestamps
    within = (times_s >= played_s[0]) & (times_s <= played_s[-1])
    return times_s[within].tolist()


def _about_footage(
    views: Sequence[_View], options: CaptureOptions, said: Sequence[Notice]
) -> list[Notice]:
    """Return what is to be said of the further videos themselves, and is not said yet; but not who
    passes through one of them, for the people are those of the first one.
    """
    warnings: list[Notice] = []
    for view in views:
        name = Path(view.video.path).name
        for warning in (
            *view.footage.warnings,
            *standstill_warnings(name, float(view.video.fps), view.footage),
            *speed_warnings(view.video, options),
        ):
            is_said = warning in said or warning in warnings
            if not is_said and warning.code != "seen_briefly":
                warnings.append(warning)
    return warnings


def _about_view(view: _View, match: Match | None) -> dict[str, Any]:
    """Return what the report says about one camera."""
    source = str(view.video.path)
    if match is None:
        return {"source": source, "is_used": False}
    place = match.place
    return {
        "source": source,
        "is_used": True,
        "clock": str(match.clock),
        "offset_s": round(place.offset_s * view.speed, 4),
        "offset_sigma_s": round(place.offset_sigma_s * view.speed, 4),
        "clock_drift": round(place.drift, 7),
        "focal_px": round(float(with_focal_scale(view.camera, place).intrinsics[0, 0]), 1),
        "focal_deviation": round(place.focal_sigma, 3),
        "R_camera_first": np.round(place.R_camera_first, 6).tolist(),
        "t_camera_first_m": np.round(place.t_camera_first, 4).tolist(),
        "rotation_sigma_deg": round(float(np.degrees(place.rotation_sigma)), 2),
        "position_sigma_m": round(place.position_sigma_m, 3),
    }
