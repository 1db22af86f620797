# SPDX-License-Identifier: GPL-3.0-or-later
"""The lifting network: from keypoints in the image, with or without world landmarks, to the body
model's in 3D.

The input is a view of the person through a virtual camera that looks straight at them, so that it
depends neither on position nor on size in the image. With x̂_j the keypoint's ray (x/z, y/z, 1) and
c the mean ray of hips and shoulders,

    R_virtual_camera = rows (right, down, c/|c|),  right ⟂ the camera's y axis
    u_j = project(R_virtual_camera x̂_j),  s = rms_j |u_j − ū| over the limbs
    input = [u_j / s, confidence_j, W_j / 0.5 m · known, known, log s]

with W the world landmarks (known = 1) or zeros (known = 0). The network gets a window of such
inputs around the frame, each from the virtual camera of its own time. The output is in the axes of
the middle frame's virtual camera: the keypoints of the body model relative to the hip centre, and
the logarithms of their standard deviations across and along the line of sight. The positions are
then rotated into camera axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....solver.errors import ModelFileError
from ...arrays import BoolArray, Float32Array, FloatArray, IndexArray, round_array, unit_vectors
from ...errors import SetupError
from ...kinematics.frame_blocks import by_blocks
from .landmark_network import HIPS, KEYPOINT_COUNT, TRUNK
from .sessions import open_session

LIFTER_FILE = Path(__file__).resolve().parents[3] / "assets" / "lifter" / "lifter.onnx"
INPUT_SIZE = KEYPOINT_COUNT * 6 + 2
WORLD_UNIT_M = 0.5
# Nose, arms and legs determine the size in the image.
LIMBS = np.array([0, *range(11, 17), *range(23, 29)])
# Calibration of the network's standard deviations across and along the line of sight. They are
# right for the simulated detections of the training, but too small for real images, whose poses,
# builds and detector errors differ.
SIGMA_CALIBRATION = np.array([1.0, 1.3])
WORLD_SHARE = 0.75  # weight in the mixture of the estimate with world landmarks
_WORLD_AND_KNOWN = slice(KEYPOINT_COUNT * 3, KEYPOINT_COUNT * 6 + 1)  # of the input
_BATCH = 1024
WINDOW = 9  # samples, the frame itself in the middle
SPACING_S = 0.1  # between samples, as in the training
MIDDLE = WINDOW // 2
OFFSETS_S = (np.arange(WINDOW) - MIDDLE) * SPACING_S
LONGEST_GAP_S = 0.25


@dataclass(frozen=True)
class Lifted:
    """Lifted keypoints of the body model, for T frames.

    ``points`` (T, 33, 3) metres, camera axes, the hip centre at 0; ``sigma_across``,
    ``sigma_along`` (T, 33) metres: standard deviation of a coordinate across and along the line of
    sight to the person.
    """

    points: FloatArray
    sigma_across: FloatArray
    sigma_along: FloatArray

    def scaled(self, scale: float) -> Lifted:
        """Return the same keypoints of a person who is ``scale`` times as large."""
        return Lifted(self.points * scale, self.sigma_across * scale, self.sigma_along * scale)


def virtual_camera(rays: FloatArray) -> FloatArray:
    """Calculate the rotation that brings the person onto the z axis.

    :param rays: (T, 33, 2) normalized image coordinates.
    :return: (T, 3, 3) R_virtual_camera, see the module's equation.
    """
    return camera_towards(rays[:, TRUNK].mean(axis=1))


def camera_towards(center: FloatArray) -> FloatArray:
    """Calculate the rotations (T, 3, 3) that bring rays (T, 2), in normalized image coordinates,
    onto the z axis.
    """
    z = unit_vectors(np.concatenate([center, np.ones_like(center[:, :1])], axis=1))
    x = unit_vectors(np.stack([z[:, 2], np.zeros_like(z[:, 0]), -z[:, 0]], axis=1))
    return np.stack([x, np.cross(z, x), z], axis=1)


def person_size(image_points: FloatArray) -> FloatArray:
    """Calculate s (T,) of the module's equation from points (T, 33, 2), in the points' unit."""
    limbs = image_points[:, LIMBS]
    square = np.square(limbs - limbs.mean(axis=1, keepdims=True)).sum(axis=-1).mean(axis=-1)
    return np.maximum(np.sqrt(square), 1e-4)


def network_input(
    rays: FloatArray, confidence: FloatArray, world: FloatArray, known: NDArray[Any]
) -> tuple[FloatArray, FloatArray]:
    """Calculate the network's input for T frames, see the module's equation.

    :param rays: (T, 33, 2) normalized image coordinates.
    :param confidence: (T, 33) 0..1.
    :param world: (T, 33, 3) metres, camera axes, the hip centre at 0.
    :param known: (T,) 1 where the world landmarks are used, else 0.
    :return: input (T, 200) and R_virtual_camera (T, 3, 3).
    """
    R = virtual_camera(rays)
    view = rays @ np.swapaxes(R[:, :, :2], 1, 2) + R[:, None, :, 2]
    u = view[..., :2] / np.maximum(view[..., 2:], 0.1)
    s = person_size(u)[:, None]
    n = len(rays)
    known = np.asarray(known, rays.dtype).reshape(n, 1)
    parts = [
        np.clip(u.reshape(n, -1) / s, -6.0, 6.0),
        confidence,
        world.reshape(n, -1) / WORLD_UNIT_M * known,
        known,
        np.log(s),
    ]
    return round_array(np.concatenate(parts, axis=1)), R


def mixture(estimates: list[Lifted], weights: list[float], R_virtual_camera: FloatArray) -> Lifted:
    """Calculate mean and standard deviation of a mixture of several estimates of the same T frames.

    P = Σ_i a_i P_i and σ² = Σ_i a_i (σ_i² + (P_i − P)²), the latter in the axes of the virtual
    camera. The deviation grows where the estimates disagree.

    :param weights: a_i, with sum 1.
    :param R_virtual_camera: (T, 3, 3).
    """
    weighted = list(zip(weights, estimates, strict=True))
    points = np.sum([a * estimate.points for a, estimate in weighted], axis=0)
    R_camera_virtual = np.swapaxes(R_virtual_camera, 1, 2)
    spread = np.sum(
        [a * np.square((estimate.points - points) @ R_camera_virtual) for a, estimate in weighted],
        axis=0,
    )
    across = np.sum(
        [a * np.square(estimate.sigma_across) for a, estimate in weighted], axis=0
    ) + spread[..., :2].mean(axis=-1)
    along = (
        np.sum([a * np.square(estimate.sigma_along) for a, estimate in weighted], axis=0)
        + spread[..., 2]
    )
    return Lifted(points, np.sqrt(across), np.sqrt(along))


@cache
def default_lifter() -> Lifter:
    """Open the lifting network that ships with the extension, once.

    :raises SetupError: it is missing.
    """
    return Lifter()


class Lifter:
    """The lifting network on the CPU; stateless between calls and thread-safe.

    :raises SetupError: the file is missing.
    :raises ModelFileError: it is not a lifting network of this version.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = path or LIFTER_FILE
        if not self.path.is_file():
            raise SetupError(
                f"{self.path} is missing; install the extension again, or restore the file from "
                "the repository."
            )
        self._session = open_session(self.path, 1)
        shapes = [s.shape[1:] for s in (*self._session.get_inputs(), *self._session.get_outputs())]
        if shapes != [[WINDOW, INPUT_SIZE], [KEYPOINT_COUNT, 3], [KEYPOINT_COUNT, 2]]:
            raise ModelFileError(
                f"{self.path} is not a lifting network of this version: its shapes are {shapes}."
            )

    def lift(
        self,
        rays: FloatArray,
        confidence: FloatArray,
        world: FloatArray | None,
        windows: Windows | None = None,
        rows: IndexArray | None = None,
    ) -> Lifted:
        """Lift T frames; with world landmarks, mix the estimates with and without them, which is
        more accurate on real clips than either.

        :param rays: (T, 33, 2) normalized image coordinates without lens distortion.
        :param confidence: (T, 33) 0..1.
        :param world: (T, 33, 3) world landmarks in metres, hip-centred, or None to lift without
            them.
        :param windows: of the frames around each; None if every frame is a still.
        :param rows: (n,) the frames to lift, ascending; None: all.
        """
        T = len(rays)
        # Stills are frames far apart.
        around = windows or windows_around(2 * LONGEST_GAP_S * np.arange(T), np.ones(T, bool))

        def lift(rows: IndexArray) -> tuple[FloatArray, ...]:
            x, R = _window_input(rows, rays, confidence, world, around)
            lifted = self._lift(x, R)
            if world is not None:
                x[..., _WORLD_AND_KNOWN] = 0.0
                lifted = mixture([lifted, self._lift(x, R)], [WORLD_SHARE, 1 - WORLD_SHARE], R)
            return lifted.points, lifted.sigma_across, lifted.sigma_along

        return Lifted(*by_blocks(lift, np.arange(T) if rows is None else rows))

    def _lift(self, x: Float32Array, R_virtual_camera: FloatArray) -> Lifted:
        points, log_sigma = self.run(x)
        points = points - points[:, HIPS].mean(axis=1, keepdims=True)
        sigma = np.exp(log_sigma) * SIGMA_CALIBRATION
        return Lifted(points @ R_virtual_camera, sigma[..., 0], sigma[..., 1])

    def run(self, x: Float32Array) -> tuple[FloatArray, FloatArray]:
        """Run the network.

        :param x: (T, 9, 200) float32, windows of `network_input`.
        :return: points (T, 33, 3) in metres and log σ (T, 33, 2), both in the virtual camera's
            axes.
        """
        name = self._session.get_inputs()[0].name
        runs = [
            self._session.run(None, {name: x[k : k + _BATCH]})
            for k in range(0, max(len(x), 1), _BATCH)
        ]
        points, log_sigma = (np.concatenate([r[i] for r in runs]).astype(float) for i in (0, 1))
        return points, log_sigma


def _window_input(
    rows: IndexArray,
    rays: FloatArray,
    confidence: FloatArray,
    world: FloatArray | None,
    around: Windows,
) -> tuple[FloatArray, FloatArray]:
    """Calculate the input (t, 9, 200) float32 of the frames ``rows`` (t,), and R_virtual_camera (t,
    3, 3).
    """
    first, end = around.span(rows) if len(rows) else (0, 0)
    n = end - first
    landmarks = np.zeros((n, KEYPOINT_COUNT, 3)) if world is None else world[first:end]
    x, R = network_input(
        rays[first:end], confidence[first:end], landmarks, np.full(n, world is not None, float)
    )
    return around.gather(x.astype(np.float32), rows, first), R[rows - first]


@dataclass(frozen=True)
class Windows:
    """Windows around T frames, of samples that are evenly spaced: ``(1 - share) x[before] + share
    x[after]``.

    At any frame rate, a sample between two frames is interpolated linearly. A window ends where the
    person was not seen for longer than `LONGEST_GAP_S`; its last sample is then repeated. The
    window of a still repeats one frame.

    ``before``, ``after`` (T, WINDOW) rows; ``share`` (T, WINDOW) float32, 0..1.
    """

    before: IndexArray
    after: IndexArray
    share: Float32Array

    def gather(self, x: Float32Array, rows: IndexArray, first: int) -> Float32Array:
        """Interpolate the windows of some frames.

        :param x: (N, C) values, whose row 0 is that of frame ``first``.
        :param rows: (n,) frames.
        :return: (n, WINDOW, C).
        """
        share = self.share[rows].astype(x.dtype)[..., None]
        out: Float32Array = x[self.before[rows] - first] * (1 - share)
        out += x[self.after[rows] - first] * share
        out[:, MIDDLE] = x[rows - first]
        return out

    def span(self, rows: IndexArray) -> tuple[int, int]:
        """Calculate the first row that the frames ``rows`` (n,) need, and one past the last."""
        least = min(int(rows[0]), int(self.before[rows].min()))
        return least, max(int(rows[-1]), int(self.after[rows].max())) + 1


def windows_around(times: FloatArray, seen: BoolArray) -> Windows:
    """Calculate the windows of T frames, from those in which the person was seen.

    :param times: (T,) seconds, ascending.
    :param seen: (T,) whether the person was seen. The windows of other frames consist of the seen
        frames around them.
    """
    rows = np.flatnonzero(seen)
    if not len(rows):
        rows = np.arange(len(times))
    known = times[rows]
    run = np.concatenate([[0], np.cumsum(np.diff(known) > LONGEST_GAP_S)])
    # The last seen frame.
    own = np.maximum(np.searchsorted(rows, np.arange(len(times)), side="right") - 1, 0)
    low, high = (ends[own, None] for ends in ends_of_runs(run))
    samples = times[:, None] + OFFSETS_S
    after = np.clip(np.searchsorted(known, samples), low, high)
    before = np.maximum(after - 1, low)
    length = known[after] - known[before]
    share = np.clip((samples - known[before]) / np.maximum(length, 1e-9), 0.0, 1.0) * (length > 0)
    return Windows(rows[before], rows[after], share.astype(np.float32))


def ends_of_runs(numbers: NDArray[Any]) -> tuple[IndexArray, IndexArray]:
    """Find the indices (n,) of the first and of the last number equal to each of the non-decreasing
    numbers (n,).
    """
    return np.searchsorted(numbers, numbers), np.searchsorted(numbers, numbers, side="right") - 1
