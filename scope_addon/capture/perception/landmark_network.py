# SPDX-License-Identifier: GPL-3.0-or-later
"""BlazePose's landmark network: a region of the image to 33 keypoints in the image and in space."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from ....solver.names import BLAZEPOSE
from .execution import Execution
from .region import MARGIN, Region, region_from_points
from .sessions import network_path, open_session

if TYPE_CHECKING:
    import onnxruntime

INPUT_SIZE = 256
KEYPOINT_NAMES = BLAZEPOSE  # the network's order
KEYPOINT_COUNT = 33
_POINTS = 39  # the keypoints, two auxiliary points, four that are not used
_HIP_CENTER, _BODY_CIRCLE = 33, 34  # auxiliary points: middle of the hips; on the circle about it that holds the body
_HIPS = (23, 24)
_WINDOW = 7  # cells of the heatmap that refine one keypoint
_HEAT_THRESHOLD = 0.5
_WORKERS = 2  # regions looked at in parallel
_WORTH_ALL_THREADS = ("pose_landmark_heavy",)
_OUTPUTS = ["landmarks", "presence", "heatmap", "world"]


@dataclass(frozen=True)
class PoseEstimate:
    """What the network says about one region.

    ``keypoints_px`` (33, 2) image pixels; ``visibility``, ``in_frame`` (33,) probabilities that a keypoint is seen
    and that it lies inside the picture; ``world_landmarks`` (33, 3) metres in camera axes (x right, y down,
    z forward), the middle of the hips at 0, or all 0 from a network that knows nothing of depth; ``presence``:
    probability that there is a person at all; ``region``: where it looked; ``next_region``: where to look in the next
    frame.
    """

    keypoints_px: np.ndarray
    visibility: np.ndarray
    in_frame: np.ndarray
    world_landmarks: np.ndarray
    presence: float
    region: Region
    next_region: Region

    @property
    def keypoints_confidence(self) -> np.ndarray:
        """(33,) probability that a keypoint is in the picture and seen there."""
        return self.visibility * self.in_frame

    @property
    def spread(self) -> float:
        """Root mean square distance of the keypoints from their centre over the radius of the body circle.

        0.5..0.8 for people, less when they curl up; 0.1..0.35 where the network imagines a body in something else.
        """
        offsets = self.keypoints_px - self.keypoints_px.mean(axis=0)
        radius = self.region.side_px / (2 * MARGIN)
        return float(np.sqrt((offsets**2).sum(axis=1).mean()) / radius)

    @property
    def disagreement(self) -> float:
        """How far the keypoints in the image and in space contradict each other, relative to the keypoints' spread.

        min over s, t of ‖p − s·w_xy − t‖ / ‖p − mean(p)‖: a scaled orthographic view of the world landmarks w. Below
        0.15 for people; perspective adds some. 0 where the world landmarks are not known.
        """
        return disagreement(self.keypoints_px, self.world_landmarks) if self.world_landmarks.any() else 0.0


def disagreement(keypoints_px: np.ndarray, world_landmarks: np.ndarray) -> float:
    """How far keypoints (n, 2) are from a scaled orthographic view of (n, 3), see `PoseEstimate.disagreement`."""
    image = keypoints_px - keypoints_px.mean(axis=0)
    space = world_landmarks[:, :2] - world_landmarks[:, :2].mean(axis=0)
    scale = (image * space).sum() / np.maximum((space**2).sum(), 1e-12)
    return float(np.linalg.norm(image - scale * space) / np.maximum(np.linalg.norm(image), 1e-12))


class LandmarkNetwork:
    """A landmark network (``pose_landmark_lite``, ``_full`` or ``_heavy``) on the CPU; keeps nothing between calls.

    Several regions are looked at in parallel with one half of the threads each, which takes less time than one after
    the other with all: threads that share a region wait for each other at every layer. A region alone gets all threads
    of the strong network; those of the small ones would wait for as long as they work, and decoding needs a core.
    """

    def __init__(
        self, name: str, threads: int, folder: Path | None = None, execution: Execution | None = None
    ) -> None:
        self._path, self._threads, self._execution = network_path(name, folder), threads, execution
        self._threads_alone = threads if name in _WORTH_ALL_THREADS else max(1, threads // _WORKERS)
        self._pool = ThreadPoolExecutor(min(_WORKERS, threads), "scope-landmarks")
        self._sessions: dict[int, onnxruntime.InferenceSession] = {}
        self._session(self._threads_alone)  # opened now, so that a bad file is told before the first frame

    def _session(self, threads: int) -> onnxruntime.InferenceSession:
        if threads not in self._sessions:
            self._sessions[threads] = open_session(self._path, threads, self._execution)
        return self._sessions[threads]

    @property
    def _alone(self) -> onnxruntime.InferenceSession:
        return self._session(self._threads_alone)

    @property
    def _shared(self) -> onnxruntime.InferenceSession:
        return self._session(max(1, self._threads // _WORKERS))

    def estimate(self, image_rgb: np.ndarray, regions: Sequence[Region]) -> list[PoseEstimate]:
        """One estimate per region of an (H, W, 3) uint8 image."""
        if len(regions) < 2 or self._threads == 1:
            return [self._estimate(self._alone, image_rgb, region) for region in regions]
        return [look.result() for look in [self.begin(image_rgb, region) for region in regions]]

    def begin(self, image_rgb: np.ndarray, region: Region) -> Future[PoseEstimate]:
        """Look at one region while the caller does something else; the image must stay as it is until then."""
        return self._pool.submit(self._estimate, self._shared, image_rgb, region)

    @staticmethod
    def _estimate(session: onnxruntime.InferenceSession, image_rgb: np.ndarray, region: Region) -> PoseEstimate:
        blob = cv2.dnn.blobFromImage(region.cut(image_rgb, INPUT_SIZE), 1 / 255.0)
        landmarks, presence, heatmap, world = session.run(_OUTPUTS, {"input": blob})
        return interpret(landmarks[0], float(presence[0, 0]), heatmap[0], world[0], region)


def interpret(
    landmarks: np.ndarray, presence: float, heatmaps: np.ndarray, world: np.ndarray, region: Region
) -> PoseEstimate:
    """The raw outputs of one region in image and camera coordinates.

    ``landmarks`` (195,): 39 × (x, y, z in crop pixels, visibility logit, in-frame logit); ``heatmaps`` (39, 64, 64)
    logits; ``world`` (117,): 39 × (x, y, z) metres in the crop's axes.
    """
    rows = landmarks.reshape(_POINTS, 5).astype(float)
    points_px = region.image_from_crop(refine(rows[:, :2] / INPUT_SIZE, heatmaps))
    visibility, in_frame = 1.0 / (1.0 + np.exp(-np.clip(rows[:KEYPOINT_COUNT, 3:].T, -50.0, 50.0)))
    body = region.rotate_to_camera(world.reshape(_POINTS, 3)[:KEYPOINT_COUNT].astype(float))
    return PoseEstimate(
        keypoints_px=points_px[:KEYPOINT_COUNT],
        visibility=visibility,
        in_frame=in_frame,
        world_landmarks=body - body[_HIPS, :].mean(axis=0),
        presence=presence,
        region=region,
        next_region=region_from_points(points_px[_HIP_CENTER], points_px[_BODY_CIRCLE]),
    )


def refine(points: np.ndarray, heatmaps: np.ndarray) -> np.ndarray:
    """Move each crop point (N, 2) to the centroid of its heatmap (N, rows, columns; logits), 7 × 7 cells about it.

    Only where a cell there is hotter than 0.5. The network was trained for cell c at c / columns, not at its middle.
    """
    count, rows, columns = heatmaps.shape
    size = np.array([columns, rows])
    cell = np.floor(points * size).astype(int)
    inside = ((cell >= 0) & (cell < size)).all(axis=1)
    reach = np.arange(_WINDOW) - _WINDOW // 2
    x, y = np.where(inside, cell.T, 0)[:, :, None] + reach
    nearest_y, nearest_x = np.clip(y, 0, rows - 1)[:, :, None], np.clip(x, 0, columns - 1)[:, None]
    logits = heatmaps[np.arange(count)[:, None, None], nearest_y, nearest_x]
    heat = 1.0 / (1.0 + np.exp(-np.clip(logits.astype(float), -50.0, 50.0)))
    heat *= ((y >= 0) & (y < rows))[:, :, None] & ((x >= 0) & (x < columns))[:, None]
    hot = inside & (heat.max(axis=(1, 2)) >= _HEAT_THRESHOLD)
    moments = np.stack([(heat.sum(axis=1) * x).sum(axis=1), (heat.sum(axis=2) * y).sum(axis=1)], axis=1)
    centroid = moments / np.maximum(heat.sum(axis=(1, 2)), 1e-9)[:, None]
    return np.where(hot[:, None], centroid / size, points)
