# SPDX-License-Identifier: GPL-3.0-or-later
"""The sample clip's footage with the body over it: the one clip whose pixels may be shown."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.media.video import open_video
from ...scope_addon.capture.overlay_video import camera_vertices, draw_overlay
from ...scope_addon.motion import Motion
from ...solver import Body
from .clips import SAMPLE, default_body
from .panel import FINER, OURS
from .shapes import colors_with_face, posed_in_camera

_TALL = 446  # pixels of the footage that fill the picture's height
_OPACITY = 0.72


def sample_with_body(motion: Motion, row: int, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return (H, W, 3) RGB: a frame of the sample clip with the body, cropped to the person."""
    with open_video(SAMPLE) as video:
        image = next(frame.image_rgb for frame in video if frame.index == motion.frames[row])
    vertices = camera_vertices(motion, default_body(), row)
    pixels = vertices / vertices[:, 2:] @ motion.intrinsics.T
    left = pixels[:, 0].mean() - _TALL * size[0] / size[1] / 2
    return cropped(image, (left, image.shape[0] - _TALL), _TALL, size, motion, row)


def cropped(
    image: NDArray[np.uint8],
    corner: tuple[float, float],
    height: float,
    size: tuple[int, int],
    motion: Motion | None = None,
    row: int = 0,
    body: Body | None = None,
) -> NDArray[np.uint8]:
    """Return (H, W, 3) RGB: a part of a frame, with the body over it where a motion is given.

    :param corner: upper left corner of the part, pixels of the frame.
    :param height: of the part, pixels of the frame.
    :param size: (width, height) of the result, pixels.
    :param body: of the motion, whose eyes and mouth have their own colours; the default body if
        left out.
    """
    scale = FINER * size[1] / height
    crop = np.array([[scale, 0, -corner[0] * scale], [0, scale, -corner[1] * scale], [0, 0, 1.0]])
    wide = (FINER * size[0], FINER * size[1])
    enlarged = cv2.warpAffine(
        image, crop[:2], wide, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE
    )
    larger = np.asarray(enlarged, np.uint8)
    if motion is not None:
        colors = np.array(OURS) if body is None else colors_with_face(body, OURS)
        body = body or default_body()
        vertices = posed_in_camera(motion, body, row)
        K = crop @ motion.intrinsics
        larger = draw_overlay(larger, [vertices], body.faces, K, None, [colors], [_OPACITY])
    return cv2.resize(larger, size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
