# SPDX-License-Identifier: GPL-3.0-or-later
"""From tracks to motions: each person is fitted in each frame's camera, and all share one world."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....solver.loaders.body_file import CHILD_BELOW_M
from ...kinematics.single_precision import to_single_precision
from ...motion import Motion
from ..fitting.frame_sequence import FittedTrack
from ..fitting.prepared_track import PreparedTrack, prepare_track
from ..fitting.track_fit import fit_each_frame, fit_track, ground
from ..tracking.track import Track
from ..world.above_floor import raise_feet
from ..world.assemble import FittedPerson, Shot, assemble_motion
from ..world.camera_path import CameraPath, camera_travel
from ..world.clip.clip_fit import fit_clip
from ..world.placement import PlacedTrack, RawMotion, place_track
from ..world.relative_sizes import relative_sizes, stander
from ..world.stance import stance_on_ground
from ..world.world_frame import SharedWorld, find_world
from .clock import Progress
from .freed_memory import return_freed_memory

# Of the prior of a stature that follows from the floor, relative. A compromise: 0.05 suits adults
# best, less suits children, whose proportions are taken for adults' (benchmarks/notebook/clip.md).
FLOOR_STATURE_SIGMA = 0.02
MIN_RESIZE = 0.03  # relative change of a size from which on a person is fitted again


@dataclass(frozen=True)
class Solved:
    """Motions, the most prominent person first; the camera's path; the solver's mean iterations per
    frame.

    ``up_source``: what the world's up direction follows from, see `SharedWorld`.
    """

    motions: list[Motion]
    path: CameraPath
    iterations: float
    up_source: str


def solve(
    shot: Shot, tracks: Iterable[Track], progress: Progress, heights_m: Sequence[float] = ()
) -> Solved:
    """Fit each person separately, estimate the world they share, and transform the motions to it.

    For a clip of an hour, each list below takes hundreds of megabytes, so it is deleted as soon as
    possible.

    :param tracks: the most prominent person's first; an iterator that keeps none saves 40 MB each.
    :param heights_m: known statures of the first people, metres.
    """
    prepared = prepare(shot, tracks, heights_m)
    return_freed_memory()
    count = len(prepared)
    fits = [
        to_single_precision(fit_track(each, progress_of_person(progress, k, count)))
        for k, each in enumerate(prepared)
    ]
    prepared, fits = resize_people(shot, prepared, fits, heights_m, progress)
    shot = replace(shot, path=find_camera_path(shot, prepared[0], fits[0]))
    iterations = fits[0].iterations
    known = [(each.track, each.whole_body) for each in prepared]
    if not shot.is_still:
        prepared, fits = ground_all(shot, prepared, fits)
    return_freed_memory()
    people = []
    placed = []
    for k, (track, body) in enumerate(known):
        raw, finished = refine(
            shot, prepared.pop(0), fits.pop(0), progress_of_person(progress, k, count)
        )
        people.append(FittedPerson(track, RawMotion.of(track, raw, shot.path), body))
        del raw
        placed.append(place(shot, track, finished, smoothing=False))
        del finished
    del known, track, body
    return_freed_memory()
    world = find_world(placed, shot.lines)
    motions: list[Motion] = []
    while people:
        return_freed_memory()
        motions.append(finish(shot, people.pop(0), placed.pop(0), world, len(motions)))
    return Solved(motions, shot.path, iterations, world.up_source)


def progress_of_person(progress: Progress, number: int, count: int) -> Progress:
    """Return what reports the progress of the ``number``-th of ``count`` people, from 0, as that of
    all together.

    A stage without steps has one for each person if there are several.
    """

    def report(stage: str, done: int, total: int) -> None:
        if total > 0:
            progress(stage, number * total + done, count * total)
        else:
            progress(stage, number, count if count > 1 else 0)

    return report


def prepare(shot: Shot, tracks: Iterable[Track], heights_m: Sequence[float]) -> list[PreparedTrack]:
    """Lift every track to 3D and set up its priors. The fingers of people of whom no hand is seen
    are left out.
    """
    out = []
    for k, track in enumerate(tracks):
        height_m = heights_m[k] if k < len(heights_m) else None
        fingers = track.hands is not None and bool((track.hands[:, :, 0, 2] > 0).any())
        each = prepare_track(shot.body, track, shot.camera, height_m, fingers)
        lifted = to_single_precision(each.lifted)
        out.append(to_single_precision(replace(each, track=track.without_depth(), lifted=lifted)))
    return out


def place(shot: Shot, track: Track, fit: FittedTrack, smoothing: bool = True) -> PlacedTrack:
    """Fill the gaps of a fit, smooth it, and transform it to the first frame's camera axes."""
    return place_track(shot.body, track, fit, smoothing, shot.path, shot.uneven_ground)


def place_each(
    shot: Shot, prepared: Sequence[PreparedTrack], fits: Sequence[FittedTrack]
) -> list[PlacedTrack]:
    """Place the fit of each person; see `place`."""
    pairs = zip(prepared, fits, strict=True)
    return [place(shot, each.track, fit.with_fingers_at_rest(each)) for each, fit in pairs]


def resize_people(
    shot: Shot,
    prepared: Sequence[PreparedTrack],
    fits: Sequence[FittedTrack],
    heights_m: Sequence[float],
    progress: Progress,
) -> tuple[list[PreparedTrack], list[FittedTrack]]:
    """Fit those again whose size contradicts that of somebody of known stature on the same floor.

    The camera's travel is not known yet, so with a camera that travels, sizes follow from the
    clip's first places.
    """
    prepared, fits, count = list(prepared), list(fits), len(prepared)
    if not 0 < len(heights_m) < count or shot.uneven_ground:
        return prepared, fits
    placed = place_each(shot, prepared, fits)
    up = find_world(placed, shot.lines).up
    people = [stander(each, up, k < len(heights_m)) for k, each in enumerate(placed)]
    del placed
    return_freed_memory()
    for k, factor in enumerate(relative_sizes(people)):
        if abs(np.log(factor)) > MIN_RESIZE:
            height_m = factor * people[k].stature_m
            prepared[k] = prepared[k].with_height(
                max(height_m, CHILD_BELOW_M), FLOOR_STATURE_SIGMA * height_m
            )
            fits[k] = to_single_precision(
                fit_track(prepared[k], progress_of_person(progress, k, count))
            )
    return prepared, fits


def find_camera_path(shot: Shot, first: PreparedTrack, fit: FittedTrack) -> CameraPath:
    """Return the camera's path; the travel of a rotating camera is estimated from one person's
    feet.
    """
    if shot.path.is_static or shot.is_still:
        return shot.path
    [placed] = place_each(shot, [first], [fit])
    up = find_world([placed], shot.lines).up
    center = camera_travel(placed.soles, placed.valid, up, placed.times, shot.uneven_ground)
    return replace(shot.path, center=center)


def ground_all(
    shot: Shot, prepared: Sequence[PreparedTrack], fits: Sequence[FittedTrack]
) -> tuple[list[PreparedTrack], list[FittedTrack]]:
    """Add to each person's measurements the distance and lean that follow from floor, feet and
    balance.
    """
    placed = place_each(shot, prepared, fits)
    world = find_world(placed, shot.lines)
    return_freed_memory()
    grounded = []
    starts = []
    for k, (each, fit) in enumerate(zip(prepared, fits, strict=True)):
        stance = stance_on_ground(placed[k], world.floor_from_camera(k))
        measured, start = ground(each, fit, shot.path.stance_to_frames(stance))
        grounded.append(measured)
        starts.append(to_single_precision(start))
    return grounded, starts


def refine(
    shot: Shot, prepared: PreparedTrack, start: FittedTrack, progress: Progress
) -> tuple[FittedTrack, FittedTrack]:
    """Return the raw motion, of which every frame is fitted alone, and the finished one, of all
    frames together.

    Both are of the whole body.
    """
    if shot.is_still:
        start = start.with_fingers_at_rest(prepared)
        return start, start
    finished = fit_clip(prepared, start, shot.path, progress) if shot.smoothing else start
    del start
    return_freed_memory()
    raw = to_single_precision(fit_each_frame(prepared, finished, progress))
    raw = replace(raw, joint_sigma_m=finished.joint_sigma_m, height_sigma_m=finished.height_sigma_m)
    raw = raw.with_fingers_at_rest(prepared)
    return raw, to_single_precision(finished).with_fingers_at_rest(
        prepared
    ) if shot.smoothing else raw


def finish(
    shot: Shot, person: FittedPerson, placed: PlacedTrack, world: SharedWorld, number: int
) -> Motion:
    """Raise the feet of one person, the ``number``-th of the world, out of the floor, and assemble
    the motion.
    """
    contact = placed.contact(world.up)
    if not shot.uneven_ground and (shot.smoothing or shot.is_still):
        placed = raise_feet(placed, contact, world.floor_from_camera(number))
    return assemble_motion(shot, person, placed, contact, world.T_world_camera)
