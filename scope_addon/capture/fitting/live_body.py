# SPDX-License-Identifier: GPL-3.0-or-later
"""The body in single frames of a clip that is still being tracked: what a preview shows over the footage.

Each frame is fitted as a picture is, with a shape of its own and without those around it, so that only the frames that
are looked at cost anything, and the motion does not depend on which these were.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....solver import Body, State
from ..camera.intrinsics import Camera
from ..perception.landmark_network import KEYPOINT_NAMES
from ..perception.lifter import HIPS
from ..perception.observation import Observation
from ..perception.region import Region
from ..tracking.track import single_frame_track
from .ablation import ALL_PARTS, Parts
from .track_fit import fit_picture, prepare_track


@dataclass(frozen=True)
class LivePose:
    """A body in one frame: ``vertices_cam`` (V, 3) metres, camera frame, and the camera that it was fitted with."""

    vertices_cam: np.ndarray
    body: Body
    camera: Camera


class LiveBody:
    """Fits one body to single observations, in whatever thread asks."""

    def __init__(
        self, body: Body, camera: Camera, parts: Parts = ALL_PARTS, height_m: float | None = None
    ) -> None:
        self._body, self._camera, self._parts, self._height_m = body, camera, parts, height_m
        self.is_ready = False  # whether everything is loaded, and a fit takes some milliseconds

    def load(self) -> None:
        """Load what the first fit needs, by a fit to the body itself."""
        self._solve(_standing(self._body, self._camera))
        self.is_ready = True

    def fit(self, observation: Observation) -> LivePose | None:
        """The body in the frame of this observation; None where it says too little."""
        state = self._solve(observation)
        if state is None:
            return None
        R, t = _placed(self._body, state)
        return LivePose(self._body.skin(R, t, state.beta), self._body, self._camera)

    def _solve(self, observation: Observation) -> State | None:
        track = single_frame_track(observation)
        if not track.seen[0]:
            return None
        found = fit_picture(prepare_track(self._body, track, self._camera, self._parts, self._height_m))
        return None if found is None else found.state


def _placed(body: Body, state: State) -> tuple[np.ndarray, np.ndarray]:
    """Part poses (K+1, 3, 3) and (K+1, 3), camera frame."""
    rotations = np.concatenate([state.R_camera_root[None], state.Omega])
    return body.forward_kinematics(rotations, state.t_camera_root - body.rest_joints(state.beta)[0], state.beta)


def _standing(body: Body, camera: Camera) -> Observation:
    """The body at rest, upright, 3 m in front of the camera."""
    R, t = _placed(body, State.rest(body.K, body.P))
    at = body.keypoint_set("blazepose")
    points = body.keypoints(R, t)[[at[name] for name in KEYPOINT_NAMES]]
    pixels = points @ camera.intrinsics.T
    world = points - points[HIPS].mean(axis=0)
    region = Region((0.0, 0.0), 1.0, 0.0)
    return Observation(pixels[:, :2] / pixels[:, 2:], np.ones(len(points)), world, 1.0, region, acquired=True)
