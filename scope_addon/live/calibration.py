# SPDX-License-Identifier: GPL-3.0-or-later
"""Focal length, shape, up direction and floor from what was seen so far, by the offline stages.

They are estimated from a growing set of observations during the first two seconds. After that,
focal length and shape stay as they are, and the world follows the last seconds slowly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...solver import Body
from ..arrays import Float64Array, FloatArray, Uint8Array
from ..capture.camera.bars import content_size, find_bars
from ..capture.camera.intrinsics import Camera
from ..capture.camera.line_segments import Segments, find_segments
from ..capture.camera.verticals import estimate_up_from_lines
from ..capture.fitting.focal_length import camera_by_edges
from ..capture.fitting.frame_sequence import FittedTrack
from ..capture.fitting.prepared_track import prepare_track
from ..capture.fitting.track_fit import fit_track
from ..capture.perception.observation import Observation
from ..capture.tracking.track import Track, track_of
from ..capture.world.placement import place_track
from ..capture.world.world_frame import find_world, floor_height
from ..kinematics.axes import transform_points, world_from_level_camera
from ..kinematics.contact_points import SOLES

STAGES = 3  # of the approach to an estimate
# relative difference of focal lengths, for which the lines of the background point alike
SAME_FOCAL = 0.02
# of two estimates of one floor
SAME_HEIGHT_M = 0.015
SAME_UP_COS = np.cos(np.radians(1.0))


@dataclass(frozen=True)
class LiveCalibration:
    """What all frames share: camera, shape, and the world as up direction, height and horizontal
    position.
    """

    camera: Camera
    betas: FloatArray  # (P,)
    up: FloatArray  # (3,) unit, camera axes
    camera_position: FloatArray  # (3,) metres, world

    @property
    def T_world_camera(self) -> Float64Array:
        """The (4, 4) camera pose."""
        T = world_from_level_camera(self.up)
        T[:3, 3] = self.camera_position
        return T

    def interpolated(
        self, target: LiveCalibration, share: float, share_of_world: float
    ) -> LiveCalibration:
        """Return the calibration that lies between this one and another.

        :param share: of the way to the other one, 0..1, for focal length (its logarithm) and shape.
        :param share_of_world: the same for the world.
        """
        up = self.up + share_of_world * (target.up - self.up)
        return LiveCalibration(
            _between(self.camera, target.camera, share),
            self.betas + share * (target.betas - self.betas),
            up / np.linalg.norm(up),
            self.camera_position + share_of_world * (target.camera_position - self.camera_position),
        )


def _between(camera: Camera, target: Camera, share: float) -> Camera:
    ratio = target.intrinsics[0, 0] / camera.intrinsics[0, 0]
    if share >= 1.0 or abs(ratio - 1) < 1e-4:
        return target
    intrinsics = camera.intrinsics.copy()
    intrinsics[[0, 1], [0, 1]] *= ratio**share
    return replace(target, intrinsics=intrinsics)


class GradualCalibration:
    """A calibration that approaches estimates; its velocity and acceleration continue where a new
    estimate comes.

    Calibrations x_k follow each other, x_k' = (x_{k-1} - x_k) / s, with the estimate before the
    first of them.

    :param settling_s: s.
    """

    def __init__(self, start: LiveCalibration, settling_s: float) -> None:
        self._stages = [start] * STAGES
        self._settling_s = settling_s

    def step(self, target: LiveCalibration, step_s: float, world_s: float) -> LiveCalibration:
        """Let time pass, and return the calibration.

        :param target: the newest estimate.
        :param step_s: seconds since the step before.
        :param world_s: s of the first stage's world, at least that of all others.
        """
        share, share_of_world = (
            float(1 - np.exp(-step_s / s)) for s in (self._settling_s, world_s)
        )
        for k, stage in enumerate(self._stages):
            self._stages[k] = target = stage.interpolated(
                target, share, share_of_world if k == 0 else share
            )
        return target


class Calibrator:
    """Estimates the calibration; calls must not overlap, but may come from another thread.

    :param camera: as known from the user or the source.
    :param height_m: the person's stature, if it is known, metres.
    """

    def __init__(
        self, body: Body, camera: Camera, size: tuple[int, int], height_m: float | None = None
    ) -> None:
        self._body = body
        self._given = camera
        self._size = size
        self._height_m = height_m
        self._camera = camera
        self._segments = Segments.none()
        self._up_of_lines: Float64Array | None = None
        self._focal_of_lines = 1e-9  # for which that was estimated

    def observe(self, image_rgb: Uint8Array, observation: Observation) -> None:
        """Find the edges of the background in a frame (H, W, 3) in which somebody is seen."""
        people = [observation.keypoints_px]
        bars = find_bars(image_rgb)
        self._segments = find_segments(image_rgb, people, bars=bars)
        if self._given.focal_deviation > 0.0:
            content = content_size(bars, *self._size)
            self._camera = camera_by_edges(self._segments, *self._size, content)

    def estimate(
        self, times_s: Sequence[float], observations: Sequence[Observation]
    ) -> LiveCalibration:
        """Estimate everything from all observations so far, at least one."""
        camera = self._camera
        track = track_of(times_s, observations)
        prepared = prepare_track(self._body, track, camera, height_m=self._height_m)
        fitted = fit_track(prepared, lambda *_: None)
        return self._with_world(
            LiveCalibration(camera, fitted.betas, np.zeros(3), np.zeros(3)), track, fitted
        )

    def follow(
        self, calibration: LiveCalibration, track: Track, fitted: FittedTrack
    ) -> LiveCalibration:
        """Estimate the floor's inclination and height again, from the last seconds.

        The horizontal position stays: nothing in the picture says where the origin was. Small
        differences are ignored, because frames were fitted to the floor as it is: a bias of
        millimetres would add up for as long as it runs.
        """
        found = self._with_world(calibration, track, fitted)
        higher = abs(found.camera_position[2] - calibration.camera_position[2]) > SAME_HEIGHT_M
        if not higher and found.up @ calibration.up > SAME_UP_COS:
            return calibration
        position = calibration.camera_position.copy()
        position[2] = found.camera_position[2]
        return replace(calibration, up=found.up, camera_position=position)

    def _with_world(
        self, calibration: LiveCalibration, track: Track, fitted: FittedTrack
    ) -> LiveCalibration:
        """Add the world: as offline where no lines tell which way is up, otherwise with their
        direction.
        """
        placed = place_track(self._body, track, fitted, smoothing=True)
        T = find_world([placed]).T_world_camera
        focal_px = calibration.camera.intrinsics[0, 0]
        # The search for the lines' direction takes long, so another one follows only where the
        # focal length changes.
        if (
            len(self._segments.ends_px)
            and abs(np.log(focal_px / self._focal_of_lines)) > SAME_FOCAL
        ):
            self._up_of_lines = estimate_up_from_lines(
                self._segments.lines(calibration.camera), T[2, :3]
            ).up
            self._focal_of_lines = float(focal_px)
        if self._up_of_lines is not None:
            up = self._up_of_lines
            valid = placed.valid
            contact = placed.contact(up)[valid, : len(SOLES)]
            T = world_from_level_camera(up, -floor_height(placed.soles[valid], contact, up))
            T[:2, 3] -= transform_points(T, placed.joints[valid.argmax(), :1])[0, :2]
        return replace(calibration, up=T[2, :3], camera_position=T[:3, 3])
