# SPDX-License-Identifier: GPL-3.0-or-later
"""The body in single frames of a clip that is still being tracked, for the preview over the
footage.

Each frame is fitted like a still image, with its own shape and independently of its neighbours.
Only frames that are shown cost time, and the motion does not depend on which frames these are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....solver import Body, Measurements, Stage, StandingPoints, State, View, fit_motion
from ...arrays import FloatArray
from ..camera.intrinsics import Camera
from ..perception.landmark_network import HIPS, KEYPOINT_NAMES
from ..perception.observation import Observation
from ..perception.region import Region
from ..tracking.track import single_frame_track
from .frame_sequence import rotations_of
from .prepared_track import prepare_track
from .track_fit import fit_single_frame
from .weights import ROBUST


@dataclass(frozen=True)
class LivePose:
    """A body in one frame: ``vertices_cam`` (V, 3) metres, camera frame, and the camera that it was
    fitted with.
    """

    vertices_cam: FloatArray
    body: Body
    camera: Camera


class LiveBody:
    """Fits one body to single observations, in the calling thread."""

    def __init__(self, body: Body, camera: Camera, height_m: float | None = None) -> None:
        self._body = body
        self._camera = camera
        self._height_m = height_m
        self.is_ready = False  # whether everything is loaded, so that a fit takes some milliseconds

    def load(self) -> None:
        """Load what the fits of a clip need, by fitting the body to its own projection."""
        observation = _rest_observation(self._body, self._camera)
        state = self._solve(observation)
        self.is_ready = True
        if state is not None:
            self._load_motion(observation, state)

    def _load_motion(self, observation: Observation, state: State) -> None:
        """Load what the fit of a whole clip needs besides."""
        track = single_frame_track(observation)
        prepared = prepare_track(self._body, track, self._camera, self._height_m)
        measured = prepared.measure_all(0)
        frames: list[Measurements | list[View]] = [
            measured,
            [View(measured, np.diag([-1.0, -1.0, 1.0]))],
            measured,
        ]
        times = np.arange(3) / 30.0
        stands = StandingPoints([0], np.ones((3, 1)))
        options = replace(ROBUST, stages=(Stage(prepared.weights, 1e-4, 1),))
        fit_motion(
            self._body,
            frames,
            times,
            init=[state] * 3,
            priors=prepared.priors,
            options=options,
            stands=stands,
            shape=state.beta,
        )

    def fit(self, observation: Observation) -> LivePose | None:
        """Fit the body to an observation; None if the observation does not suffice."""
        state = self._solve(observation)
        if state is None:
            return None
        R, t = _part_poses(self._body, state)
        return LivePose(self._body.skin(R, t, state.beta), self._body, self._camera)

    def _solve(self, observation: Observation) -> State | None:
        track = single_frame_track(observation)
        if not track.seen[0]:
            return None
        found = fit_single_frame(prepare_track(self._body, track, self._camera, self._height_m))
        return None if found is None else found.state


def _part_poses(body: Body, state: State) -> tuple[FloatArray, FloatArray]:
    """Return part poses (K+1, 3, 3) and (K+1, 3), camera frame."""
    trans = state.t_camera_root - body.rest_joints(state.beta)[0]
    return body.forward_kinematics(rotations_of(state), trans, state.beta)


def _rest_observation(body: Body, camera: Camera) -> Observation:
    """Return an observation of the body in rest pose, upright, 3 m in front of the camera."""
    R, t = _part_poses(body, State.rest(body.K, body.P))
    at = body.keypoint_set("blazepose")
    points = body.keypoints(R, t)[[at[name] for name in KEYPOINT_NAMES]]
    pixels = points @ camera.intrinsics.T
    world = points - points[HIPS].mean(axis=0)
    region = Region((0.0, 0.0), 1.0, 0.0)
    return Observation(
        pixels[:, :2] / pixels[:, 2:], np.ones(len(points)), world, 1.0, region, acquired=True
    )
