# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver over a whole track: one shape for the clip, then every frame with that shape.

1. Some frames, spread over the clip, are fitted on their own and then together with one shape (``fit_clip``).
2. Every frame is fitted in order with this shape, starting from the frame before; after a gap it starts afresh.
3. A limb that is bent towards the camera looks in the picture as one that is bent away, and a fit that starts from the
   frame before stays with the one however sure the lifting network becomes of the other. Such a frame is fitted from
   further off, and the frames before it from there, as far back as that costs less than it brought.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ....solver import (
    Body,
    ClipFit,
    Fit,
    Floor,
    Measurements,
    Options,
    Priors,
    Stage,
    State,
    Status,
    Weights,
    default_priors,
    fit_clip,
    fit_tree,
    make_tree,
)
from ...kinematics.contact_points import SUPPORTS, with_supports
from ..camera.intrinsics import Camera
from ..perception.lifter import Lifted, default_lifter
from ..perception.lifter_window import windows_around
from ..tracking.track import Track
from .ablation import ALL_PARTS, Parts
from .frame_measurements import DEPTH_SIGMA_M, NEAREST_M, Measurer
from .hand_measurements import HandMeasurer, calm_fingers, with_finger_limits
from .keypoint_offsets import as_seen
from .stature import with_stature

SHAPE_FRAMES = 64  # frames that decide the shape; more of them are more of the same
LONGEST_COAST_S = 0.5  # an earlier pose says little about a person who was away for longer
RESIZE = 0.03  # how wrong a distance must have been, relatively, to look at the size once more
SHAPE_CERTAINTY = 1e6  # information (1/σ² per coefficient) that holds the shape once it is known

# Inverse variances: 5 px at a focal length of 1600 px (normalized 0.003) for the image, 0.35 m for depth where the
# lifter is sure to 0.1 m (its errors go the same way in all points), 2.6 degrees for directions, 0.5 rad for a joint
# about its rest state. Chosen on real clips with 3D truth and on renders of recorded motion; 25 to 50 % more or less of
# any hardly matters. 3D keypoints, whose errors are those of the directions once more, weigh little: with 25, 8, 2.5
# and 0, real clips have 75.2, 73.8, 73.1 and 72.4 mm; the sample clip has 1 mm more with 4. A sole that stands
# is within 1 cm of the floor: more certainty suits real clips better, and renders whose floor is wrong worse.
WEIGHTS = Weights(
    keypoints2d=1e5,
    keypoints3d=8.0,
    orientation_field=500.0,
    joint_prior=4.0,
    joint_limits=2000.0,
    floor=1e4,
    shape=10.0,
)
# Joints that no pair of landmarks fixes on their own stay closer to rest.
_STIFF_JOINTS = {"spine": 5.0, "collar": 5.0, "foot": 5.0, "hand": 5.0, "neck": 3.0, "head": 3.0}
ROBUST = Options(robust_keypoints2d=0.01, robust_keypoints3d=0.1, robust_orientation_field=1.0)


@dataclass
class FittedTrack:
    """Body states of T frames in the camera frame; rows that are not ``valid`` hold the last valid state."""

    rotations: np.ndarray  # (T, K+1, 3, 3); row 0 R_camera_root, the others Ω
    t_camera_root: np.ndarray  # (T, 3) the pelvis, metres
    betas: np.ndarray  # (P,)
    valid: np.ndarray  # (T,) bool
    joint_confidence: np.ndarray  # (T, K+1) 0..1
    iterations: float  # mean per frame


@dataclass(frozen=True)
class Stance:
    """What floor, feet and balance say of T frames, in each frame's camera or in the first frame's axes, metres."""

    root_cam: np.ndarray  # (T, 3) the pelvis
    turn: np.ndarray  # (T, 3, 3) rotations by which the body as a whole is to be turned
    floor_normal: np.ndarray  # (T, 3) unit, upwards
    floor_offset: np.ndarray  # (T,) normal . p on the floor
    contact: np.ndarray  # (T, 6) probability that each sole and palm rests on it

    def floor(self, k: int, supports: np.ndarray) -> Floor:
        """Frame ``k``'s floor for the solver; supports (6,): keypoint indices of soles and palms.

        Feet that do not stand are as free below the floor as above it: they may be on a stair.
        """
        contact = self.contact[k]
        return Floor(supports, self.floor_normal[k], float(self.floor_offset[k]), contact, below=contact)


@dataclass(frozen=True)
class PreparedTrack:
    """What every pass over a track needs, computed once: undistorted keypoints, the lifter's points, priors."""

    body: Body  # with keypoints where the network sees them
    track: Track
    measurer: Measurer
    pixels: np.ndarray  # (T, J, 2) keypoints as an ideal pinhole would see them
    lifted: Lifted
    priors: Priors  # the shape unknown
    weights: Weights
    hand_measurer: HandMeasurer | None = None
    hands: np.ndarray | None = None  # (T, 2, 21, 6) as the track's, without distortion; None: not looked for
    stance: Stance | None = None  # in each frame's camera; the body's last keypoints rest on it

    def measure(self, k: int, root_cam: np.ndarray | None = None) -> Measurements:
        """Frame ``k`` for the solver; ``root_cam`` (3,): where the pelvis is known to be, camera frame, metres."""
        points, sigma = self.lifted.points[k], self.lifted.sigma_along[k]
        return self.measurer.measure(self.pixels[k], self.track.confidence[k], points, sigma, root_cam)

    def measure_all(self, k: int, root_cam: np.ndarray | None = None) -> Measurements:
        """The same with the floor, where it is known, and the hands, where these were looked for.

        The shape is found without: they say little of it.
        """
        measured = self.measure(k, root_cam)
        if self.stance is not None:
            supports = np.arange(len(SUPPORTS)) + len(self.body.keypoint_names) - len(SUPPORTS)
            measured = replace(measured, floor=self.stance.floor(k, supports))
        if self.hand_measurer is None or self.hands is None:
            return measured
        return self.hand_measurer.add(measured, self.hands[k])

    def turned(self, R: np.ndarray) -> PreparedTrack:
        """With what was lifted turned about the hips by (T, 3, 3), camera axes; the picture stays as it is."""
        points = self.lifted.points
        turned = (points @ np.swapaxes(R, 1, 2).astype(points.dtype)).astype(points.dtype)
        return replace(self, lifted=replace(self.lifted, points=turned))

    def on_floor(self, stance: Stance, betas: np.ndarray) -> PreparedTrack:
        """With the floor, and what rests on it on a body of this shape."""
        body, K = with_supports(self.body, betas), self.measurer.intrinsics
        hands = None if self.hand_measurer is None else HandMeasurer(body, K)
        return replace(self, body=body, measurer=Measurer(body, K), hand_measurer=hands, stance=stance)

    def priors_with_shape(self, betas: np.ndarray) -> Priors:
        """The priors once the shape is known."""
        return replace(self.priors, shape_mean=betas, shape_information=np.eye(self.body.P) * SHAPE_CERTAINTY)


def prepare_track(
    body: Body, track: Track, camera: Camera, parts: Parts = ALL_PARTS, height_m: float | None = None
) -> PreparedTrack:
    """Undistort and lift a track; the lifting network runs here and nowhere else."""
    if parts.seen_keypoints and track.has_depth:  # a network that tells depth is BlazePose's
        body = as_seen(body)
    measurer, pixels = Measurer(body, camera.intrinsics), camera.undistort(track.keypoints_px)
    lifted = _lift(measurer, track, pixels, parts)
    priors = replace(default_priors(body), joint_weights=_joint_weights(body))
    if height_m is not None:
        priors = with_stature(priors, body, height_m)
    prepared = PreparedTrack(body, track, measurer, pixels, lifted, priors, parts.weights(WEIGHTS))
    if track.hands is None:
        return prepared
    hands = np.concatenate([camera.undistort(track.hands[..., :2]), track.hands[..., 2:]], axis=-1)
    measurer_of_hands = HandMeasurer(body, camera.intrinsics)
    return replace(prepared, hand_measurer=measurer_of_hands, hands=hands, priors=with_finger_limits(priors, body))


def _lift(measurer: Measurer, track: Track, pixels: np.ndarray, parts: Parts) -> Lifted:
    if not parts.lifter:
        sigma = np.full(track.confidence.shape, DEPTH_SIGMA_M)
        return Lifted(track.world_landmarks, sigma, sigma)
    rays, windows = measurer.rays(pixels), windows_around(track.times, track.seen)
    if not (parts.world_landmarks and track.has_depth):
        return default_lifter().lift(rays, track.confidence, None, windows)
    return default_lifter().lift_mixture(rays, track.confidence, track.world_landmarks, windows)


def fit_track(prepared: PreparedTrack, progress: Callable[[str, int, int], None]) -> FittedTrack:
    """Fit the body to a track of which at least one frame was seen."""
    progress("finding the shape", 0, 0)
    return _fit_frames(prepared, _fit_shape(prepared).beta, None, progress)


def fit_picture(prepared: PreparedTrack) -> Fit | None:
    """Fit the body to a track of one frame that was seen, with a shape of its own; None if that says nothing."""
    (found,) = _fit_shape(prepared).frames
    return found if _is_usable(found) else None


def refit_track(
    prepared: PreparedTrack, first: FittedTrack, stance: Stance, progress: Callable[[str, int, int], None]
) -> FittedTrack:
    """Fit every frame again, from its first fit, with the pelvis and the floor known to be where the stance says.

    A pose and a distance that explain the same image can both be wrong together; once the floor has told the distance,
    the pose follows, and so does the size where the whole clip is farther or nearer than it seemed: who stands on
    the same floor as others must be as large as that floor says.

    :param stance: in each frame's camera.
    """
    prepared, betas, root_cam = prepared.turned(stance.turn), first.betas, stance.root_cam
    if first.valid.any():
        far, near = (np.linalg.norm(at[first.valid], axis=1) for at in (root_cam, first.t_camera_root))
        if abs(np.log(np.median(far / np.maximum(near, NEAREST_M)))) > RESIZE:
            betas = _fit_shape(prepared, root_cam).beta
    if prepared.weights.floor > 0.0:
        prepared = prepared.on_floor(stance, betas)

    def state(k: int) -> State | None:
        if not first.valid[k]:
            return None
        return State(first.rotations[k, 0], root_cam[k], first.rotations[k, 1:], betas)

    return _fit_frames(prepared, betas, state, progress)


def _fit_frames(
    prepared: PreparedTrack,
    betas: np.ndarray,
    state: Callable[[int], State | None] | None,
    progress: Callable[[str, int, int], None],
) -> FittedTrack:
    """Every seen frame in order: from the frame before, or from ``state(k)`` with its root as a prior."""
    frames, track = _Frames(prepared, betas), prepared.track
    T = len(track)
    for k in range(T):
        if track.seen[k]:
            if state is None:
                frames.follow(k)
            else:
                frames.refit(k, state(k))
        frames.hold(k)
        if k % 16 == 0 or k == T - 1:
            progress("solving" if state is None else "solving on the floor", k + 1, T)
    return frames.fitted()


class _Frames:
    """The frames of a track as they are fitted one by one with the clip's shape; those without a fit hold the last."""

    def __init__(self, prepared: PreparedTrack, betas: np.ndarray) -> None:
        T, body = len(prepared.track), prepared.body
        self._prepared, self._betas = prepared, betas
        self._tree, self._priors = make_tree(body), prepared.priors_with_shape(betas)
        self._cold, self._warm = (
            replace(ROBUST, stages=stages(prepared.weights)) for stages in (cold_stages, warm_stages)
        )
        self._rotations = np.tile(np.eye(3), (T, body.K + 1, 1, 1))
        self._root, self._valid, self._cost = np.zeros((T, 3)), np.zeros(T, bool), np.zeros(T)
        self._iterations = 0
        self._first: State | None = None  # what the frame before was refitted from
        self._last: Fit | None = None
        self._last_s = -np.inf

    def follow(self, k: int) -> None:
        """Fit frame ``k`` from the frame before, or afresh where that is long ago; and those before it, if it tells."""
        gain = self.fit(k, self._last.state if self._last is not None and self._goes_on(k) else None)
        if gain > 0.0 and self._last is not None:
            self._go_back(k, self._last.state, gain)

    def refit(self, k: int, first: State | None) -> None:
        """Fit frame ``k`` from its first fit, turned as the frame before was, or afresh.

        Two poses may explain a frame as well as each other: it goes on with the one that the frame before has.
        """
        before, self._first = self._first, first
        init = first
        if first is not None and before is not None and self._last is not None and self._goes_on(k):
            init = turned_alike(first, before, self._last.state)
        self.fit(k, init, known_root=True)

    def _goes_on(self, k: int) -> bool:
        """Whether the last fit tells anything of frame ``k``."""
        track = self._prepared.track
        return not track.acquired[k] and track.times[k] - self._last_s <= LONGEST_COAST_S

    def fit(self, k: int, init: State | None, known_root: bool = False) -> float:
        """Fit frame ``k`` from a state, whose root is known or not, or afresh; from further off where it should.

        :return: by how much it costs less for having been fitted from further off.
        """
        prepared = self._prepared
        measurements = prepared.measure_all(k, init.t_camera_root if init is not None and known_root else None)
        found = self._solve(measurements, init, self._cold if init is None else self._warm)
        if not _is_usable(found):
            return 0.0
        self._last, self._last_s, self._valid[k] = found, prepared.track.times[k], True
        if init is None or not prepared.measurer.contradicts(measurements, found.t_camera_part):
            return 0.0
        freed = self._solve(measurements, init, self._cold)
        if freed.cost < found.cost:
            self._last = freed
            return found.cost - freed.cost
        return 0.0

    def hold(self, k: int) -> None:
        """Frame ``k`` is as the last one that was fitted."""
        if self._last is not None:
            self._keep(k, self._last)

    def fitted(self) -> FittedTrack:
        """All frames."""
        prepared, rotations, valid = self._prepared, self._rotations, self._valid
        confidence = prepared.measurer.joint_confidence(prepared.track.confidence)
        if prepared.hand_measurer is not None and prepared.hands is not None:
            confidence = np.maximum(confidence, prepared.hand_measurer.joint_confidence(prepared.hands))
            seen = (prepared.hands[:, :, 0, 2] > 0) & valid[:, None]
            rotations = calm_fingers(rotations, prepared.hand_measurer.fingers, seen, prepared.track.times)
        return FittedTrack(
            rotations=rotations,
            t_camera_root=self._root,
            betas=self._betas,
            valid=valid,
            joint_confidence=confidence * valid[:, None],
            iterations=self._iterations / max(int(valid.sum()), 1),
        )

    def _go_back(self, k: int, later: State, gain: float) -> None:
        """Frames before ``k`` from its state, each from the one after it, while that costs less than was gained."""
        track = self._prepared.track
        while k > 0 and self._valid[k - 1] and not track.acquired[k]:
            k -= 1
            found = self._solve(self._prepared.measure_all(k), later, self._warm)
            is_worth_it = _is_usable(found) and found.cost - self._cost[k] <= gain
            if not is_worth_it or _as_before(found.state.Omega, self._rotations[k, 1:]):
                return
            self._keep(k, found)
            later = found.state

    def _solve(self, measurements: Measurements, init: State | None, options: Options) -> Fit:
        found = fit_tree(self._tree, measurements, init, self._priors, options)
        self._iterations += found.iterations
        return found

    def _keep(self, k: int, fit: Fit) -> None:
        self._rotations[k, 0], self._rotations[k, 1:] = fit.state.R_camera_root, fit.state.Omega
        self._root[k], self._cost[k] = fit.state.t_camera_root, fit.cost


def _is_usable(fit: Fit) -> bool:
    return fit.status not in (Status.NO_MEASUREMENTS, Status.NON_FINITE)


def turned_alike(state: State, before: State, after: State) -> State:
    """A state whose joints are turned as those of a frame close by were, from ``before`` to ``after``."""
    R = after.R_camera_root @ before.R_camera_root.T @ state.R_camera_root
    Omega = after.Omega @ np.swapaxes(before.Omega, 1, 2) @ state.Omega
    return replace(state, R_camera_root=R, Omega=Omega)


def _as_before(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether no joint's rotation (K, 3, 3) is turned by more than 10 degrees against the other's."""
    return bool((np.einsum("kij,kij->k", a, b) > 1 + 2 * np.cos(np.radians(10.0))).all())


def _fit_shape(prepared: PreparedTrack, root_cam: np.ndarray | None = None) -> ClipFit:
    """The one shape that all frames share, from some of them; ``root_cam`` (T, 3): where the pelvis is known to be.

    The detector misplaces a keypoint in the same way in every frame, so all frames together say as much about the
    shape as one: the prior counts once a frame.
    """
    at = (lambda k: None) if root_cam is None else root_cam.__getitem__
    measurements = [prepared.measure(k, at(k)) for k in _spread(np.flatnonzero(prepared.track.seen), SHAPE_FRAMES)]
    weights = replace(prepared.weights, shape=WEIGHTS.shape * len(measurements))
    options = replace(ROBUST, stages=cold_stages(weights))
    return fit_clip(prepared.body, measurements, priors=prepared.priors, options=options)


def cold_stages(weights: Weights) -> tuple[Stage, ...]:
    """From no estimate at all: directions and priors first, then the image, then everything at its own weight."""
    return (
        Stage(
            replace(
                weights,
                orientation_field=4 * weights.orientation_field,
                keypoints2d=1e3,
                joint_prior=10 * weights.joint_prior,
                shape=100 * weights.shape,
            ),
            5e-2,
            10,
        ),
        Stage(
            replace(weights, keypoints2d=1e4, joint_prior=3 * weights.joint_prior, shape=10 * weights.shape), 1e-2, 10
        ),
        *warm_stages(weights),
    )


def warm_stages(weights: Weights) -> tuple[Stage, ...]:
    """From the state of a frame close by."""
    return (Stage(weights, 1e-4, 50),)


def _joint_weights(body: Body) -> np.ndarray:
    weights = np.ones(body.K)
    for k, name in enumerate(body.joint_names[1:]):
        weights[k] = next((value for key, value in _STIFF_JOINTS.items() if key in name), 1.0)
    return weights


def _spread(indices: np.ndarray, count: int) -> np.ndarray:
    """At most ``count`` of the indices, evenly spread."""
    return indices[np.unique(np.linspace(0, len(indices) - 1, min(count, len(indices))).round().astype(int))]
