# SPDX-License-Identifier: GPL-3.0-or-later
"""A track prepared for fitting: undistorted and lifted keypoints, the measurers and priors of the
body.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from ....solver import Body, Floor, Measurements, Priors, View, Weights, default_priors
from ....solver.body_file import CHILD_BELOW_M
from ...arrays import Float64Array, FloatArray, IndexArray, round_array
from ...kinematics.body_surface import with_arm_points
from ...kinematics.contact_points import CONTACT_POINTS, with_contact_points
from ..camera.intrinsics import Camera
from ..perception.lifter import Lifted, default_lifter, windows_around
from ..tracking.expression_fit import across_head, certainty
from ..tracking.track import Track
from .frame_measurements import EARS, Measurer
from .hand_measurements import HandMeasurer, with_finger_limits, without_fingers
from .keypoint_offsets import with_keypoint_offsets
from .stature import with_stature, with_unknown_stature
from .weights import WEIGHTS, joint_weights

# The weight of the limbs' lifted directions where several cameras see a person, divided by their
# number. With 0.5, two phones have 45.9 instead of 43.7 mm, Pose2Sim's cameras 1 and 2 41.4 instead
# of 39.8, all four 32.1 instead of 32.3.
DIRECTIONS_OF_VIEWS = 0.25
SHAPE_CERTAINTY = 1e6  # information (1/σ² per coefficient) that fixes the shape once it is known


@dataclass(frozen=True)
class Stance:
    """Pelvis, rotation and floor of T frames, estimated from floor, feet and balance; metres.

    In each frame's camera or in the first frame's axes.
    """

    root_cam: FloatArray  # (T, 3) the pelvis
    turn: FloatArray  # (T, 3, 3) rotations to apply to the whole body
    floor_normal: FloatArray  # (T, 3) unit, upwards
    floor_offset: FloatArray  # (T,) normal . p on the floor
    # (T, 6) probability that each contact point rests on the floor
    contact: FloatArray
    resting: FloatArray  # (T, 6) probability that it rests on anything

    def rounded(self) -> Stance:
        """Return the stance for the next stage; see `rounding`."""
        arrays: list[FloatArray] = [getattr(self, field.name) for field in fields(self)]
        return Stance(*(round_array(array) for array in arrays))

    def floor(self, k: int, indices: IndexArray) -> Floor:
        """Return the floor of frame ``k`` for the solver.

        Feet that are not in contact may be below the floor as well as above it, as on stairs.

        :param indices: (6,) keypoint indices of the contact points.
        """
        contact = self.contact[k]
        return Floor(
            indices, self.floor_normal[k], float(self.floor_offset[k]), contact, below=contact
        )


@dataclass(frozen=True)
class OtherView:
    """The same person in another camera that does not move, at the times of the track's frames."""

    measurer: Measurer
    pixels: FloatArray  # (T, J, 2) keypoints without lens distortion
    confidence: FloatArray  # (T, J) 0..1; 0 where the camera does not see the person
    lifted: Lifted
    R_camera_first: Float64Array  # (3, 3)
    t_camera_first: Float64Array  # (3,) metres
    # As in `PreparedTrack`
    hand_measurer: HandMeasurer | None = None
    hands: FloatArray | None = None
    head: FloatArray | None = None

    def sees(self, k: int) -> bool:
        """Whether the camera sees the person in frame ``k``."""
        return bool(self.confidence[k].max() > 0.0)

    def measure(self, k: int) -> Measurements:
        """Return what the camera measures of the body in frame ``k``, in its own axes."""
        points = self.lifted.points[k]
        sigma = self.lifted.sigma_along[k]
        return self.measurer.measure(self.pixels[k], self.confidence[k], points, sigma)

    def measure_all(self, k: int) -> Measurements:
        """Return the measurements of frame ``k`` with head and hands, where these are known."""
        return _with_head_and_hands(self, self.measure(k), k)

    def with_body(self, body: Body) -> OtherView:
        """Return the view with the measurers of another body."""
        K = self.measurer.intrinsics
        hands = None if self.hand_measurer is None else HandMeasurer(body, K)
        return replace(self, measurer=Measurer(body, K), hand_measurer=hands)


@dataclass(frozen=True)
class PreparedTrack:
    """What every pass over a track needs, computed once: undistorted keypoints, the lifter's
    points, priors.
    """

    body: Body  # that is fitted, with keypoints where the network places them
    whole_body: Body  # the same with fingers, also where no hand is seen and they are not fitted
    track: Track
    camera: Camera
    measurer: Measurer
    pixels: FloatArray  # (T, J, 2) keypoints without lens distortion
    lifted: Lifted
    priors: Priors  # with unknown shape
    weights: Weights
    hand_measurer: HandMeasurer | None = None
    # (T, 2, 21, 7) as in the track, undistorted; None: not fitted
    hands: FloatArray | None = None
    # (T, 4) direction across it, certainty; None: no face looked for
    head: FloatArray | None = None
    is_stature_given: bool = False  # by the user
    is_stature_known: bool = False  # from the user or from a floor that several people share
    # Size of a child whose stature is given, relative to the adults whom the lifting network knows;
    # otherwise 1
    lift_scale: float = 1.0
    # In each frame's camera; the body's last keypoints are then its contact points.
    stance: Stance | None = None
    others: tuple[OtherView, ...] = ()  # the same person in other cameras

    def views(self, k: int, measured: Measurements, whole: bool) -> list[View]:
        """Return what all cameras measured of frame ``k``, each in its own axes.

        Where two cameras see the person, depth follows from both: the lifted points, and the
        pelvis as it follows from the floor, are left out, and directions weigh less. What another
        camera alone sees counts as it does for a single one.

        :param measured: what the track's own camera measured.
        :param whole: with the other cameras' heads and hands.
        """
        seen = [other for other in self.others if other.sees(k)]
        if not seen:
            return [View(measured)]
        watching = len(seen) + int(self.track.seen[k])
        share = DIRECTIONS_OF_VIEWS / watching
        own = replace(_without_depth(self.measurer, measured, share), pose_priors=None)
        if not self.track.seen[k]:
            own = replace(own, keypoints2d=None, orientation_field=None)
        views = [View(own)]
        for other in seen:
            theirs = other.measure_all(k) if whole else other.measure(k)
            if watching > 1:
                theirs = _without_depth(other.measurer, theirs, share)
            views.append(View(theirs, other.R_camera_first, other.t_camera_first))
        return views

    def measure(self, k: int, root_cam: FloatArray | None = None) -> Measurements:
        """Return the measurements of the body in frame ``k``.

        :param root_cam: (3,) known position of the pelvis, camera frame, metres.
        """
        points = self.lifted.points[k]
        sigma = self.lifted.sigma_along[k]
        return self.measurer.measure(
            self.pixels[k], self.track.confidence[k], points, sigma, root_cam
        )

    def measure_all(self, k: int) -> Measurements:
        """Return the measurements of frame ``k`` with pelvis, floor, head and hands, where these
        are known.

        The shape is estimated without floor, head and hands, because it hardly depends on them.
        """
        measured = self.measure(k, None if self.stance is None else self.stance.root_cam[k])
        if self.stance is not None:
            measured = replace(measured, floor=self.stance.floor(k, self.contact_point_indices))
        return _with_head_and_hands(self, measured, k)

    @property
    def contact_point_indices(self) -> IndexArray:
        """The (6,) keypoint indices of the contact points, which the body has if there is a
        stance.
        """
        return np.arange(len(CONTACT_POINTS)) + len(self.body.keypoint_names) - len(CONTACT_POINTS)

    def rotated(self, R: FloatArray) -> PreparedTrack:
        """Rotate the lifted points about the hips; the image measurements stay as they are.

        :param R: (T, 3, 3) rotations in camera axes.
        """
        points = self.lifted.points
        rotated = round_array(points.astype(np.float64) @ np.swapaxes(R, 1, 2))
        lifted = replace(self.lifted, points=rotated.astype(points.dtype))
        return replace(self, lifted=lifted)

    def with_stance(self, stance: Stance, betas: FloatArray) -> PreparedTrack:
        """Add the pelvis and the floor, and to the body points on the arms and the contact points
        of this shape.

        :param stance: in each frame's camera.
        :param betas: (P,) shape coefficients.
        """
        whole = with_contact_points(with_arm_points(self.whole_body), betas)
        K = self.measurer.intrinsics
        body = whole if self.body is self.whole_body else without_fingers(whole)
        hands = None if self.hand_measurer is None else HandMeasurer(body, K)
        others = tuple(other.with_body(body) for other in self.others)
        return replace(
            self,
            body=body,
            whole_body=whole,
            measurer=Measurer(body, K),
            hand_measurer=hands,
            stance=stance,
            others=others,
        )

    def with_height(self, height_m: float, sigma_m: float) -> PreparedTrack:
        """Return the track of an adult of that stature with that standard deviation, both in
        metres.
        """
        priors = with_stature(self.priors, self.body, height_m, sigma_m)
        return replace(self, priors=priors, is_stature_known=True)

    def priors_with_shape(self, betas: FloatArray) -> Priors:
        """Return the priors for a known shape (P,)."""
        return replace(
            self.priors, shape_mean=betas, shape_information=np.eye(self.body.P) * SHAPE_CERTAINTY
        )


def _without_depth(measurer: Measurer, measured: Measurements, share: float) -> Measurements:
    """Return measurements without lifted points, and with limbs' directions of less weight; those
    of head and hands, each of which is seen well by few cameras, count as for one.
    """
    field = measured.orientation_field
    if field is not None:
        confidence = np.array(field.confidence, float)
        confidence[: len(measurer.bone_starts)] *= share
        field = replace(field, confidence=confidence)
    return replace(measured, keypoints3d=None, orientation_field=field)


def _with_head_and_hands(
    seen: PreparedTrack | OtherView, measured: Measurements, k: int
) -> Measurements:
    """Add to the measurements of frame ``k`` what the same camera saw of head and hands."""
    if seen.head is not None:
        measured = seen.measurer.with_head(measured, seen.head[k, :3], float(seen.head[k, 3]))
    if seen.hand_measurer is None or seen.hands is None:
        return measured
    return seen.hand_measurer.add(measured, seen.hands[k])


def prepare_track(
    body: Body, track: Track, camera: Camera, height_m: float | None = None, fingers: bool = True
) -> PreparedTrack:
    """Undistort and lift a track. The lifting network runs only here.

    :param height_m: the person's stature, if it is known, metres.
    :param fingers: False: they are not fitted, because no hand is seen.
    :raises UsageError: the track has hands that are to be fitted, but the body has no finger
        joints.
    """
    # Only BlazePose estimates depth, and the offsets are BlazePose's.
    if track.has_depth:
        body = with_keypoint_offsets(body)
    whole_body = body
    if not fingers:
        body = without_fingers(body)
    measurer = Measurer(body, camera.intrinsics)
    pixels = camera.undistort(track.keypoints_px)
    lift_scale = 1.0
    if height_m is not None and height_m < CHILD_BELOW_M:
        lift_scale = height_m / body.stature()
    lifted = lift(measurer, track, pixels, lift_scale)
    priors = replace(default_priors(body), joint_weights=joint_weights(body))
    if height_m is not None:
        priors = with_stature(priors, body, height_m)
    else:
        priors = with_unknown_stature(priors, body)
    prepared = PreparedTrack(
        body,
        whole_body,
        track,
        camera,
        measurer,
        pixels,
        lifted,
        priors,
        WEIGHTS,
        is_stature_given=height_m is not None,
        is_stature_known=height_m is not None,
        lift_scale=lift_scale,
    )
    prepared = replace(prepared, head=head_of(track, camera, lifted))
    if track.hands is None or not fingers:
        return prepared
    return replace(
        prepared,
        hand_measurer=HandMeasurer(body, camera.intrinsics),
        hands=undistorted_hands(track.hands, camera),
        priors=with_finger_limits(priors, body),
    )


def head_of(track: Track, camera: Camera, lifted: Lifted) -> Float64Array | None:
    """Return (T, 4) the direction across the head in camera axes, and its certainty; None where no
    face was looked for.
    """
    if track.face is None:
        return None
    across = across_head(track.face, camera, track.zoom)
    ears = lifted.points[:, EARS[1]] - lifted.points[:, EARS[0]]
    return np.column_stack([across, certainty(track.face, across, ears)])


def undistorted_hands(hands: FloatArray, camera: Camera) -> FloatArray:
    """Return hands (T, 2, 21, 7) with their pixels without lens distortion."""
    return np.concatenate([camera.undistort(hands[..., :2]), hands[..., 2:]], axis=-1)


def lift(measurer: Measurer, track: Track, pixels: FloatArray, scale: float) -> Lifted:
    """Lift the keypoints of a track by the lifting network, with the landmark network's estimate of
    depth where it has one.

    :param pixels: (T, J, 2) keypoints without lens distortion.
    :param scale: see `PreparedTrack.lift_scale`.
    """
    rays = measurer.rays(pixels)
    windows = windows_around(track.times, track.seen)
    world = track.world_landmarks if track.has_depth else None
    return default_lifter().lift(rays, track.confidence, world, windows).scaled(scale)
