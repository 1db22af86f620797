# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera's rotation during a clip, estimated from the background.

Corners of the background, those outside the people's regions, are followed from frame to frame
(Lucas-Kanade). For a camera that only rotates, their directions b in the current camera and a in an
earlier key frame satisfy b = R a at any distance. R is the least-squares rotation of the directions
that agree with it: two directions make a hypothesis, and the one with most support is refined.
Rotations are chained over key frames only, and a new key frame begins only where too few corners
are left, so that errors accumulate over few links. If the camera also travels, near corners
disagree, and the far ones decide, which are many; `heading_drift` removes the remaining error with
the edges of buildings.

Edges are detected in the first frame in which somebody is seen. Where the camera rotates, they are
detected anew; where it does not, only those are added that people hid so far: a door behind
somebody may be the only thing that tells which way is up.

Sources: Fischler and Bolles 1981 (random sample consensus), Kabsch 1976 (rotation between two sets
of directions).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from ...arrays import BoolArray, Float32Array, Float64Array, FloatArray, Uint8Array, unit_vectors
from ..perception.region import inside, surroundings
from .background_record import REVEALING_S, BackgroundRecord, best_rotation, is_rotated
from .bars import find_bars
from .corner_tracks import STEP_S, CornerFollower, background_mask, follow_corners
from .heading_drift import EDGE_INTERVAL_S, EDGE_SIDE_PX, FrameEdges
from .intrinsics import Camera
from .line_segments import find_segments

WORKING_SIDE_PX = 480  # the longer side of the image in which corners are followed
HYPOTHESES = 128  # of two directions each
MAX_CORNERS = 240
MIN_CORNERS = 24  # with fewer left, the next key frame begins
KEY_SHARE = 0.5  # of a key frame's corners, likewise
MIN_INLIERS = 12  # corners that a rotation must explain
QUALITIES = (0.01, 0.001)  # of a corner, relative to the best one; the second where few are found
# Of corners that agree, around their mean, over the longer side, where they are few or faint: those
# of the shadow that somebody casts on a plain wall have 0.1, those all over the picture 0.3.
MIN_SPREAD = 0.2
INLIER_PX = 1.2  # in the working image
MAX_RETURN_PX = 0.7  # between a corner and where it is found when it is followed back, likewise
MIN_INLIER_SHARE = 0.35  # of corners; a crowd or water that fills the picture gives no rotation
REVEALED_SHARE = 0.01  # of the image: how much must have come into view
CELLS = 40  # of the grid of hidden background, along either side of the image


class BackgroundTracker:
    """Follows the background through a clip; frames come in order, each with the people's
    positions.

    :param camera: the intrinsics of the full image.
    :param width, height: of the full image in pixels.
    """

    def __init__(self, camera: Camera, width: int, height: int) -> None:
        self._scale = WORKING_SIDE_PX / max(width, height)
        self._step = min(max(1, int(0.5 / self._scale)), width, height)
        self._size = (max(1, round(width * self._scale)), max(1, round(height * self._scale)))
        self._camera = camera
        self._tolerance = INLIER_PX / (self._scale * camera.intrinsics[0, 0])  # radians
        self._random = np.random.default_rng(0)
        self._times: list[float] = []
        self._rotations: list[Float64Array | None] = []
        self._last_used = -np.inf
        self._image: Uint8Array | None = None  # the working image
        self._points: Float32Array = np.zeros((0, 2), np.float32)  # in the working image
        self._key_rays: Float64Array = np.zeros((0, 3))
        self._key_count = 0
        self._is_faint = False  # whether corners of the second quality are followed
        self._R_first_key = np.eye(3)
        self._R_key_last = np.eye(3)
        self._inlier_shares: list[float] = []
        # The first one is the first frame in which somebody is seen.
        self.edge_frames: list[FrameEdges] = []
        self._hidden = HiddenBackground((width, height))
        self._corners = CornerFollower()
        self.bars: list[Float64Array] = []  # in that frame

    def add(
        self,
        image_rgb: Uint8Array,
        time_s: float,
        people: Sequence[NDArray[Any]],
        *,
        is_cut: bool = False,
        is_sampled: bool = False,
        is_shared: bool = False,
    ) -> None:
        """Process the next frame.

        :param image_rgb: (H, W, 3).
        :param people: (n, 2) points of each person in pixels: the background is outside their
            bounding boxes.
        :param is_cut: whether another scene begins, for which the camera's rotation is assumed
            unchanged.
        :param is_sampled: whether the rotation is to be estimated in this frame even if the last
            estimate is recent.
        :param is_shared: whether another window has the frame as well.
        """
        self._times.append(time_s)
        row = len(self._times) - 1
        if people and not self.edge_frames:
            self.bars = find_bars(image_rgb)
            self.edge_frames.append(
                FrameEdges(row, find_segments(image_rgb, people, bars=self.bars))
            )
            self._hidden.reveal(people)
        if time_s - self._last_used < STEP_S and not (is_cut or is_sampled):
            self._rotations.append(None)
            return
        self._last_used = time_s
        image = self._shrink(image_rgb)
        boxes = [self._box(surroundings(points)) for points in people] + [
            self._box(bar) for bar in self.bars
        ]
        self._corners.add(row, time_s, image, boxes, is_cut, is_shared)
        R_first_camera = self._rotation(image, boxes, is_cut)
        self._rotations.append(R_first_camera)
        if not self.edge_frames:
            return
        if R_first_camera is None:  # what is seen from now on may be something else
            self._hidden.reveal([])
        elif self._seconds_since(self.edge_frames[-1]) >= EDGE_INTERVAL_S:
            self._add_edges(image_rgb, people, R_first_camera)

    def record(self) -> BackgroundRecord:
        """Return what is known of the frames so far."""
        known = np.array([R is not None for R in self._rotations], bool)
        R = np.array([np.eye(3) if R is None else R for R in self._rotations]).reshape(-1, 3, 3)
        times = np.array(self._times)
        corners = self._corners.tracks(self._to_full)
        return BackgroundRecord(
            times, R, known, list(self._inlier_shares), list(self.edge_frames), self.bars, corners
        )

    def _seconds_since(self, edges: FrameEdges) -> float:
        return self._times[-1] - self._times[edges.row]

    def _reveal_edges(self, people: Sequence[NDArray[Any]]) -> bool:
        """Return whether people of the first edge frame have moved away from background that they
        hid in it, before a camera that has not rotated.

        Without anybody in the frame, somebody may have been missed.
        """
        if not people or self._seconds_since(self.edge_frames[0]) > REVEALING_S:
            return False
        return self._hidden.share_in_view(people) >= REVEALED_SHARE

    def _add_edges(
        self, image_rgb: Uint8Array, people: Sequence[NDArray[Any]], R_first_camera: Float64Array
    ) -> None:
        """Detect the last frame's edges that are new: all of a camera that has rotated, and
        otherwise those that people hid so far.
        """
        row = len(self._times) - 1
        if is_rotated(R_first_camera):
            segments = find_segments(image_rgb, people, EDGE_SIDE_PX, self.bars)
            self.edge_frames.append(FrameEdges(row, segments))
        elif self._reveal_edges(people):
            segments = find_segments(image_rgb, people, bars=self.bars)
            was_hidden = self._hidden.hides(segments.ends_px.mean(axis=1))
            self.edge_frames.append(FrameEdges(row, segments.where(was_hidden)))
            self._hidden.reveal(people)

    def _rotation(
        self, image: Uint8Array, boxes: Sequence[Float64Array], is_cut: bool
    ) -> Float64Array | None:
        """Return the rotation (3, 3) from the next working image's axes to those of the first, or
        None if it is unknown; begin a key frame where one is needed.
        """
        if self._image is None:
            self._begin_key(image, boxes)
            return np.eye(3)
        R_camera_key = None if is_cut else self._follow(image, boxes)
        # A cut, or too few corners: start again at the last known rotation.
        if R_camera_key is None:
            self._begin_key(image, boxes)
            return None
        self._R_key_last = R_camera_key.T
        R_first_camera = self._R_first_key @ self._R_key_last
        self._image = image
        if len(self._points) < max(KEY_SHARE * self._key_count, MIN_CORNERS):
            self._begin_key(image, boxes)
        return R_first_camera

    def _follow(self, image: Uint8Array, boxes: Sequence[Float64Array]) -> Float64Array | None:
        """Return the rotation (3, 3) from the key frame's axes to the current camera's, or None if
        it is unknown.
        """
        if len(self._points) < MIN_INLIERS:
            return None
        assert self._image is not None
        moved, good = follow_corners(self._image, image, self._points, boxes, MAX_RETURN_PX)
        self._points = moved[good]
        self._key_rays = self._key_rays[good]
        if len(self._points) < MIN_INLIERS:
            return None
        rays = self._rays(self._points)
        R, agree = consensus_rotation(self._key_rays, rays, self._tolerance, self._random)
        self._inlier_shares.append(float(agree.mean()))
        if agree.mean() < MIN_INLIER_SHARE or agree.sum() < MIN_INLIERS:
            return None
        is_sparse = self._is_faint or len(self._points) < MIN_CORNERS
        if is_sparse and spread(self._points[agree]) < MIN_SPREAD * WORKING_SIDE_PX:
            return None
        return R

    def _shrink(self, image_rgb: Uint8Array) -> Uint8Array:
        """Return the working image, grey; pixels are skipped before areas are averaged, which saves
        time.
        """
        columns = image_rgb.shape[1] // self._step
        rows = image_rgb.shape[0] // self._step
        whole = image_rgb[: rows * self._step, : columns * self._step]
        coarse = cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_NEAREST)
        grey = cv2.cvtColor(
            cv2.resize(coarse, self._size, interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2GRAY
        )
        return cast(Uint8Array, grey)

    def _begin_key(self, image: Uint8Array, boxes: Sequence[Float64Array]) -> None:
        """Begin the next key frame, at the last known rotation."""
        mask = background_mask(image, boxes)
        for quality in QUALITIES:
            corners = cv2.goodFeaturesToTrack(image, MAX_CORNERS, quality, 7, mask=mask)
            self._points = np.asarray([] if corners is None else corners, np.float32).reshape(-1, 2)
            self._is_faint = quality < QUALITIES[0]
            if len(self._points) >= MIN_CORNERS:
                break
        self._key_rays = self._rays(self._points)
        self._key_count = len(self._points)
        self._image = image
        self._R_first_key = self._R_first_key @ self._R_key_last
        self._R_key_last = np.eye(3)

    def _rays(self, points: Float32Array) -> Float64Array:
        """Return the (n, 3) unit directions, in camera axes, of points (n, 2) in the working
        image.
        """
        return unit_vectors(self._camera.rays(self._to_full(points)))

    def _to_full(self, points: Float32Array) -> Float32Array:
        """Return points (n, 2) of the working image in the full one; OpenCV scales areas, not
        pixels' centres.
        """
        return ((points + 0.5) / (self._scale * self._step) - 0.5) * self._step

    def _box(self, box_px: NDArray[Any]) -> Float64Array:
        """Return a box x0, y0, x1, y1 in the working image, with a margin."""
        return box_px * self._scale + [-4.0, -4.0, 4.0, 4.0]


def spread(points: Float32Array) -> float:
    """Return the root mean square distance of points (n, 2) from their mean."""
    return float(np.sqrt(points.var(axis=0).sum()))


def consensus_rotation(
    a: Float64Array, b: Float64Array, tolerance: float, random: np.random.Generator
) -> tuple[Float64Array, BoolArray]:
    """Find the rotation R with b = R a that most directions agree with.

    :param a: (n, 3) unit vectors, n at least 2.
    :param b: (n, 3) unit vectors.
    :param tolerance: radians.
    :return: R (3, 3), and (n,) whether each pair agrees with it.
    """
    pairs = random.integers(0, len(a), (HYPOTHESES, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    R = best_rotation(np.swapaxes(b[pairs], 1, 2) @ a[pairs])
    # |R a − b|² = 2 − 2 bᵀ R a, for all hypotheses and directions in one matrix product
    near = (
        R.reshape(-1, 9) @ (b[:, :, None] * a[:, None]).reshape(-1, 9).T > 1.0 - 0.5 * tolerance**2
    )
    best = R[int(near.sum(1).argmax())]
    agree = np.linalg.norm(a @ best.T - b, axis=1) < tolerance
    for _ in range(3):
        if agree.sum() < 2:
            break
        best = best_rotation(b[agree].T @ a[agree])
        agree = np.linalg.norm(a @ best.T - b, axis=1) < tolerance
    return best, agree


class HiddenBackground:
    """Which part of a static camera's background people have hidden in all frames so far: a grid,
    at first all hidden.

    :param size: of the image, width and height in pixels.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self._cell_px = np.array(size) / CELLS
        x, y = np.meshgrid(np.arange(CELLS), np.arange(CELLS))
        self._centers = (np.stack([x, y], axis=-1).reshape(-1, 2) + 0.5) * self._cell_px - 0.5
        self._hidden = np.ones(CELLS * CELLS, bool)

    def reveal(self, people: Sequence[NDArray[Any]]) -> None:
        """Add a frame with people at these points (n, 2) each, in pixels: what they do not hide has
        been seen.
        """
        self._hidden &= self._covered(people)

    def share_in_view(self, people: Sequence[NDArray[Any]]) -> float:
        """Return the share of the image that was hidden so far and is not hidden by people at these
        points (n, 2).
        """
        return float((self._hidden & ~self._covered(people)).mean())

    def hides(self, points: FloatArray) -> BoolArray:
        """Return (n,) whether each point (n, 2) of the image, in pixels, was hidden so far."""
        column, row = (
            np.clip((points + 0.5) / self._cell_px, 0, CELLS - 1).astype(int).reshape(-1, 2).T
        )
        return self._hidden[row * CELLS + column]

    def _covered(self, people: Sequence[NDArray[Any]]) -> BoolArray:
        """Return whether each cell is wholly behind one of the people."""
        margin = 0.5 * np.concatenate([self._cell_px, -self._cell_px])
        return inside(self._centers, [surroundings(points) + margin for points in people])
