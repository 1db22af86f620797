# SPDX-License-Identifier: GPL-3.0-or-later
"""The sample clip's footage with the body over it: the one clip whose pixels are ours to show."""

from __future__ import annotations

import cv2
import numpy as np

from ...scope_addon.capture.media.video import open_video
from ...scope_addon.capture.overlay.overlay_video import camera_vertices, draw_overlay
from ...scope_addon.motion import Motion
from .clips import SAMPLE, default_body
from .panel import FINER, OURS

_TALL = 446  # pixels of the footage that fill the picture's height
_OPACITY = 0.72


def sample_with_body(motion: Motion, row: int, size: tuple[int, int]) -> np.ndarray:
    """(H, W, 3) RGB: a frame of the sample clip, cropped to the person."""
    with open_video(SAMPLE) as video:
        image = next(frame.image_rgb for frame in video if frame.index == motion.frames[row])
    body, vertices = default_body(), camera_vertices(motion, default_body(), row)
    pixels = vertices / vertices[:, 2:] @ motion.intrinsics.T
    scale = FINER * size[1] / _TALL
    left, top = pixels[:, 0].mean() * scale - FINER * size[0] / 2, (image.shape[0] - _TALL) * scale
    crop = np.array([[scale, 0, -left], [0, scale, -top], [0, 0, 1.0]])
    wide = (FINER * size[0], FINER * size[1])
    larger = cv2.warpAffine(image, crop[:2], wide, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    drawn = draw_overlay(
        larger, vertices, body.faces, crop @ motion.intrinsics, colors=np.array(OURS), opacity=_OPACITY
    )
    return cv2.resize(drawn, size, interpolation=cv2.INTER_AREA)
