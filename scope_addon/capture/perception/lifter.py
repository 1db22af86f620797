# SPDX-License-Identifier: GPL-3.0-or-later
"""The lifting network: keypoints in the image and a guess at their depth to our body's keypoints in space.

The network sees every person through a virtual camera that looks straight at them, so that neither place in the
picture nor size changes its input. With x̂_j the keypoint's ray (x/z, y/z, 1) and c the mean ray of hips and shoulders,

    R_virtual_camera = rows (right, down, c/|c|),  right ⟂ the camera's y axis
    u_j = project(R_virtual_camera x̂_j),  s = rms_j |u_j − ū| over the limbs
    input = [u_j / s, confidence_j, W_j / 0.5 m · known, known, log s]

with W the world landmarks (known = 1) or zeros (known = 0). It sees a window of such inputs around the frame (see
`lifter_window`), each through the virtual camera of its own moment. The output, in the axes of the middle's virtual
camera, are the keypoints of our body relative to the middle of its hips and the logarithm of their standard deviations
across and along the line of sight; the positions are turned back into camera axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from ....solver.errors import ModelFileError, ShapeError
from ...errors import SetupError
from ...kinematics.frame_blocks import by_blocks
from .lifter_window import WINDOW, Windows, standing_still
from .sessions import open_session

LIFTER_FILE = Path(__file__).resolve().parents[3] / "assets" / "lifter" / "lifter.onnx"
KEYPOINT_COUNT = 33
INPUT_SIZE = KEYPOINT_COUNT * 6 + 2
WORLD_UNIT_M = 0.5
TORSO = np.array([11, 12, 23, 24])  # shoulders and hips
HIPS = np.array([23, 24])
LIMBS = np.array([0, *range(11, 17), *range(23, 29)])  # nose, arms, legs: what gives a person their size in the image
# What the network's deviations across and along the line of sight, right on imitated detections, are short of on real
# pictures: poses, builds and detector errors there are not those of the training.
SIGMA_ON_PICTURES = np.array([1.0, 1.3])
WORLD_SHARE = 0.75  # of the estimate that knows the world landmarks, when both are mixed
_WORLD_AND_KNOWN = slice(KEYPOINT_COUNT * 3, KEYPOINT_COUNT * 6 + 1)  # of the input
_BATCH = 1024


@dataclass(frozen=True)
class Lifted:
    """Keypoints of our body in space, for T frames.

    ``points`` (T, 33, 3) metres, the middle of the hips at 0, camera axes; ``sigma_across``, ``sigma_along`` (T, 33)
    metres: standard deviation of a coordinate across, and along, the line of sight to the person.
    """

    points: np.ndarray
    sigma_across: np.ndarray
    sigma_along: np.ndarray


def virtual_camera(rays: np.ndarray) -> np.ndarray:
    """(T, 33, 2) normalized image coordinates -> (T, 3, 3) R_virtual_camera, which turns the person onto the z axis."""
    center = rays[:, TORSO].mean(axis=1)
    z = np.concatenate([center, np.ones_like(center[:, :1])], axis=1)
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    x = np.stack([z[:, 2], np.zeros_like(z[:, 0]), -z[:, 0]], axis=1)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=1)


def person_size(image_points: np.ndarray) -> np.ndarray:
    """(T, 33, 2) -> (T,) s of the module's equation, in the points' unit."""
    limbs = image_points[:, LIMBS]
    return np.maximum(np.sqrt(np.square(limbs - limbs.mean(axis=1, keepdims=True)).sum(axis=-1).mean(axis=-1)), 1e-4)


def network_input(rays: np.ndarray, confidence: np.ndarray, world: np.ndarray, known: np.ndarray) -> tuple:
    """What the network sees of T people, see the module's equation.

    :param rays: (T, 33, 2) normalized image coordinates;  confidence: (T, 33);  world: (T, 33, 3) metres;
        known: (T,) 1 where the world landmarks are to be used.
    :return: input (T, 200) and R_virtual_camera (T, 3, 3).
    """
    R = virtual_camera(rays)
    seen = rays @ np.swapaxes(R[:, :, :2], 1, 2) + R[:, None, :, 2]
    u = seen[..., :2] / np.maximum(seen[..., 2:], 0.1)
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
    return np.concatenate(parts, axis=1), R


def mixture(ways: list[Lifted], shares: list[float], R_virtual_camera: np.ndarray) -> Lifted:
    """Mean and deviation of a mixture of several estimates of the same frames; the shares a_i sum to 1.

    P = Σ_i a_i P_i and σ² = Σ_i a_i (σ_i² + (P_i − P)²), the latter in the axes of ``R_virtual_camera`` (T, 3, 3):
    where estimates disagree, the deviation grows.
    """
    mixed = list(zip(shares, ways, strict=True))
    points = np.sum([a * way.points for a, way in mixed], axis=0)
    turned = np.swapaxes(R_virtual_camera, 1, 2)
    off = np.sum([a * np.square((way.points - points) @ turned) for a, way in mixed], axis=0)
    across = np.sum([a * np.square(way.sigma_across) for a, way in mixed], axis=0) + off[..., :2].mean(axis=-1)
    along = np.sum([a * np.square(way.sigma_along) for a, way in mixed], axis=0) + off[..., 2]
    return Lifted(points, np.sqrt(across), np.sqrt(along))


@cache
def default_lifter() -> Lifter:
    """The lifting network of the repository, opened once."""
    return Lifter()


class Lifter:
    """The lifting network on the CPU; keeps nothing between calls, and may be used by several threads at once."""

    def __init__(self, path: Path | None = None, threads: int = 1) -> None:
        self.path = path or LIFTER_FILE
        if not self.path.is_file():
            raise SetupError(f"{self.path} is missing, which belongs to the repository: restore it.")
        self._session = open_session(self.path, threads)
        shapes = [s.shape[1:] for s in (*self._session.get_inputs(), *self._session.get_outputs())]
        if shapes != [[WINDOW, INPUT_SIZE], [KEYPOINT_COUNT, 3], [KEYPOINT_COUNT, 2]]:
            raise ModelFileError(f"{self.path} is not a lifting network of this version: its shapes are {shapes}.")

    def lift(
        self, rays: np.ndarray, confidence: np.ndarray, world: np.ndarray | None, windows: Windows | None = None
    ) -> Lifted:
        """Lift T frames at once.

        :param rays: (T, 33, 2) image coordinates without lens distortion, over the focal length;
            confidence: (T, 33) 0..1;  world: (T, 33, 3) metres, hip-centred, or None to do without;
            windows: which frames lie around each; None: each frame is a picture of its own.
        """
        around = _windows(rays, confidence, windows)

        def lift(rows: np.ndarray) -> tuple[np.ndarray, ...]:
            way = self._lift(*_see(rows, rays, confidence, world, around))
            return way.points, way.sigma_across, way.sigma_along

        return Lifted(*by_blocks(lift, np.arange(len(rays))))

    def lift_mixture(
        self, rays: np.ndarray, confidence: np.ndarray, world: np.ndarray, windows: Windows | None = None
    ) -> Lifted:
        """What the network finds with the world landmarks and without them, mixed: better than either on real clips."""
        around = _windows(rays, confidence, windows)

        def lift(rows: np.ndarray) -> tuple[np.ndarray, ...]:
            x, R = _see(rows, rays, confidence, world, around)
            informed = self._lift(x, R)
            x[..., _WORLD_AND_KNOWN] = 0.0
            mean = mixture([informed, self._lift(x, R)], [WORLD_SHARE, 1 - WORLD_SHARE], R)
            return mean.points, mean.sigma_across, mean.sigma_along

        return Lifted(*by_blocks(lift, np.arange(len(rays))))

    def _lift(self, x: np.ndarray, R_virtual_camera: np.ndarray) -> Lifted:
        points, log_sigma = self.run(x)
        points = points - points[:, HIPS].mean(axis=1, keepdims=True)
        sigma = np.exp(log_sigma) * SIGMA_ON_PICTURES
        return Lifted(points @ R_virtual_camera, sigma[..., 0], sigma[..., 1])

    def run(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The bare network: input (T, 9, 200) -> points (T, 33, 3) and log σ (T, 33, 2), virtual camera's axes."""
        name = self._session.get_inputs()[0].name
        runs = [self._session.run(None, {name: x[k : k + _BATCH]}) for k in range(0, max(len(x), 1), _BATCH)]
        points, log_sigma = (np.concatenate([r[i] for r in runs]).astype(float) for i in (0, 1))
        return points, log_sigma


def _windows(rays: np.ndarray, confidence: np.ndarray, windows: Windows | None) -> Windows:
    """The windows, once the arrays fit each other."""
    T = len(rays)
    for name, value, shape in (("rays", rays, (T, 33, 2)), ("confidence", confidence, (T, 33))):
        if value.shape != shape:
            raise ShapeError(f"{name} must have shape {shape}, but has {value.shape}")
    return standing_still(T) if windows is None else windows


def _see(
    rows: np.ndarray, rays: np.ndarray, confidence: np.ndarray, world: np.ndarray | None, around: Windows
) -> tuple[np.ndarray, np.ndarray]:
    """What the network sees of the frames ``rows`` (t,): input (t, 9, 200) f32 and R_virtual_camera (t, 3, 3)."""
    first, end = around.span(rows) if len(rows) else (0, 0)
    n = end - first
    given = np.zeros((n, KEYPOINT_COUNT, 3)) if world is None else world[first:end]
    x, R = network_input(rays[first:end], confidence[first:end], given, np.full(n, world is not None, float))
    return around.of(x.astype(np.float32), rows, first), R[rows - first]
