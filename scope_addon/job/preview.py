# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture that the panel shows while a capture runs: the current frame, small, with the solved body over it.

Until the solver and the rasterizer are ready, and where no body is found, the found skeleton is drawn instead.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from types import TracebackType

import cv2
import numpy as np

from ..atomic_write import atomic_path
from ..capture.camera.intrinsics import scaled_intrinsics
from ..capture.fitting.live_body import LiveBody, LivePose
from ..capture.media.video import Frame
from ..capture.overlay.overlay_video import body_colors, draw_overlay
from ..capture.perception.landmark_network import KEYPOINT_NAMES
from ..capture.tracking.tracker import Observation

_LOG = logging.getLogger(__name__)

LONGER_SIDE = 256  # pixels; Blender keeps such pictures no larger
INTERVAL_S = 0.3
FILE = "preview.rgba"
OPACITY = 0.75
_SUPERSAMPLE = 2  # lines and bodies are drawn in a picture twice as large, so that they come out smooth

_LEFT, _RIGHT, _MIDDLE = (255, 140, 40), (40, 150, 255), (235, 235, 235)
_LIMBS = ("shoulder elbow", "elbow wrist", "wrist index", "shoulder hip", "hip knee", "knee ankle", "ankle foot_index")
_LINES = [("left_shoulder", "right_shoulder", _MIDDLE), ("left_hip", "right_hip", _MIDDLE)]
for _side, _color in (("left", _LEFT), ("right", _RIGHT)):
    _LINES += [(f"{_side}_{a}", f"{_side}_{b}", _color) for a, b in map(str.split, _LIMBS)]


class PreviewWriter:
    """Writes the preview now and then, and tells of it: ``send("preview", file, width, height, frame)``.

    The file holds RGBA bytes, the lowest row first, as Blender wants them. Fitting, drawing and writing happen in
    threads of their own, beside the networks; while that is busy, frames are passed over. Leaving it removes the file.
    """

    def __init__(self, folder: Path, send: Callable[..., None]) -> None:
        self._path, self._send = folder / FILE, send
        self._last = -np.inf
        self._pool = ThreadPoolExecutor(2, "scope-preview")
        self._rasterizer = self._pool.submit(_load_rasterizer)
        self._drawing: Future[None] | None = None
        self._open, self._writing = True, threading.Lock()

    def __enter__(self) -> PreviewWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        with self._writing:
            self._open = False
            with suppress(OSError):  # Windows, while the other side reads: it goes with its folder, or is kept there
                self._path.unlink(missing_ok=True)
        self._pool.shutdown(wait=False, cancel_futures=True)

    def __call__(self, frame: Frame, observation: Observation | None, live: LiveBody) -> None:
        """As ``capture`` calls it, with every frame."""
        now = time.monotonic()
        if now - self._last < INTERVAL_S or (self._drawing is not None and not self._drawing.done()):
            return
        self._last = now
        self._drawing = self._pool.submit(self._show, frame, observation, live)

    def _show(self, frame: Frame, observation: Observation | None, live: LiveBody) -> None:
        # On a new machine the rasterizer compiles for a while, and pictures do not wait for it.
        pose = _pose(observation, live) if self._rasterizer.done() else None
        picture = draw(frame.image_rgb, observation, pose)
        height, width = picture.shape[:2]
        with self._writing:
            if not self._open:
                return
            try:
                with atomic_path(self._path) as temporary:
                    temporary.write_bytes(picture[::-1].tobytes())
            except OSError:
                return  # a full disk, or Windows while the other side reads: a capture does not fail for its picture
            self._send("preview", file=FILE, width=width, height=height, frame=frame.index)


def _load_rasterizer() -> None:
    corners = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
    draw_overlay(np.zeros((8, 8, 3), np.uint8), corners, np.array([[0, 1, 2]]), np.diag([4.0, 4.0, 1.0]), np.zeros(5))


def _pose(observation: Observation | None, live: LiveBody) -> LivePose | None:
    if observation is None or not live.is_ready:
        return None
    try:
        return live.fit(observation)
    except Exception:  # a defect there shows in the log, and costs the preview its body, not its picture
        _LOG.warning("the preview goes without the body", exc_info=True)
        return None


def draw(image_rgb: np.ndarray, observation: Observation | None, pose: LivePose | None = None) -> np.ndarray:
    """The frame scaled down, with the body or else the skeleton: (h, w, 4) uint8 RGBA."""
    height, width = image_rgb.shape[:2]
    scale = LONGER_SIDE / max(height, width)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    large = cv2.resize(image_rgb, (size[0] * _SUPERSAMPLE, size[1] * _SUPERSAMPLE), interpolation=cv2.INTER_AREA)
    if pose is not None:
        large = _with_body(large, pose, scale * _SUPERSAMPLE)
    elif observation is not None:
        _draw_skeleton(large, observation, scale * _SUPERSAMPLE)
    return cv2.cvtColor(cv2.resize(large, size, interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2RGBA)


def _with_body(image: np.ndarray, pose: LivePose, scale: float) -> np.ndarray:
    intrinsics, colors = scaled_intrinsics(pose.camera.intrinsics, scale), body_colors(pose.body, 0)
    return draw_overlay(image, pose.vertices_cam, pose.body.faces, intrinsics, pose.camera.dist, colors, OPACITY)


def _draw_skeleton(image: np.ndarray, observation: Observation, scale: float) -> None:
    pixels = np.round((observation.keypoints_px + 0.5) * scale).astype(int)
    for a, b, color in _LINES:
        i, j = KEYPOINT_NAMES.index(a), KEYPOINT_NAMES.index(b)
        if min(observation.keypoints_confidence[[i, j]]) > 0.3:
            cv2.line(image, pixels[i].tolist(), pixels[j].tolist(), color, 2 * _SUPERSAMPLE, cv2.LINE_AA)
