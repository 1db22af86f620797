# SPDX-License-Identifier: GPL-3.0-or-later
"""BlazePose's landmark network: from a region of the image to 33 keypoints in 2D and 3D."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from ....solver.names import BLAZEPOSE
from ...arrays import Float32Array, Float64Array, FloatArray, Uint8Array
from .region import MARGIN, Region, image_input, region_from_points
from .sessions import Execution, network_path, open_session

if TYPE_CHECKING:
    import onnxruntime

INPUT_SIZE = 256
KEYPOINT_NAMES = BLAZEPOSE  # the network's order
KEYPOINT_COUNT = 33
SHOULDERS = [11, 12]
HIPS = [23, 24]
TRUNK = SHOULDERS + HIPS
LEGS = [[23, 25, 27], [24, 26, 28]]  # hip, knee, ankle
_POINTS = 39  # the keypoints, two auxiliary points and four unused ones
# Auxiliary points: hip centre; a point on the body circle around it.
_HIP_CENTER = 33
_BODY_CIRCLE = 34
_WINDOW = 7  # side in heatmap cells of the window that refines a keypoint
_HEAT_THRESHOLD = 0.5
_WORKERS = 2  # regions processed in parallel
_WORTH_ALL_THREADS = ("pose_landmark_heavy",)
_OUTPUTS = ["landmarks", "presence", "heatmap", "world"]
_VALUES = 6 * KEYPOINT_COUNT + 5  # of an estimate that is kept
_WITH_MASK = {"with_mask": np.array(True)}  # an input without which the mask is not computed


@dataclass(frozen=True)
class PoseEstimate:
    """The network's estimate for one region.

    ``keypoints_px`` (33, 2) image pixels; ``keypoints_confidence`` (33,) probability that a
    keypoint is in the image and not occluded; ``world_landmarks`` (33, 3) metres in camera axes (x
    right, y down, z forward), the hip centre at 0, or all 0 from a network without depth;
    ``presence``: probability that there is a person; ``region``: the input region; ``next_region``:
    the region for the next frame; ``mask``: the probability (256, 256), half precision, that a
    pixel of the region shows its person, if it was requested. Where nobody is, the network invents
    somebody.
    """

    keypoints_px: Float64Array
    keypoints_confidence: Float64Array
    world_landmarks: Float64Array
    presence: float
    region: Region
    next_region: Region
    mask: NDArray[np.float16] | None = None

    @property
    def spread(self) -> float:
        """Root mean square distance of the keypoints from their centre over the radius of the body
        circle.

        0.5..0.8 for people, less when they curl up; 0.1..0.35 for something else that the network
        mistakes for a body.
        """
        offsets = self.keypoints_px - self.keypoints_px.mean(axis=0)
        radius = self.region.side_px / (2 * MARGIN)
        return float(np.sqrt((offsets**2).sum(axis=1).mean()) / radius)

    @property
    def disagreement(self) -> float:
        """Inconsistency of the keypoints in the image and in space, relative to the keypoints'
        spread.

        min over s, t of ‖p − s·w_xy − t‖ / ‖p − mean(p)‖, by scaled orthographic projection of the
        world landmarks w. Below 0.15 for people; perspective adds some. 0 without world landmarks.
        """
        return (
            disagreement(self.keypoints_px, self.world_landmarks)
            if self.world_landmarks.any()
            else 0.0
        )


def disagreement(keypoints_px: Float64Array, world_landmarks: Float64Array) -> float:
    """Calculate how inconsistent keypoints in the image and in space are, see
    `PoseEstimate.disagreement`.

    :param keypoints_px: (n, 2) pixels.
    :param world_landmarks: (n, 3) metres in camera axes.
    :return: dimensionless; 0 for a perfect scaled orthographic projection.
    """
    image = keypoints_px - keypoints_px.mean(axis=0)
    space = world_landmarks[:, :2] - world_landmarks[:, :2].mean(axis=0)
    scale = (image * space).sum() / np.maximum((space**2).sum(), 1e-12)
    return float(np.linalg.norm(image - scale * space) / np.maximum(np.linalg.norm(image), 1e-12))


class EstimateMemory(Protocol):
    """Estimates by what the network was given, so that an earlier capture's are found again."""

    def key(self, network: str, crop_rgb: Uint8Array, region: Region) -> bytes:
        """Return the key of an estimate.

        :param crop_rgb: (H, W, 3), the network's input.
        """

    def find(self, key: bytes) -> Float64Array | None:
        """Return the values (m,) that were added with a key; None if there are none."""

    def add(self, key: bytes, values: Float64Array) -> None:
        """Keep the values (m,) of a key."""


class LandmarkNetwork:
    """A landmark network (``pose_landmark_lite``, ``_full`` or ``_heavy``); stateless between
    calls.

    Several regions are processed in parallel with half of the threads each, which is faster than
    sequentially with all threads: threads that share a region synchronize at every layer. A single
    region gets all threads only in the heavy network; in the small ones they would mostly wait for
    each other, and decoding needs a core.

    :raises SetupError: the network has not been built.
    :raises ModelFileError: its file is damaged.
    """

    def __init__(self, name: str, threads: int, execution: Execution | None = None) -> None:
        self._path = network_path(name)
        self._threads = threads
        self._execution = execution
        self._name = name
        # Where estimates without masks are looked for and put.
        self.memory: EstimateMemory | None = None
        self._threads_alone = threads if name in _WORTH_ALL_THREADS else max(1, threads // _WORKERS)
        self._pool = ThreadPoolExecutor(min(_WORKERS, threads), "scope-landmarks")
        self._sessions: dict[int, onnxruntime.InferenceSession] = {}
        # It is opened now, so that a damaged file is reported before the first frame.
        self._session(self._threads_alone)

    def _session(self, threads: int) -> onnxruntime.InferenceSession:
        if threads not in self._sessions:
            self._sessions[threads] = open_session(self._path, threads, self._execution)
        return self._sessions[threads]

    def estimate(
        self, image_rgb: Uint8Array, regions: Sequence[Region], with_masks: bool = False
    ) -> list[PoseEstimate]:
        """Estimate one pose per region of an (H, W, 3) uint8 RGB image."""
        if len(regions) < 2 or self._threads == 1:
            alone = self._session(self._threads_alone)
            return [self._estimate(alone, image_rgb, region, with_masks) for region in regions]
        return [
            pending.result()
            for pending in [self.begin(image_rgb, region, with_masks) for region in regions]
        ]

    def begin(
        self, image_rgb: Uint8Array, region: Region, with_mask: bool = False
    ) -> Future[PoseEstimate]:
        """Start the estimate of one region in another thread; the image (H, W, 3) must not change
        until it is done.
        """
        shared = self._session(max(1, self._threads // _WORKERS))
        return self._pool.submit(self._estimate, shared, image_rgb, region, with_mask)

    def mask(self, image_rgb: Uint8Array, region: Region) -> Float32Array:
        """Return the probability (256, 256) that a pixel of the region of an (H, W, 3) image shows
        its person.

        This is a run of its own; `estimate` and `begin` give the mask of the run that they make
        anyway.
        """
        (logits,) = self._session(self._threads_alone).run(
            ["mask"], {"input": image_input(region.cut(image_rgb, INPUT_SIZE))} | _WITH_MASK
        )
        return _probability(logits)

    def _estimate(
        self,
        session: onnxruntime.InferenceSession,
        image_rgb: Uint8Array,
        region: Region,
        with_mask: bool,
    ) -> PoseEstimate:
        crop_rgb = region.cut(image_rgb, INPUT_SIZE)
        memory = None if with_mask else self.memory
        if memory is not None:
            key = memory.key(self._name, crop_rgb, region)
            values = memory.find(key)
            if values is not None and len(values) == _VALUES:
                return _unpacked(values, region)
        outputs = [*_OUTPUTS, "mask"] if with_mask else _OUTPUTS
        inputs = {"input": image_input(crop_rgb)} | (_WITH_MASK if with_mask else {})
        landmarks, presence, heatmap, world, *logits = session.run(outputs, inputs)
        estimate = interpret(landmarks[0], float(presence[0, 0]), heatmap[0], world[0], region)
        if memory is not None:
            memory.add(key, _packed(estimate))
        if not with_mask:
            return estimate
        return replace(estimate, mask=_probability(logits[0]).astype(np.float16))


def _probability(logits: Float32Array) -> Float32Array:
    """Return the mask (256, 256) of the network's output (1, 1, 256, 256)."""
    return _sigmoid(logits[0, 0])


def _sigmoid(logits: FloatArray) -> FloatArray:
    return 1.0 / (1.0 + np.exp(-np.clip(logits, -50.0, 50.0)))


def _packed(estimate: PoseEstimate) -> Float64Array:
    """Return all numbers of an estimate (_VALUES,) but those of its region and mask."""
    after = estimate.next_region
    return np.concatenate(
        [
            estimate.keypoints_px.ravel(),
            estimate.keypoints_confidence,
            estimate.world_landmarks.ravel(),
            [estimate.presence, *after.center_px, after.side_px, after.rotation],
        ]
    )


def _unpacked(values: Float64Array, region: Region) -> PoseEstimate:
    """Return the estimate of which `_packed` made these values (_VALUES,)."""
    K = KEYPOINT_COUNT
    keypoints, confidence, world, others = np.split(values, np.cumsum([2 * K, K, 3 * K]))
    presence, x, y, side_px, rotation = others.tolist()
    after = Region((x, y), side_px, rotation)
    return PoseEstimate(
        keypoints.reshape(K, 2), confidence, world.reshape(K, 3), presence, region, after
    )


def interpret(
    landmarks: Float32Array,
    presence: float,
    heatmaps: Float32Array,
    world: Float32Array,
    region: Region,
) -> PoseEstimate:
    """Convert the network's raw outputs for one region to image and camera coordinates.

    :param landmarks: (195,): 39 × (x, y, z in crop pixels, visibility logit, in-frame logit).
    :param heatmaps: (39, 64, 64) logits.
    :param world: (117,): 39 × (x, y, z) metres in the crop's axes.
    """
    rows = landmarks.reshape(_POINTS, 5).astype(float)
    points_px = region.image_from_crop(refine(rows[:, :2] / INPUT_SIZE, heatmaps))
    visibility, in_frame = _sigmoid(rows[:KEYPOINT_COUNT, 3:].T)
    body = region.rotate_to_camera(world.reshape(_POINTS, 3)[:KEYPOINT_COUNT].astype(float))
    return PoseEstimate(
        keypoints_px=points_px[:KEYPOINT_COUNT],
        keypoints_confidence=visibility * in_frame,
        world_landmarks=body - body[HIPS].mean(axis=0),
        presence=presence,
        region=region,
        next_region=region_from_points(points_px[_HIP_CENTER], points_px[_BODY_CIRCLE]),
    )


def refine(points: Float64Array, heatmaps: Float32Array) -> Float64Array:
    """Move each point to the centroid of its heatmap within 7 × 7 cells around it.

    Points without a cell of at least 0.5 in this window stay. The network was trained with cell c
    at c / columns, not at its centre.

    :param points: (N, 2) crop coordinates, 0..1.
    :param heatmaps: (N, rows, columns) logits.
    :return: (N, 2) crop coordinates.
    """
    count, rows, columns = heatmaps.shape
    size = np.array([columns, rows])
    cell = np.floor(points * size).astype(int)
    inside = ((cell >= 0) & (cell < size)).all(axis=1)
    reach = np.arange(_WINDOW) - _WINDOW // 2
    x, y = np.where(inside, cell.T, 0)[:, :, None] + reach
    nearest_y = np.clip(y, 0, rows - 1)[:, :, None]
    nearest_x = np.clip(x, 0, columns - 1)[:, None]
    logits = heatmaps[np.arange(count)[:, None, None], nearest_y, nearest_x]
    heat = _sigmoid(logits.astype(float))
    heat *= ((y >= 0) & (y < rows))[:, :, None] & ((x >= 0) & (x < columns))[:, None]
    hot = inside & (heat.max(axis=(1, 2)) >= _HEAT_THRESHOLD)
    moments = np.stack(
        [(heat.sum(axis=1) * x).sum(axis=1), (heat.sum(axis=2) * y).sum(axis=1)], axis=1
    )
    centroid = moments / np.maximum(heat.sum(axis=(1, 2)), 1e-9)[:, None]
    return np.where(hot[:, None], centroid / size, points)
