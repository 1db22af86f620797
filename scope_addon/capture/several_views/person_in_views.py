# SPDX-License-Identifier: GPL-3.0-or-later
"""One person's motion from several cameras: as from one, with the measurements of all.

Depth, lean and lengths follow from the cameras together. Floor and balance, which tell them for one
camera, only say when feet rest, and where.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ....solver import Body, MotionFit, MotionPrior, fit_motion
from ...arrays import Float64Array, IndexArray
from ...clock import Progress
from ...kinematics.frame_blocks import to_single_precision
from ..camera.intrinsics import Camera
from ..fitting.frame_measurements import Measurer
from ..fitting.frame_sequence import FittedTrack, rotations_of, with_hands
from ..fitting.hand_measurements import HandMeasurer
from ..fitting.outline import fit_shape_to_outline, usable_masks
from ..fitting.prepared_track import (
    OtherView,
    PreparedTrack,
    head_of,
    lift,
    undistorted_hands,
)
from ..fitting.stature import mean_shape, stature_sigma
from ..fitting.weights import ROBUST, clip_stages, motion_priors
from ..perception.landmark_network import HIPS
from ..solve import Person, with_face_expressions
from ..tracking.track import Track
from ..world.assemble import Shot
from ..world.placement import PlacedTrack
from ..world.stance import stance_on_ground
from .best_view import with_best_faces, with_best_hands
from .bundle import CameraPlace
from .seen_person import Between

# Of a bone's length as cameras together tell it: with 1 cm, outlines of clothes move the errors of
# two phones by 2 mm, with 3 mm by 0.4.
LENGTH_SIGMA_M = 0.003
FITTED_SIGMA_M = 0.02  # of the depth of a fitted point
STEP = 1e-3  # of a coefficient, for derivatives


def with_focal_scale(camera: Camera, place: CameraPlace) -> Camera:
    """Return a camera with the focal length that several cameras agree on."""
    return camera.zoomed(float(np.exp(place.log_focal)))


def track_at(track: Track, times: Float64Array) -> Track:
    """Return a track at other times (n,) of its own clock: keypoints by linear interpolation, also
    of hands; the rest of the nearest frame, and no masks.
    """
    between = Between.of(np.asarray(track.times, float), track.seen, times)
    nearest = np.where(between.share < 0.5, between.before, between.after)
    hands = face = None
    if track.hands is not None:
        hands = track.hands[nearest].astype(float)
        hands[..., :2] = between.mixed(track.hands[..., :2])
        hands[..., 2] = between.least(track.hands[..., 2])
    if track.face is not None:
        face = track.face[nearest] * between.seen[:, None]
    return Track(
        frames=np.arange(len(times)),
        times=times,
        seen=between.seen,
        keypoints_px=between.mixed(track.keypoints_px),
        confidence=between.least(track.confidence),
        world_landmarks=track.world_landmarks[nearest] * between.seen[:, None, None],
        acquired=track.acquired[nearest] & between.seen,
        hands=hands,
        face=face,
    )


def other_view(
    prepared: PreparedTrack, track: Track, camera: Camera, place: CameraPlace
) -> OtherView:
    """Return what another camera sees of a prepared track's person.

    :param track: that camera's, at the times of the prepared track.
    :param camera: with its true focal length.
    """
    measurer = Measurer(prepared.body, camera.intrinsics)
    pixels = camera.undistort(track.keypoints_px)
    lifted = lift(measurer, track, pixels, prepared.lift_scale)
    view = OtherView(
        measurer,
        pixels,
        track.confidence,
        lifted,
        place.R_camera_first,
        place.t_camera_first,
        head=head_of(track, camera, lifted),
    )
    if track.hands is None or prepared.hand_measurer is None:
        return view
    return replace(
        view,
        hand_measurer=HandMeasurer(prepared.body, camera.intrinsics),
        hands=undistorted_hands(track.hands, camera),
    )


class PersonInViews(Person):
    """One person on the way from the tracks of several cameras to a motion."""

    def __init__(
        self,
        shot: Shot,
        track: Track,
        others: Sequence[tuple[Track, Camera, CameraPlace]],
        height_m: float | None,
        progress: Progress,
    ) -> None:
        """Lift all tracks to 3D.

        :param track: of the first camera, which `shot` describes.
        :param others: of each other camera that shows the person, the track, the camera with its
            true focal length, and its place.
        """
        times = np.asarray(track.times, float)
        first = with_face_expressions(track)
        later = [
            track_at(with_face_expressions(theirs), place.own_times(times))
            for theirs, _, place in others
        ]
        own, *theirs = with_best_hands([first, *later])
        (own, *theirs), with_all = with_best_faces([own, *theirs])
        has_hands = any(each.has_hands for each in (own, *theirs))
        super().__init__(shot, own, height_m, progress, has_hands)
        # What the file says of the first camera's picture is what that camera sees.
        hands = own.hands if first.hands is None else first.hands
        self.track = replace(self.track, hands=hands, face=with_all.face)
        views = tuple(
            other_view(self.prepared, seen, camera, place)
            for seen, (_, camera, place) in zip(theirs, others, strict=True)
        )
        self.prepared = replace(self.prepared, others=views)

    def fit_alone(self) -> None:
        """Fit one shape and all frames to what all cameras see."""
        if not self.prepared.others:
            super().fit_alone()
            return
        self._progress("finding the shape", 0, 0)
        self.fit = to_single_precision(with_build(self.prepared, fit_views(self.prepared)))

    def ground(self, shot: Shot, placed: PlacedTrack, T_floor_camera: Float64Array) -> None:
        """Add when feet rest, and the floor. Distance, lean and shape stay as cameras saw them.

        :param T_floor_camera: (4, 4), see `Person.ground`.
        """
        if not self.prepared.others:
            super().ground(shot, placed, T_floor_camera)
            return
        stance = stance_on_ground(placed, T_floor_camera)
        upright = np.broadcast_to(np.eye(3), stance.turn.shape)
        seen = replace(stance, root_cam=np.asarray(self.fit.t_camera_root, float), turn=upright)
        self.prepared = self.prepared.with_stance(seen, self.fit.betas)

    def _fit_frames_alone(self) -> FittedTrack:
        if not self.prepared.others:
            return super()._fit_frames_alone()
        return fit_views_alone(self.prepared, self.fit)


def fit_views(prepared: PreparedTrack) -> FittedTrack:
    """Fit all frames and one shape to what all cameras see; in the first camera's axes."""
    frames = _seen_frames(prepared)
    times = prepared.track.times[frames]
    quadratic, _ = motion_priors(prepared.body, times)
    # A network misplaces a keypoint in the same way in every frame, so that the shape's prior
    # counts once for each of them.
    weights = replace(prepared.weights, shape=prepared.weights.shape * len(frames))
    found = fit_motion(
        prepared.body,
        [prepared.views(k, prepared.measure(k), False) for k in frames],
        times,
        priors=prepared.priors,
        options=replace(ROBUST, stages=clip_stages(weights)),
        motion=quadratic,
    )
    information = found.beta_information / weights.shape
    sigma = stature_sigma(prepared.body, found.beta, information, prepared.is_stature_given)
    return replace(_fitted(prepared, frames, found), height_sigma_m=sigma)


def with_build(prepared: PreparedTrack, fit: FittedTrack) -> FittedTrack:
    """Return a fit with the build that the first camera's outlines of the person show.

    Cameras together tell the lengths l(β) of the bones, outlines how stout a body is, and the shape
    β has both. The lengths become its prior,

        Λ = I + Jᵀ J / σ²,   mean Λ⁻¹ (μ + Jᵀ J β_fit / σ²),   J = ∂l/∂β at β_fit,

    with μ the mean of people, and the poses of the fit the lifted points, while the shape is fitted
    to the outlines.
    """
    masks = usable_masks(prepared)
    if not masks:
        return fit
    body = prepared.body
    betas = np.asarray(fit.betas, float)
    trans = fit.t_camera_root - body.rest_joints(betas)[0]
    R, joints = body.forward_kinematics(np.asarray(fit.rotations, float), trans, betas)
    both = np.concatenate([body.keypoints(R, joints, betas), joints], axis=1)
    points = both[:, prepared.measurer.lifted_indices]
    points = points - points[:, HIPS].mean(axis=1, keepdims=True)
    J = _bone_derivatives(body, betas)
    known = J.T @ J / LENGTH_SIGMA_M**2
    information = np.eye(body.P) + known
    priors = replace(
        prepared.priors,
        shape_mean=np.linalg.solve(information, mean_shape(body) + known @ betas),
        shape_information=information,
    )
    lifted = replace(
        prepared.lifted, points=points, sigma_along=np.full(points.shape[:2], FITTED_SIGMA_M)
    )
    posed = replace(prepared, lifted=lifted, priors=priors)
    found = fit_shape_to_outline(posed, masks, np.asarray(fit.t_camera_root, float))
    return replace(fit, betas=found.beta)


def _bone_derivatives(body: Body, betas: Float64Array) -> Float64Array:
    """Return the derivatives (K+2, P) of the bones' lengths, and of the widths of shoulders and
    hips, by the shape, by central differences.
    """
    at = body.joint_names.index
    starts = [*range(1, body.K + 1), at("left_shoulder"), at("left_hip")]
    ends = [*body.parents[1:], at("right_shoulder"), at("right_hip")]

    def lengths(shape: Float64Array) -> Float64Array:
        J = body.rest_joints(shape)
        return np.linalg.norm(J[starts] - J[ends], axis=1)

    steps = STEP * np.eye(body.P)
    columns = [(lengths(betas + step) - lengths(betas - step)) / (2.0 * STEP) for step in steps]
    return np.array(columns).T


def fit_views_alone(prepared: PreparedTrack, start: FittedTrack) -> FittedTrack:
    """Fit every frame alone to what all cameras see, from its state in another motion."""
    frames = np.flatnonzero(start.valid)
    found = fit_motion(
        prepared.body,
        [prepared.views(k, prepared.measure_all(k), True) for k in frames],
        prepared.track.times[frames],
        init=[start.state(k) for k in frames],
        priors=prepared.priors,
        options=replace(ROBUST, stages=clip_stages(prepared.weights)),
        motion=MotionPrior(
            joints=0.0, root_rotation=0.0, root_position=0.0, contact=0.0, pose_memory=0.0
        ),
        shape=start.betas,
    )
    return _fitted(prepared, frames, found)


def _seen_frames(prepared: PreparedTrack) -> IndexArray:
    """Return the frames in which some camera sees the person."""
    seen = np.array(
        [
            prepared.track.seen[k] or any(other.sees(k) for other in prepared.others)
            for k in range(len(prepared.track))
        ]
    )
    return np.flatnonzero(seen)


def _fitted(prepared: PreparedTrack, frames: IndexArray, found: MotionFit) -> FittedTrack:
    """Return the fit of some frames as that of all; the others repeat the one before."""
    T = len(prepared.track)
    valid = np.zeros(T, bool)
    valid[frames] = True
    row = np.maximum(np.searchsorted(frames, np.arange(T), side="right") - 1, 0)
    rotations = np.array([rotations_of(state) for state in found.states])
    root = np.array([state.t_camera_root for state in found.states])
    confidence = prepared.measurer.joint_confidence(prepared.track.confidence)
    for other in prepared.others:
        confidence = np.maximum(confidence, other.measurer.joint_confidence(other.confidence))
    rotations, confidence = with_hands(
        [prepared, *prepared.others], rotations[row], confidence, valid, prepared.track.times
    )
    return FittedTrack(
        rotations=rotations,
        t_camera_root=root[row],
        betas=found.beta,
        valid=valid,
        joint_confidence=confidence * valid[:, None],
        iterations=float(found.iterations),
    )
