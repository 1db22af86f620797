# SPDX-License-Identifier: GPL-3.0-or-later
"""From tracks to motions: each person is fitted in each frame's camera, and all share one world."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ...solver.body_file import CHILD_BELOW_M
from ..arrays import BoolArray, Float64Array
from ..clock import Progress
from ..kinematics.frame_blocks import to_single_precision
from ..motion import Motion
from .fitting.frame_sequence import FittedTrack
from .fitting.prepared_track import PreparedTrack, prepare_track
from .fitting.track_fit import fit_each_frame, fit_track, grounded
from .tracking.expression_fit import with_expressions
from .tracking.track import Track
from .world.above_floor import raise_body
from .world.assemble import Shot, assemble_motion
from .world.camera_path import CameraPath, camera_travel
from .world.clip_fit import fit_clip
from .world.placement import PlacedTrack, RawMotion, place_track
from .world.relative_sizes import relative_sizes, stander
from .world.stance import stance_on_ground
from .world.travel_scale import FEET, belt_travel, contradicting_strides, scaled_travel
from .world.world_frame import SharedWorld, find_world

# Of the prior of a stature that follows from the floor, relative. A compromise: 0.05 suits adults
# best, less suits children, whose proportions are taken for adults' (benchmarks/notebook/clip.md).
FLOOR_STATURE_SIGMA = 0.02
# Of corners near the camera: sine of their angle below the horizon, 14 degrees, so the floor there
# is four times as far away as the camera is high. And how many tell that it does not travel.
NEAR_DOWN = 0.24
MIN_NEAR_AT_REST = 12
TOLD_TRAVEL_M = 1.0  # of a camera whose travel the feet alone tell, from which on it is said
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
    contradictions: list[BoolArray | None]  # of each person, frames (T,); see `travel_scale`
    # What it follows from how far the camera travels, see `ScaledTravel.source`; None where it does
    # not travel, or its path is given.
    travel_source: str | None


class Person:
    """One person on the way from track to motion: holds what later steps need, and frees the rest.

    For a clip of an hour, each of ``prepared``, ``fit``, ``raw`` and ``placed`` takes hundreds of
    megabytes. The first two are there until `refine` and `settle` have made the other two of them,
    those until `finish`. `Shot` holds what all people share.

    :param height_m: the person's stature, if it is known, metres.
    """

    prepared: PreparedTrack
    fit: FittedTrack  # in each frame's camera
    raw: RawMotion
    placed: PlacedTrack
    # (T,) frames whose strides contradict the camera's path; None: none
    contradicts: BoolArray | None = None

    def __init__(
        self,
        shot: Shot,
        track: Track,
        height_m: float | None,
        progress: Progress,
        has_hands: bool,
    ) -> None:
        """Lift the track to 3D, and set up the person's priors.

        :param track: with the expressions of its face.
        :param has_hands: whether a hand is seen; if none is, fingers are left out.
        """
        prepared = prepare_track(shot.body, track, shot.camera, height_m, has_hands)
        self._progress = progress
        self.track = track.without_depth()
        # With its keypoints where the network places them, for the reprojection error.
        self.body = prepared.whole_body
        lifted = to_single_precision(prepared.lifted)
        self.prepared = to_single_precision(replace(prepared, track=self.track, lifted=lifted))

    @property
    def is_size_known(self) -> bool:
        """Whether the size is given, or seen from several sides, so that no floor corrects it."""
        return self.prepared.is_stature_given or bool(self.prepared.others)

    def fit_alone(self) -> None:
        """Fit one shape, and every frame with it, in the frame's camera."""
        self.fit = to_single_precision(fit_track(self.prepared, self._progress))

    def fit_with_height(self, height_m: float) -> None:
        """Fit again, as tall as others on the same floor make the person."""
        self.prepared = self.prepared.with_height(
            max(height_m, CHILD_BELOW_M), FLOOR_STATURE_SIGMA * height_m
        )
        self.fit_alone()

    def fitted_places(self, shot: Shot) -> PlacedTrack:
        """Return the smoothed fit without gaps, in the first frame's camera axes."""
        whole = self.fit.with_fingers_at_rest(self.prepared)
        return self._place(shot, whole, smoothing=True)

    def _place(self, shot: Shot, whole: FittedTrack, smoothing: bool) -> PlacedTrack:
        return place_track(
            shot.body,
            self.track,
            whole,
            smoothing,
            shot.path,
            shot.uneven_ground,
            self.contradicts,
        )

    def check_strides(self, shot: Shot) -> None:
        """Let no foot rest where strides contradict the camera's path, nor on a treadmill whose
        speed is unknown.
        """
        if shot.treadmill:
            is_sliding = np.ones(len(self.track), bool)
            self.contradicts = None if shot.belt_m_s else is_sliding
            return
        placed = self.fitted_places(shot)
        contradicts = contradicting_strides(placed, world_of(shot, [placed]).up)
        self.contradicts = contradicts if contradicts.any() else None

    def ground(self, shot: Shot, placed: PlacedTrack, T_floor_camera: Float64Array) -> None:
        """Add to the measurements the distance and lean that follow from floor, feet and balance.

        :param placed: see `fitted_places`.
        :param T_floor_camera: (4, 4) camera to world, with this person's floor at z = 0.
        """
        stance = shot.path.stance_to_frames(stance_on_ground(placed, T_floor_camera))
        self.prepared, start = grounded(self.prepared, self.fit, stance)
        self.fit = to_single_precision(start)

    def refine(self, shot: Shot) -> None:
        """Fit all frames together, and from there each alone once more, which is the raw motion."""
        return_freed_memory()
        is_smoothed = shot.smoothing and not shot.is_still
        if is_smoothed:
            self.fit = fit_clip(self.prepared, self.fit, shot.path, self._progress)
            return_freed_memory()
        raw = self.fit
        if not shot.is_still:
            raw = replace(
                to_single_precision(self._fit_frames_alone()),
                joint_sigma_m=self.fit.joint_sigma_m,
                height_sigma_m=self.fit.height_sigma_m,
            )
        if not is_smoothed:
            self.fit = raw
        self.raw = RawMotion.of(self.track, raw.with_fingers_at_rest(self.prepared), shot.path)

    def _fit_frames_alone(self) -> FittedTrack:
        return fit_each_frame(self.prepared, self.fit, self._progress)

    def settle(self, shot: Shot) -> None:
        """Place the finished motion, and let go of the measurements."""
        whole = to_single_precision(self.fit).with_fingers_at_rest(self.prepared)
        del self.prepared, self.fit
        self.placed = self._place(shot, whole, smoothing=False)
        return_freed_memory()

    def finish(self, shot: Shot, world: SharedWorld, number: int) -> Motion:
        """Raise the feet out of the floor, and assemble the motion of the ``number``-th person of
        the world.
        """
        placed = self.placed
        raw = self.raw
        del self.placed, self.raw
        contact = placed.contact(world.up)
        if not shot.uneven_ground and (shot.smoothing or shot.is_still):
            placed = raise_body(placed, contact, world.floor_from_camera(number))
        return_freed_memory()
        return assemble_motion(
            shot, self.track, self.body, raw, placed, contact, world.T_world_camera
        )


def solve(
    shot: Shot, tracks: Sequence[Track], progress: Progress, heights_m: Sequence[float] = ()
) -> Solved:
    """Fit each person separately, estimate the world they share, and transform the motions to it.

    :param tracks: the most prominent person's first.
    :param heights_m: known statures of the first people, metres.
    """
    return solve_people(shot, prepare(shot, tracks, progress, heights_m))


def solve_people(shot: Shot, people: Sequence[Person]) -> Solved:
    """Fit prepared people, the most prominent one first; see `solve`."""
    for person in people:
        person.fit_alone()
    resize_people(shot, people)
    shot = with_camera_path(shot, people[0])
    iterations = people[0].fit.iterations
    if not shot.is_still:
        for person in people:
            person.check_strides(shot)
        ground_all(shot, people)
    for person in people:
        person.refine(shot)
        person.settle(shot)
    world = world_of(shot, [person.placed for person in people], shot.floor_up)
    motions = [person.finish(shot, world, number) for number, person in enumerate(people)]
    contradictions = [None if shot.treadmill else person.contradicts for person in people]
    return Solved(
        motions, shot.path, iterations, world.up_source, contradictions, shot.travel_source
    )


def prepare(
    shot: Shot, tracks: Sequence[Track], progress: Progress, heights_m: Sequence[float]
) -> list[Person]:
    """Return the people of tracks, lifted to 3D."""
    return_freed_memory()  # Of the networks.
    count = len(tracks)
    heights = [*heights_m, *[None] * count]
    people = []
    for k, track in enumerate(tracks):
        own_progress = progress_of_person(progress, k, count)
        expressive = with_face_expressions(track)
        people.append(Person(shot, expressive, heights[k], own_progress, track.has_hands))
    return_freed_memory()
    return people


def with_face_expressions(track: Track) -> Track:
    """Return a track with the expressions of its face; see `with_expressions`."""
    if track.face is None:
        return track
    return replace(track, face=with_expressions(track.face, track.times))


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


def resize_people(shot: Shot, people: Sequence[Person]) -> None:
    """Fit those again whose size contradicts that of somebody of known stature on the same floor.

    The camera's travel is not known yet, so with a camera that travels, sizes follow from the
    clip's first places.
    """
    known = [person.is_size_known for person in people]
    is_given = any(person.prepared.is_stature_given for person in people)
    if not is_given or all(known) or shot.uneven_ground:
        return
    placed = [person.fitted_places(shot) for person in people]
    up = world_of(shot, placed).up
    standers = [stander(each, up, sure) for each, sure in zip(placed, known, strict=True)]
    del placed
    return_freed_memory()
    for person, alone, factor in zip(people, standers, relative_sizes(standers), strict=True):
        if abs(np.log(factor)) > MIN_RESIZE:
            person.fit_with_height(factor * alone.stature_m)


def with_camera_path(shot: Shot, first: Person) -> Shot:
    """Return the shot with the camera's path, unless that is given; one person tells the scale of a
    travel that the background shows, and otherwise the travel of a rotating camera. Feet on a
    treadmill do not tell it; where its speed is given, the camera travels along with the person.

    What is seen below the horizon is not farther away than the floor there. Where such corners near
    the camera are at rest, it does not travel, whatever the feet seem to say: those of somebody who
    comes nearer seem to slide, because strides along the line of sight are seen too short.
    """
    is_known = shot.path.is_static or shot.T_world_first is not None
    if shot.is_still or (is_known and not shot.belt_m_s):
        return shot
    placed = first.fitted_places(shot)
    up = world_of(shot, [placed]).up
    if shot.travel is not None:
        scaled = scaled_travel(placed, up, shot.travel, shot.treadmill)
        shot = replace(shot, floor_up=scaled.floor_up, travel_source=scaled.source)
        center = scaled.center
        if shot.belt_m_s:
            center = center + belt_travel(placed, up, shot.belt_m_s)
    elif shot.treadmill:
        center = belt_travel(placed, up, shot.belt_m_s)
    elif (shot.at_rest @ up < -NEAR_DOWN).sum() >= MIN_NEAR_AT_REST:
        return shot
    else:
        center = camera_travel(placed.soles, placed.valid, up, placed.times, shot.uneven_ground)
        if np.linalg.norm(center, axis=1).max() > TOLD_TRAVEL_M:
            shot = replace(shot, travel_source=FEET)
    return replace(shot, path=replace(shot.path, center=center))


def world_of(
    shot: Shot, placed: list[PlacedTrack], floor_up: Float64Array | None = None
) -> SharedWorld:
    """Return the world of placed people, see `find_world`.

    :param floor_up: (3,) of the floor that a travelling camera passes, in the first frame's axes.
    """
    return find_world(placed, shot.lines, floor_up, shot.T_world_first)


def ground_all(shot: Shot, people: Sequence[Person]) -> None:
    """Put the people on the floor that they share; see `Person.ground`."""
    placed = [person.fitted_places(shot) for person in people]
    world = world_of(shot, placed, shot.floor_up)
    return_freed_memory()
    for number, person in enumerate(people):
        person.ground(shot, placed[number], world.floor_from_camera(number))


def return_freed_memory() -> None:
    """Have glibc return what it keeps for later; nothing with other C libraries, which return it
    themselves.
    """
    if sys.platform.startswith("linux"):
        with suppress(OSError, AttributeError):  # musl has no such function
            ctypes.CDLL(None).malloc_trim(0)
