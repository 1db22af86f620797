# SPDX-License-Identifier: GPL-3.0-or-later
"""The preview that the panel shows during a capture: the current frame, scaled down, with the
fitted bodies over it.

Until the solver and the rasterizer are compiled, and where no body could be fitted, the keypoints'
skeletons are drawn.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from ..arrays import Uint8Array
from ..atomic_write import atomic_path
from ..capture.camera.intrinsics import scaled_intrinsics
from ..capture.fitting.live_body import LiveBody, LivePose
from ..capture.media.frame import Frame
from ..capture.overlay_video import body_colors, draw_overlay, tint
from ..capture.perception.landmark_network import KEYPOINT_NAMES
from ..capture.perception.observation import Observation
from ..footage_view import scaled_size
from ..temporary import remove

_LOG = logging.getLogger(__name__)

LONGER_SIDE = 256  # pixels; Blender stores no larger previews
INTERVAL_S = 0.3
FILE = "preview.rgba"
OPACITY = 0.75
_SUPERSAMPLE = 2  # scale at which lines and bodies are drawn, for antialiasing

_LEFT = (255, 140, 40)
_RIGHT = (40, 150, 255)
_MIDDLE = (235, 235, 235)
_LIMBS = (
    "shoulder elbow",
    "elbow wrist",
    "wrist index",
    "shoulder hip",
    "hip knee",
    "knee ankle",
    "ankle foot_index",
)
_LINES = [("left_shoulder", "right_shoulder", _MIDDLE), ("left_hip", "right_hip", _MIDDLE)]
for _side, _color in (("left", _LEFT), ("right", _RIGHT)):
    _LINES += [(f"{_side}_{a}", f"{_side}_{b}", _color) for a, b in map(str.split, _LIMBS)]


class PreviewWriter:
    """Write the preview at intervals, and report it: ``send("preview", file, width, height,
    frame)``.

    The file contains RGBA bytes, bottom row first, as Blender expects. Fitting, drawing and writing
    run in separate threads, in parallel with the networks; frames that arrive while these are busy
    are skipped. On exit from the context, the file is removed.
    """

    def __init__(self, folder: Path, send: Callable[..., None]) -> None:
        self._path = folder / FILE
        self._send = send
        self._last = -np.inf
        self._pool = ThreadPoolExecutor(2, "scope-preview")
        self._rasterizer = self._pool.submit(load_rasterizer)
        self._drawing: Future[None] | None = None
        self._open = True
        self._writing = threading.Lock()

    def __enter__(self) -> PreviewWriter:
        return self

    def __exit__(self, *_: object) -> None:
        with self._writing:
            self._open = False
            remove(self._path)  # unless the parent reads it, on Windows: it stays in its folder
        self._pool.shutdown(wait=False, cancel_futures=True)

    def __call__(self, frame: Frame, people: Sequence[Observation], live: LiveBody) -> None:
        """Write the preview of a frame, unless it is too early or the previous one is not
        finished.
        """
        now = time.monotonic()
        if now - self._last < INTERVAL_S or (
            self._drawing is not None and not self._drawing.done()
        ):
            return
        self._last = now
        self._drawing = self._pool.submit(self._show, frame, people, live)

    def _show(self, frame: Frame, people: Sequence[Observation], live: LiveBody) -> None:
        # After installation the rasterizer takes a while to compile; the preview does not wait for
        # it.
        is_compiled = self._rasterizer.done()
        poses = [_pose(person, live) if is_compiled else None for person in people]
        picture = draw(frame.image_rgb, people, poses)
        height, width = picture.shape[:2]
        with self._writing:
            if not self._open:
                return
            try:
                with atomic_path(self._path, durable=False) as temporary:
                    temporary.write_bytes(picture[::-1].tobytes())
            except OSError:
                # disk full, or Windows while the parent reads it: a capture must not fail for its
                # preview
                return
            self._send("preview", file=FILE, width=width, height=height, frame=frame.index)


def load_rasterizer() -> None:
    """Compile the rasterizer by drawing a triangle."""
    corners = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
    draw_overlay(
        np.zeros((8, 8, 3), np.uint8),
        [corners],
        np.array([[0, 1, 2]]),
        np.diag([4.0, 4.0, 1.0]),
        np.zeros(5),
        [tint(0)],
        [1.0],
    )


def _pose(observation: Observation, live: LiveBody) -> LivePose | None:
    if not live.is_ready:
        return None
    try:
        return live.fit(observation)
    except Exception:  # a defect is logged, and the preview shows the skeleton instead of the body
        _LOG.warning("the preview is drawn without the body", exc_info=True)
        return None


def draw(
    image_rgb: Uint8Array,
    people: Sequence[Observation],
    poses: Sequence[LivePose | None] = (),
) -> Uint8Array:
    """Draw everybody's body, or else skeleton, over a frame that is scaled down to ``LONGER_SIDE``.

    :param image_rgb: (H, W, 3) the frame.
    :param people: the largest first, who is drawn last, over the others.
    :param poses: of the people; none, or None where no body could be fitted.
    :return: (h, w, 4) RGBA.
    """
    height, width = image_rgb.shape[:2]
    scale, size = scaled_size(width, height, LONGER_SIDE)
    large_size = size[0] * _SUPERSAMPLE, size[1] * _SUPERSAMPLE
    large: NDArray[Any] = cv2.resize(image_rgb, large_size, interpolation=cv2.INTER_AREA)
    for person, pose in reversed([*zip(people, poses or [None] * len(people), strict=True)]):
        if pose is not None:
            large = _with_body(large, pose, scale * _SUPERSAMPLE)
        else:
            _draw_skeleton(large, person, scale * _SUPERSAMPLE)
    small = cv2.resize(large, size, interpolation=cv2.INTER_AREA)
    return cast(Uint8Array, cv2.cvtColor(small, cv2.COLOR_RGB2RGBA))


def _with_body(image: Uint8Array, pose: LivePose, scale: float) -> Uint8Array:
    intrinsics = scaled_intrinsics(pose.camera.intrinsics, scale)
    colors = body_colors(pose.body, 0)
    return draw_overlay(
        image,
        [pose.vertices_cam],
        pose.body.faces,
        intrinsics,
        pose.camera.dist,
        [colors],
        [OPACITY],
    )


def _draw_skeleton(image: Uint8Array, observation: Observation, scale: float) -> None:
    """Draw the limbs between confident keypoints into the image, in place."""
    pixels = np.round((observation.keypoints_px + 0.5) * scale).astype(int)
    for a, b, color in _LINES:
        i = KEYPOINT_NAMES.index(a)
        j = KEYPOINT_NAMES.index(b)
        if min(observation.keypoints_confidence[[i, j]]) > 0.3:
            cv2.line(
                image, pixels[i].tolist(), pixels[j].tolist(), color, 2 * _SUPERSAMPLE, cv2.LINE_AA
            )
