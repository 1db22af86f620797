# SPDX-License-Identifier: GPL-3.0-or-later
"""A small picture of a posed skeleton, drawn with numpy alone, so that no window and no renderer is
needed.

Every bone is a capsule, shaded as if it was lit from the upper left. The view is level, and shows
the widest side of the pose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_FINER = 2  # drawn at this multiple of the size, then averaged
_MARGIN = 0.08  # of the size
_LIGHT = np.array([-0.45, 0.6, 0.66])  # unit vector towards the light: right, up, to the viewer
_AMBIENT = 0.4


def skeleton_picture(
    heads: NDArray[np.float64],
    tails: NDArray[np.float64],
    radii: NDArray[np.float64],
    colors: NDArray[np.float64],
    size: int = 256,
) -> NDArray[np.float32]:
    """Draw bones as capsules on a transparent background.

    :param heads: (B, 3) metres, z up.
    :param tails: (B, 3) metres.
    :param radii: (B,) metres.
    :param colors: (B, 3) display-referred red, green, blue, 0 to 1.
    :param size: width and height in pixels.
    :return: (size, size, 4) red, green, blue, alpha, not premultiplied; the first row is the lowest
        one.
    """
    fine = _FINER * size
    a, b, r = _on_screen(heads, tails, radii, fine)
    depth = np.full((fine, fine), -np.inf)
    picture = np.zeros((fine, fine, 4))
    for start, end, radius, color in zip(a, b, r, colors, strict=True):
        _draw_capsule(picture, depth, (start, end, float(radius)), color)
    blocks = picture.reshape(size, _FINER, size, _FINER, 4)
    alpha = blocks[..., 3].mean(axis=(1, 3))
    color = (blocks[..., :3] * blocks[..., 3:]).mean(axis=(1, 3)) / np.maximum(alpha, 1e-6)[
        ..., None
    ]
    out: NDArray[np.float32] = np.concatenate(
        [np.clip(color, 0.0, 1.0), alpha[..., None]], axis=2
    ).astype(np.float32)
    return out


def _on_screen(
    heads: NDArray[np.float64], tails: NDArray[np.float64], radii: NDArray[np.float64], size: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return heads and tails (B, 3) in pixels right, up and towards the viewer, and radii (B,) in
    pixels.
    """
    points = np.concatenate([heads, tails])
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    # the horizontal direction in which the pose is widest
    right = np.linalg.eigh(flat.T @ flat)[1][:, -1]
    right *= 1.0 if right[np.abs(right).argmax()] > 0 else -1.0
    axes = np.array([[*right, 0.0], [0.0, 0.0, 1.0], [right[1], -right[0], 0.0]])
    seen = points @ axes.T
    twice = np.concatenate([radii, radii])[:, None]
    low = (seen[:, :2] - twice).min(axis=0)
    high = (seen[:, :2] + twice).max(axis=0)
    scale = (1.0 - 2.0 * _MARGIN) * size / max(float((high - low).max()), 1e-6)
    seen[:, :2] -= 0.5 * (low + high)
    seen *= scale
    seen[:, :2] += 0.5 * size
    return seen[: len(heads)], seen[len(heads) :], radii * scale


def _draw_capsule(
    picture: NDArray[np.float64],
    depth: NDArray[np.float64],
    capsule: tuple[NDArray[np.float64], NDArray[np.float64], float],
    color: NDArray[np.float64],
) -> None:
    """Draw where the capsule is nearer to the viewer than what is there.

    :param picture: (S, S, 4), changed.
    :param depth: (S, S) towards the viewer, changed.
    :param capsule: ends (3,) and radius in pixels.
    """
    start, end, radius = capsule
    size = len(depth)
    low = np.clip(np.floor(np.minimum(start, end)[:2] - radius), 0, size).astype(int)
    high = np.clip(np.ceil(np.maximum(start, end)[:2] + radius) + 1, 0, size).astype(int)
    x, y = np.meshgrid(np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5)
    along = (end - start)[:2]
    share = ((x - start[0]) * along[0] + (y - start[1]) * along[1]) / max(
        float(along @ along), 1e-9
    )
    share = np.clip(share, 0.0, 1.0)
    dx = x - start[0] - share * along[0]
    dy = y - start[1] - share * along[1]
    inside = dx**2 + dy**2 < radius**2
    height = np.sqrt(np.maximum(radius**2 - dx**2 - dy**2, 0.0))
    z = start[2] + share * (end[2] - start[2]) + height
    rows = slice(low[1], high[1])
    columns = slice(low[0], high[0])
    nearer = inside & (z > depth[rows, columns])
    light = np.maximum(
        (dx * _LIGHT[0] + dy * _LIGHT[1] + height * _LIGHT[2]) / max(radius, 1e-9), 0.0
    )
    shaded = np.clip((_AMBIENT + (1.0 - _AMBIENT) * light)[..., None] * color, 0.0, 1.0)
    picture[rows, columns][nearer] = np.concatenate([shaded, np.ones((*light.shape, 1))], axis=2)[
        nearer
    ]
    depth[rows, columns][nearer] = z[nearer]
