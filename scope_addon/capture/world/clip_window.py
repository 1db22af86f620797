# SPDX-License-Identifier: GPL-3.0-or-later
"""Consecutive frames of a track and their measurements, in the first frame's axes: what is fitted
together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver import (
    Fit,
    Floor,
    FootContacts,
    Measurements,
    MotionFit,
    MotionPrior,
    Options,
    Priors,
    StandingPoints,
    State,
    View,
    fit_motion,
    fit_tree,
    make_tree,
)
from ....solver.tree import Tree, with_fixed_shape
from ...arrays import Float64Array, FloatArray, IndexArray
from ...kinematics.body_surface import BodySurface
from ...kinematics.contact_points import contact_point_positions
from ...kinematics.sequences import runs
from ..fitting.prepared_track import PreparedTrack
from ..fitting.weights import CLIP_STEPS, ROBUST, clip_stages
from .camera_path import CameraPath

# The least probability and the largest spread of a rest; see `resting_places`.
MIN_PROBABILITY = 0.5
SPREAD_M = 0.02
ENTERS_M = 0.01  # depth from which on an arm counts as inside the body
# The weight of a point inside the body, against that of a sole under the floor in sure contact.
_INSIDE_WEIGHT = 1.0


@dataclass(frozen=True)
class ClipWindow:
    """Frames ``frames`` (n,) of a track, with the shape ``betas`` (P,) in all of them."""

    prepared: PreparedTrack
    path: CameraPath
    frames: IndexArray
    betas: Float64Array
    measured: Sequence[Measurements]

    @classmethod
    def of(
        cls, prepared: PreparedTrack, path: CameraPath, frames: IndexArray, betas: FloatArray
    ) -> ClipWindow:
        """Measure frames (n,) of a track for a shape (P,)."""
        measured = [prepared.measure_all(k) for k in frames]
        return cls(prepared, path, frames, np.asarray(betas, float), measured)

    @property
    def center(self) -> Float64Array:
        """The camera (n, 3) in each frame, metres."""
        return self.path.center[self.frames]

    @property
    def times(self) -> Float64Array:
        """The frames' times (n,), seconds."""
        return self.prepared.track.times[self.frames]

    def fit(
        self,
        rows: slice,
        states: Sequence[State],
        prior: MotionPrior,
        covariance: bool = False,
        steps: int = CLIP_STEPS,
    ) -> MotionFit:
        """Fit some of the frames together.

        :param steps: the most iterations; fewer than by default where the motion is not kept.
        """
        prepared = self.prepared
        frames = self.frames[rows]
        stands = None
        if prepared.stance is not None:
            stands = StandingPoints(prepared.contact_point_indices, prepared.stance.resting[frames])
        return fit_motion(
            prepared.body,
            self._views(rows),
            prepared.track.times[frames],
            init=states,
            priors=prepared.priors,
            options=self._options(steps),
            motion=prior,
            stands=stands,
            shape=self.betas,
            covariance=covariance,
            window=np.inf,
        )

    def fit_alone(self, row: int, state: State) -> Fit:
        """Fit one frame in its camera's axes; the shape is not part of the result."""
        R_camera_first = self.path.R_first_camera[self.frames[row]].T
        start = State(
            R_camera_first @ state.R_camera_root,
            R_camera_first @ (state.t_camera_root - self.center[row]),
            state.Omega,
            np.zeros(0),
        )
        return fit_tree(self._tree, self.measured[row], start, self._priors, self._options())

    def with_resting_places(self, found: MotionFit) -> ClipWindow:
        """Add to the measurements where soles and palms rest in a motion."""
        prepared = self.prepared
        path = self.path
        frames = self.frames
        if prepared.stance is None:
            return self
        points = contact_point_positions(prepared.body, found.R_world_part, found.t_world_part)
        places, resting = resting_places(points, prepared.stance.resting[frames])
        places_cam = (places - path.center[frames, None]) @ path.R_first_camera[frames]
        measured = [
            replace(each, foot_contacts=FootContacts(prepared.contact_point_indices, place_cam, p))
            for each, place_cam, p in zip(self.measured, places_cam, resting, strict=True)
        ]
        return replace(self, measured=measured)

    def with_body_surface(self, found: MotionFit, surface: BodySurface) -> tuple[ClipWindow, bool]:
        """Add to the measurements the body's own surface in a motion, which forearms and hands may
        not enter.

        :return: and whether they enter it by more than `ENTERS_M` there.
        """
        path = self.path
        planes = surface.planes(found.R_world_part, found.t_world_part)
        offset = planes.offset - np.einsum("tci,ti->tc", planes.normal, path.center[self.frames])
        normal_cam = planes.normal @ path.R_first_camera[self.frames]
        measured = [
            replace(
                each, floor=with_planes(each.floor, surface.indices[near], normal[near], d[near])
            )
            for each, near, normal, d in zip(
                self.measured, planes.near, normal_cam, offset, strict=True
            )
        ]
        return replace(self, measured=measured), bool(
            (planes.height[planes.near] < -ENTERS_M).any()
        )

    @cached_property
    def _tree(self) -> Tree:
        return with_fixed_shape(make_tree(self.prepared.body), self.betas)

    @cached_property
    def _priors(self) -> Priors:
        return replace(self.prepared.priors, shape_mean=None, shape_information=None)

    def _options(self, steps: int = CLIP_STEPS) -> Options:
        return replace(ROBUST, stages=clip_stages(self.prepared.weights, steps))

    def _views(self, rows: slice) -> Sequence[Measurements] | Sequence[Sequence[View]]:
        measured = self.measured[rows]
        frames = self.frames[rows]
        path = self.path
        if self.prepared.others:
            prepared = self.prepared
            return [prepared.views(k, each, True) for k, each in zip(frames, measured, strict=True)]
        if path.is_static:
            return measured
        R = np.swapaxes(path.R_first_camera[frames], 1, 2)
        t = -np.einsum("fij,fj->fi", R, path.center[frames])
        return [[View(*seen)] for seen in zip(measured, R, t, strict=True)]


def resting_places(points: FloatArray, resting: FloatArray) -> tuple[Float64Array, Float64Array]:
    """Return the places (T, C, 3) of points while they rest, and the probability (T, C) that they
    are there.

    Where little speed is allowed, a point can still drift by centimetres in some seconds. One that
    has stayed within `SPREAD_M` of its mean throughout a rest is therefore drawn to that mean; one
    that has strayed farther may not rest.

    :param points: (T, C, 3) in axes that do not move, metres.
    :param resting: (T, C) probability that each point rests.
    """
    places = np.zeros(points.shape)
    probability = np.zeros(resting.shape)
    for c in range(resting.shape[1]):
        for first, end in runs(resting[:, c] > MIN_PROBABILITY):
            rest = points[first:end, c]
            p = resting[first:end, c]
            place = p @ rest / p.sum()
            if np.linalg.norm(rest - place, axis=1).max() < SPREAD_M:
                places[first:end, c] = place
                probability[first:end, c] = p
    return places, probability


def with_planes(
    floor: Floor | None, indices: IndexArray, normal: Float64Array, offset: Float64Array
) -> Floor | None:
    """Add points that may not be below a plane each, and are free to be above it.

    :param floor: with one plane for all of its points, or None.
    :param indices: (n,) keypoints. :param normal, offset: (n, 3) unit, and (n,) metres, in the
        frame's camera.
    """
    count = len(indices)
    if not count:
        return floor
    free = np.zeros(count)
    inside = np.full(count, _INSIDE_WEIGHT)
    if floor is None:
        return Floor(indices, normal, offset, free, below=inside)
    soles = len(np.asarray(floor.indices))

    def joined(first: Any, second: NDArray[Any], width: tuple[int, ...] = ()) -> NDArray[Any]:
        return np.concatenate([np.broadcast_to(first, (soles, *width)), second])

    return Floor(
        joined(floor.indices, indices),
        joined(floor.normal, normal, (3,)),
        joined(floor.offset, offset),
        joined(floor.contact, free),
        joined(1.0 if floor.below is None else floor.below, inside),
    )
