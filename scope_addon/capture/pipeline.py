# SPDX-License-Identifier: GPL-3.0-or-later
"""The main job: footage in, motions and a report out. Knows the order of the stages and nothing of their insides."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from ...solver.body import Body
from ...solver.names import BODY_JOINTS
from ..errors import NoPersonError, UsageError, VideoError
from ..kinematics.single_precision import compact
from ..motion import Motion
from .camera.calibration import read_calibration
from .camera.intrinsics import Camera, choose_camera
from .camera.line_segments import Lines
from .fitting.ablation import ALL_PARTS, Parts
from .fitting.background_estimators import BesideTracking
from .fitting.focal_fits import FocalFits
from .fitting.hand_measurements import require_fingers
from .fitting.live_body import LiveBody
from .fitting.stature import require_stature
from .fitting.track_fit import PreparedTrack, fit_track, prepare_track, refit_track
from .media.exposure import Exposure
from .media.video import Frame, Video, open_video
from .media.video_range import VideoRange, Wanted
from .perception.adapters.description import description_path
from .perception.adapters.detectors.box_detector import BoxDetector
from .perception.adapters.keypoints.keypoint_network import KeypointNetwork
from .perception.execution import AUTO, Execution
from .perception.observation import Observation
from .perception.sessions import landmark_network_name
from .tracking.hand_tracker import HandTracker
from .tracking.keypoint_jumps import repair_keypoint_jumps
from .tracking.left_right import repair_left_right
from .tracking.limb_swap import repair_limb_swaps
from .tracking.people import PeopleBuilder
from .tracking.scene_cuts import SceneCuts
from .tracking.track import Track
from .tracking.tracker import MOST_PEOPLE, PeopleTracker
from .world.assemble import assemble_motion, corrected_stance
from .world.camera_path import CameraPath
from .world.camera_travel import camera_travel
from .world.placement import PlacedTrack, place_track
from .world.world_frame import estimate_world, share_world

# Called with the stage's name, what is done and the total (0: unknown). May raise CancelledError.
Progress = Callable[[str, int, int], None]
# Called with each decoded frame, the largest person seen in it, and what fits the body to such a person.
Watch = Callable[[Frame, Observation | None, LiveBody], None]

UNSEEN_LEGS = 0.05  # confidence below which nothing is seen of the shanks
MOST_TOLD = 4  # cuts of which the time is told

LARGEST = "largest"
ALL = "all"


@dataclass(frozen=True)
class CaptureOptions:
    """How to capture; the defaults suit a phone clip of one person."""

    quality: str = "best"  # fast, balanced, best
    people: int | str = LARGEST  # how many at most; "all"; "largest": the most prominent one over the clip
    heights_m: Sequence[float] = ()  # of the people, the most prominent one first; of further ones it is found
    focal_mm: float | None = None
    fov_deg: float | None = None
    calibration: Path | None = None
    wanted: Wanted = VideoRange()  # which frames
    smoothing: bool = True
    threads: int = 0  # 0: as many as there are cores
    hands: bool = False  # fingers too; the body needs finger joints
    provider: str = AUTO  # what the networks run on; see `execution`
    detector: Path | None = None  # the user's own networks, ONNX files; see `adapters`
    keypoints: Path | None = None
    parts: Parts = ALL_PARTS  # for experiments


@dataclass
class Capture:
    """One motion per person and the machine-readable report."""

    motions: list[Motion]
    report: dict


def capture(
    path: str | Path,
    body: Body,
    options: CaptureOptions,
    progress: Progress = lambda *_: None,
    watch: Watch = lambda *_: None,
) -> Capture:
    """Capture the people of a video or picture, the most prominent one first.

    :raises UsageError: hands are asked for and the body has no fingers.
    :raises VideoError: the footage cannot be used.
    :raises NoPersonError: nobody was found.
    :raises CancelledError: raised by ``progress`` itself, passed on.
    """
    path = Path(path)
    check_options(body, options)
    clock = _Clock()
    most = _most_people(options.people)
    with open_video(path, options.wanted) as video:
        camera = choose_camera(
            video.width,
            video.height,
            focal_mm=options.focal_mm,
            fov_deg=options.fov_deg,
            calibration=options.calibration,
            metadata_focal_mm=video.focal_35mm,
        )
        cores = os.cpu_count() or 1
        threads = min(options.threads or cores, cores)  # more would wait for each other
        execution = Execution(options.provider)
        if options.threads > cores:
            execution.warnings.append(f"{options.threads} threads were asked for, but there are {cores} cores")
        live = LiveBody(body, camera, options.parts, next(iter(options.heights_m), None))
        fits = FocalFits(body, options.parts)
        with BesideTracking(camera, video.width, video.height, live, fits) as beside, _opencv_in_one_thread():
            tracker = PeopleTracker(
                options.quality,
                threads,
                None if options.people == LARGEST else most,
                detector=options.detector,
                keypoints=options.keypoints,
                execution=execution,
            )
            hands = HandTracker(threads, execution=execution) if options.hands else None
            cuts = SceneCuts()
            seen = _observe(video, tracker, hands, beside, cuts, live, clock, progress, watch)
        warnings = execution.warnings + list(video.warnings)
    frames, timestamps = len(seen), np.array(seen.timestamps)
    with clock.stage("solver"):
        camera, background = beside.camera(), beside.background
        tracks = [_repaired(track, camera, options.parts) for track in seen.build(most)]
        del tracker, seen  # of an hour they would keep half a gigabyte
        if frames == 0:
            raise VideoError(f"{path} has no frame in the time that was asked for; change the start or the end")
        if not tracks:
            raise _nobody(path, frames, [own for own in (options.detector, options.keypoints) if own])
        smoothing = options.smoothing and frames > 1
        about = {"fps": video.fps, "image_size": (video.width, video.height), "source": path.name}
        turning = background.motion(camera)
        turns = CameraPath.on_a_stand(frames) if turning.is_static else CameraPath.turning(turning.R_first_camera)
        motions, iterations, went = solve(
            body,
            tracks,
            camera,
            turns,
            background.lines(turning, camera),
            smoothing,
            options.parts,
            about,
            progress,
            options.heights_m,
        )
        motions = [replace(motion, timestamps=timestamps) for motion in motions]
    if cuts.times_s:
        warnings.append(
            f"{path.name} cuts to another scene {_at(cuts.times_s)}: capture each scene by itself, by its start and end"
        )
    if len(options.heights_m) > len(motions):
        found = f"{len(motions)} people were found" if len(motions) > 1 else "one person was found"
        warnings.append(f"{path.name}: {len(options.heights_m)} heights were given, but {found}")
    for number, motion in enumerate(motions, 1):
        missing = int((~motion.valid).sum())
        who = "the person" if len(motions) == 1 else f"person {number}"
        if missing:
            warnings.append(
                f"{path.name}: {who} was not seen in {missing} of {len(motion)} frames; these are filled in"
            )
        if _legs_confidence(motion) < UNSEEN_LEGS:
            warnings.append(f"{path.name}: the legs of {who} were not seen, so what they do is a guess")
        if options.hands and not any(hand_frames(motion).values()):
            warnings.append(
                f"{path.name}: no hands of {who} were found; come closer, or show the palms more to the camera"
            )
    report = {
        "source": str(path),
        "frames": frames,
        "people": len(motions),
        "valid_frames": int(motions[0].valid.sum()),
        "per_person": [_about_person(body, motion) for motion in motions],
        "quality": options.quality,
        "detector": str(options.detector or "built-in"),
        "keypoints": str(options.keypoints or "built-in"),
        "execution": execution.describe(threads),
        "body": body.name,
        "camera": camera.source,
        "camera_turns_deg": 0.0 if turning.is_static else round(turning.largest_turn_deg, 2),
        "camera_travels_m": round(float(np.linalg.norm(np.diff(went.center, axis=0), axis=1).sum()), 2),
        "focal_px": float(camera.intrinsics[0, 0]),
        "focal_deviation": round(camera.focal_deviation, 3),
        "frame_rate": [video.fps.numerator, video.fps.denominator],
        "fps": clock.rates(frames),
        "reprojection_px": float(motions[0].residual_px[motions[0].valid].mean()),
        "iterations": iterations,
        "cuts_s": [round(t, 3) for t in cuts.times_s],
        "warnings": warnings,
    }
    return Capture(motions, report)


def check_options(body: Body, options: CaptureOptions) -> None:
    """Refuse what no footage can be captured with, as far as it is known without opening a network.

    :raises UsageError: an option has an impossible value, contradicts another one or does not suit the body.
    :raises InputError: the calibration cannot be used.
    """
    _most_people(options.people)
    landmark_network_name(options.quality)
    Execution(options.provider)
    if options.keypoints and not options.parts.lifter:
        raise UsageError("the lifter cannot be left out with a keypoint file: such a network tells nothing of depth")
    if options.hands:
        require_fingers(body)
    for height_m in options.heights_m:
        require_stature(body, height_m)
    if options.focal_mm is not None or options.fov_deg is not None:
        choose_camera(1, 1, focal_mm=options.focal_mm, fov_deg=options.fov_deg, calibration=options.calibration)
    elif options.calibration:
        read_calibration(options.calibration)


def check_networks(options: CaptureOptions) -> None:
    """Open the user's networks once, for a batch to refuse them before its first clip.

    :raises ModelFileError: one of them cannot be used.
    """
    if options.detector:
        BoxDetector(options.detector, threads=1)
    if options.keypoints:
        KeypointNetwork(options.keypoints, threads=1)


def _observe(
    video: Video,
    tracker: PeopleTracker,
    hands: HandTracker | None,
    beside: BesideTracking,
    cuts: SceneCuts,
    live: LiveBody,
    clock: _Clock,
    progress: Progress,
    watch: Watch,
) -> PeopleBuilder:
    """Everybody in every frame. No picture is kept: an hour takes no more than a minute."""
    builder, expected, exposure = PeopleBuilder(), video.expected_frames, Exposure()
    frames = ((frame, exposure.brightened(frame.image_rgb)) for frame in video)
    with clock.stage("decode"):
        upcoming = next(frames, None)
    while upcoming is not None:
        frame, lit = upcoming
        with clock.stage("decode"):
            upcoming = next(frames, None)
        upcoming_rgb, upcoming_lit = (upcoming[0].image_rgb, upcoming[1]) if upcoming else (None, None)
        with clock.stage("networks"):
            is_cut = cuts.is_cut(frame.image_rgb, upcoming_rgb, frame.timestamp_s)
            if is_cut:
                tracker.forget()
                builder.cut()
            observations = tracker.step(lit, upcoming_lit, frame.timestamp_s)
        if hands is not None:
            with clock.stage("hands"):
                observations = hands.step(lit, observations, frame.timestamp_s)
        builder.add(frame.index, frame.timestamp_s, observations)
        people = [o for _, o in observations]
        largest = max(people, key=lambda o: o.region.side_px, default=None)
        with clock.stage("background"):
            beside.add(frame, people, largest, is_cut)
        watch(frame, largest, live)
        progress("finding the person", len(builder), max(expected, len(builder)))
    beside.wait()
    return builder


@contextmanager
def _opencv_in_one_thread() -> Iterator[None]:
    """What runs side by side here are whole stages: OpenCV's own threads would wait for one another."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        yield
    finally:
        cv2.setNumThreads(before)


def solve(
    body: Body,
    tracks: list[Track],
    camera: Camera,
    path: CameraPath,
    lines: Lines,
    smoothing: bool,
    parts: Parts,
    about: dict,
    progress: Progress,
    heights_m: Sequence[float] = (),
) -> tuple[list[Motion], float, CameraPath]:
    """Each person on their own, in one world: fitted in each frame's camera, all else in the first frame's axes.

    :param tracks: is emptied, person by person: of an hour, everything takes hundreds of megabytes.
    :param path: how the camera turned; returned with how it travelled. lines: of the background, which tell up.
    :param heights_m: of the first people, where they are known.
    :return: motions, the most prominent person's mean iterations per frame, and the path.
    """
    several, picture = len(tracks) > 1, len(tracks[0]) == 1
    prepared: list[PreparedTrack] = []
    for k, track in enumerate(tracks):
        each = prepare_track(body, track, camera, parts, heights_m[k] if k < len(heights_m) else None)
        tracks[k] = track = track.without_depth()
        prepared.append(compact(replace(each, track=track, lifted=compact(each.lifted))))
        del each
    fits = [compact(fit_track(each, progress)) for each in prepared]

    def place(smoothing: bool = True) -> list[PlacedTrack]:
        return [place_track(body, track, fit, smoothing, path) for track, fit in zip(tracks, fits, strict=True)]

    # Of an hour, each of these lists takes hundreds of megabytes: none stays for longer than it is needed.
    placed = place()
    if not (path.is_static or picture):
        first = placed[0]
        up = estimate_world(first, lines)[2, :3]
        path = replace(path, center=camera_travel(first.soles, first.valid, up, first.times))
        del first
        placed.clear()
        placed = place()
    if parts.second_pass and not picture:
        world = share_world(placed, lines) if several else None
        floors = [world.floor_from_camera(k) if world else None for k in range(len(tracks))]
        balanced = parts.balance
        stances = [corrected_stance(*each, lines, balanced) for each in zip(placed, floors, strict=True)]
        placed.clear()
        for k, stance in enumerate(stances):
            fits[k] = compact(refit_track(prepared[k], fits[k], path.stance_to_frames(stance), progress))
        placed = place()
    if not smoothing:
        placed = place(smoothing)
    shown = [each.body for each in prepared]
    prepared.clear()
    world = share_world(placed, lines) if several else None
    iterations = fits[0].iterations
    motions = [
        assemble_motion(
            body,
            tracks.pop(0),
            fits.pop(0),
            placed.pop(0),
            camera,
            seen=shown.pop(0),
            smoothing=smoothing,
            hold_feet=parts.contact,
            T_world_camera=world.T_world_camera if world else None,
            floor_m=world.floors_m[k] if world else 0.0,
            path=path,
            lines=lines,
            **about,
        )
        for k in range(len(placed))
    ]
    return motions, iterations, path


def _repaired(track: Track, camera: Camera, parts: Parts) -> Track:
    """The track without what the networks are known to get wrong for a while."""
    if parts.left_right:
        track = repair_limb_swaps(repair_left_right(track, camera))
    return repair_keypoint_jumps(track) if parts.leaps else track


def _about_person(body: Body, motion: Motion) -> dict:
    """What the report says of one person."""
    seen = motion.frames[motion.valid]
    return hand_frames(motion) | {
        "valid_frames": len(seen),
        "first_frame": int(seen[0]),
        "last_frame": int(seen[-1]),
        "reprojection_px": float(motion.residual_px[motion.valid].mean()),
        "height_m": round(body.stature(motion.betas), 3),
    }


def _legs_confidence(motion: Motion) -> float:
    """Of the better seen leg, mean over the frames in which the person was seen."""
    shanks = [BODY_JOINTS.index(f"{side}_knee") for side in ("left", "right")]
    return float(motion.joint_confidence[motion.valid][:, shanks].mean(axis=0).max())


def hand_frames(motion: Motion) -> dict[str, int]:
    """In how many frames each hand was seen; empty where hands were not looked for."""
    names = motion.keypoints2d_names.tolist()
    wrists = {f"{side}_hand_frames": f"hand/{side}_wrist" for side in ("left", "right")}
    confidence = {key: motion.keypoints2d[:, names.index(name), 2] for key, name in wrists.items() if name in names}
    return {key: int((values > 0).sum()) for key, values in confidence.items()}


def _most_people(people: int | str) -> int:
    if people == LARGEST:
        return 1
    if people == ALL:
        return MOST_PEOPLE
    if isinstance(people, str) or not 1 <= people <= MOST_PEOPLE:
        raise UsageError(f"people must be {LARGEST}, {ALL} or 1 to {MOST_PEOPLE}, but is {people!r}")
    return people


def _at(times_s: list[float]) -> str:
    """When, in words: "at 2.0 s and at 4.1 s"; of many, the first few."""
    said = [f"at {t:.1f} s" for t in times_s[:MOST_TOLD]]
    more = len(times_s) - len(said)
    said += [f"{more} times more"] if more else []
    return said[0] if len(said) == 1 else f"{', '.join(said[:-1])} and {said[-1]}"


def _nobody(path: Path, frames: int, own_networks: list[Path]) -> NoPersonError:
    looked = f"in the {frames} frames of {path.name}" if frames > 1 else f"in {path.name}"
    networks = "".join(
        f"; if somebody is found without {own.name}, write into {description_path(own).name} which colours it expects"
        for own in own_networks
    )
    return NoPersonError(
        f"no person was found {looked}: the footage needs one person who is mostly in the picture and measures "
        f"at least a fifth of its shorter side; if somebody there is smaller, crop it{networks}"
    )


class _Clock:
    """Seconds spent by stage; stages that overlap in threads count what the main thread waited for."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._entered: list[tuple[str, float]] = []

    def stage(self, name: str) -> _Clock:
        self._entered.append((name, 0.0))
        return self

    def __enter__(self) -> None:
        self._entered[-1] = (self._entered[-1][0], time.perf_counter())

    def __exit__(self, *_: object) -> None:
        name, since = self._entered.pop()
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - since

    def rates(self, frames: int) -> dict[str, float]:
        """Frames per second of each stage and of all together."""
        seconds = dict(self.seconds, total=sum(self.seconds.values()))
        return {name: round(frames / max(s, 1e-9), 2) for name, s in seconds.items()}
