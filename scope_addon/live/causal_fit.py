# SPDX-License-Identifier: GPL-3.0-or-later
"""The body fitted to one observation after another, each from the state of the one before, and from
what the body is known to stand on.

The lifting network's window ends with the newest frame, which stands for the samples after it: at
the end of a clip, it is the same (see `lifter`). A frame whose fit contradicts the lifter is fitted
again with the stages of a cold start, and keeps the fit of lower cost, as in `frame_sequence`;
earlier frames stay as they were given.

The size of a body in the picture does not tell a squat from a step back, but feet at rest do: a
`Support` is the floor, and the places where points rest.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np

from ...solver import Body, Fit, Floor, FootContacts, FrameSolver, Measurements, Options, State
from ..arrays import FloatArray, IndexArray
from ..capture.camera.intrinsics import Camera
from ..capture.fitting.frame_measurements import Measurer
from ..capture.fitting.frame_sequence import LONGEST_COAST_S, is_usable, rotations_of
from ..capture.fitting.prepared_track import prepare_track
from ..capture.fitting.weights import ROBUST, cold_stages, warm_stages
from ..capture.perception.landmark_network import KEYPOINT_COUNT, KEYPOINT_NAMES
from ..capture.perception.lifter import OFFSETS_S, default_lifter, windows_around
from ..capture.perception.observation import Observation
from ..capture.tracking.track import single_frame_track
from ..kinematics.contact_points import CONTACT_POINTS, with_contact_points

# of the floor's weight; three times as much tilts bodies whose distance begins too far
AFTER_A_PAUSE = 0.01


@dataclass(frozen=True)
class Support:
    """Places in the camera frame, metres, and the plane of the floor, normal . p = offset."""

    places: FloatArray  # (6, 3) where points rest
    rests: FloatArray  # (6,) probability that each of them rests there
    on_floor: FloatArray  # (6,) probability that it rests on the floor
    not_below: FloatArray  # (6,) probability that it is not below the floor
    stands: float  # probability that the lowest sole was on the floor
    floor_normal: FloatArray  # (3,) unit, upwards
    floor_offset: float

    def added_to(self, measurements: Measurements, points: IndexArray) -> Measurements:
        """Return the measurements of a frame with this support.

        :param points: (6,) numbers of the contact points.
        """
        return replace(
            measurements,
            foot_contacts=FootContacts(points, self.places, self.rests),
            floor=Floor(
                points, self.floor_normal, self.floor_offset, self.on_floor, below=self.not_below
            ),
        )

    def after_a_pause(self) -> Support:
        """Return what is left of it when points may have moved since: who stood on the floor is not
        below it now.
        """
        nothing = np.zeros_like(self.rests)
        not_below = np.full_like(nothing, AFTER_A_PAUSE * self.stands)
        return replace(self, rests=nothing, on_floor=nothing, not_below=not_below)


_SOLE_KEYPOINTS = [
    KEYPOINT_NAMES.index(f"{side}_{name}")
    for side in ("left", "right")
    for name in ("heel", "foot_index")
]
# Inverse variances of points at rest: 1 cm from their place, 3 mm from the floor. In the sample
# clip's squat, the distance is wrong by up to 37 cm without them, and by 12 cm with them. Ten times
# the first lets feet slide no less, and tilts bodies whose feet were first seen at a wrong
# distance.
_RESTING = 1e4
_FLOOR = 1e5
SAME_SHAPE = 1e-3  # difference of shape coefficients below which the contact points stay the same


@dataclass(frozen=True)
class FittedFrame:
    """The state of one frame in its camera, and how far it was measured."""

    rotations: FloatArray  # (K+1, 3, 3); row 0 R_camera_root
    root_cam: FloatArray  # (3,) the pelvis, metres
    joint_confidence: FloatArray  # (K+1,) 0..1
    # (4, 2) where the image shows `SOLES`, normalized image coordinates
    soles: FloatArray


class CausalFit:
    """Fits observations in order.

    :param observation: the first one, from which only what every frame shares is prepared.
    :param height_m: the person's stature, if it is known, metres.
    """

    def __init__(
        self, body: Body, observation: Observation, camera: Camera, height_m: float | None = None
    ) -> None:
        self._shape_of_points: FloatArray | None = None
        prepared = prepare_track(body, single_frame_track(observation), camera, height_m=height_m)
        self._prepared = prepared
        self._camera = camera
        weights = replace(prepared.weights, floor=_FLOOR, foot_contact=_RESTING)
        self._cold, self._warm = (
            replace(ROBUST, stages=stages(weights)) for stages in (cold_stages, warm_stages)
        )
        # Confidences of joints are means of those of landmarks, here as a matrix (33, K+1).
        self._shares = prepared.measurer.joint_confidence(np.eye(KEYPOINT_COUNT))
        self._measurer = prepared.measurer
        self.set_shape(np.zeros(body.P))
        self._window: deque[tuple[float, Observation]] = deque()
        self._last: Fit | None = None
        self._last_s = -np.inf

    def set_camera(self, camera: Camera) -> None:
        """Continue with another focal length; the person's distance changes in proportion."""
        ratio = camera.intrinsics[0, 0] / self._camera.intrinsics[0, 0]
        self._camera, self._measurer = camera, Measurer(self._measurer.body, camera.intrinsics)
        if self._last is not None:
            state = self._last.state
            self._last = replace(
                self._last, state=replace(state, t_camera_root=state.t_camera_root * [1, 1, ratio])
            )

    def set_shape(self, betas: FloatArray) -> None:
        """Continue with another shape (P,)."""
        self._betas, self._priors = betas, self._prepared.priors_with_shape(betas)
        if (
            self._shape_of_points is None
            or np.abs(betas - self._shape_of_points).max(initial=0.0) > SAME_SHAPE
        ):
            self._shape_of_points = betas
            body = with_contact_points(self._prepared.body, betas)
            self._measurer = Measurer(body, self._camera.intrinsics)
            self._solver = FrameSolver(body)
            self._contact_points = (
                np.arange(len(CONTACT_POINTS)) + len(body.keypoint_names) - len(CONTACT_POINTS)
            )

    def fit(
        self,
        time_s: float,
        observation: Observation,
        root_cam: FloatArray | None = None,
        support: Support | None = None,
    ) -> FittedFrame | None:
        """Fit the next observation; None if it does not suffice.

        :param time_s: of its frame, later than that of the observation before.
        :param root_cam: (3,) about where the pelvis is, from feet that rest on the floor, camera
            frame, metres.
        """
        measurements = self._measure(time_s, observation, root_cam)
        if support is not None and not observation.acquired:
            measurements = support.added_to(measurements, self._contact_points)
        is_continued = not observation.acquired and time_s - self._last_s <= LONGEST_COAST_S
        initial = self._last.state if self._last is not None and is_continued else None
        if initial is not None:
            initial = replace(initial, beta=self._betas)
        found = self._solve(measurements, initial, self._cold if initial is None else self._warm)
        if not is_usable(found):
            return None
        if initial is not None and self._measurer.contradicts(measurements, found.t_camera_part):
            restarted = self._solve(measurements, initial, self._cold)
            found = restarted if restarted.cost < found.cost else found
        self._last = found
        self._last_s = time_s
        state = found.state
        return FittedFrame(
            rotations_of(state),
            state.t_camera_root,
            observation.keypoints_confidence @ self._shares,
            self.soles(observation),
        )

    def soles(self, observation: Observation) -> FloatArray:
        """Return where the image shows the soles (4, 2), normalized image coordinates."""
        return self._measurer.rays(
            self._camera.undistort(observation.keypoints_px[_SOLE_KEYPOINTS])
        )

    def _solve(self, measurements: Measurements, initial: State | None, options: Options) -> Fit:
        return self._solver.fit(measurements, initial, self._priors, options)

    def _measure(
        self, time_s: float, observation: Observation, root_cam: FloatArray | None
    ) -> Measurements:
        """Lift the observation within the window that ends with it, and convert it to
        measurements.
        """
        if observation.acquired:  # maybe of somebody else
            self._window.clear()
        self._window.append((time_s, observation))
        while len(self._window) > 1 and self._window[1][0] <= time_s + OFFSETS_S[0]:
            self._window.popleft()
        times = np.array([time for time, _ in self._window])
        seen = [o for _, o in self._window]
        confidence = np.array([o.keypoints_confidence for o in seen])
        pixels = self._camera.undistort(np.array([o.keypoints_px for o in seen]))
        world = np.array([o.world_landmarks for o in seen])
        windows = windows_around(times, np.ones(len(times), bool))
        rays = self._measurer.rays(pixels)
        lifted = default_lifter().lift(
            rays, confidence, world, windows, rows=np.array([len(seen) - 1])
        )
        lifted = lifted.scaled(self._prepared.lift_scale)
        return self._measurer.measure(
            pixels[-1], confidence[-1], lifted.points[0], lifted.sigma_along[0], root_cam
        )
