# SPDX-License-Identifier: GPL-3.0-or-later
"""The colours of a person's clothes as histograms: they identify people where position and motion
do not.
"""

from __future__ import annotations

import cv2
import numpy as np

from ...arrays import Float64Array, FloatArray, Uint8Array
from ..perception.landmark_network import LEGS, TRUNK

# The outline of the torso is background as often as not.
_TORSO_FRACTIONS = np.linspace(0.15, 0.85, 9)
_LEG_FRACTIONS = np.linspace(0.1, 0.9, 12)
_MIN_PIXELS = 6  # of a part; fewer give no histogram
_HUES = 12
_GREYS = 6
SIZE = 2 * (_HUES + _GREYS)


def appearance(image_rgb: Uint8Array, keypoints_px: FloatArray) -> Float64Array:
    """Sample the colours of the torso and the legs.

    A pixel is counted in the bin of its hue with the weight c = saturation · √value, and in the bin
    of its grey level with the weight 1 − c. Compare two appearances with `distance`.

    :param image_rgb: (H, W, 3).
    :param keypoints_px: (33, 2) pixels.
    :return: (36,) square roots of two normalized histograms, torso and legs, each of 12 hues and 6
        grey levels; zeros for a part that is outside the image.
    """
    left_top, right_top, left_low, right_low = keypoints_px[TRUNK]
    across, down = np.meshgrid(_TORSO_FRACTIONS, _TORSO_FRACTIONS)
    top = left_top + across[..., None] * (right_top - left_top)
    low = left_low + across[..., None] * (right_low - left_low)
    torso = (top + down[..., None] * (low - top)).reshape(-1, 2)
    legs = []
    for hip, knee, ankle in LEGS:
        for a, b in ((hip, knee), (knee, ankle)):
            legs.append(
                keypoints_px[a] + _LEG_FRACTIONS[:, None] * (keypoints_px[b] - keypoints_px[a])
            )
    histograms = [_histogram(sample(image_rgb, points)) for points in (torso, np.concatenate(legs))]
    return np.sqrt(np.concatenate(histograms))


def distance(a: Float64Array, b: Float64Array) -> float:
    """Compute the Hellinger distance of two appearances, or of sums of several, over the parts that
    both contain.

    d² = 1 − Σ √(p q) for the histograms p, q of each part.

    :param a: (36,) as `appearance` returns it.
    :param b: (36,).
    :return: 0..1, the mean over the parts; ½ if no part is in both.
    """
    values = []
    for p, q in zip(a.reshape(2, -1), b.reshape(2, -1), strict=True):
        length = float(np.linalg.norm(p) * np.linalg.norm(q))
        if length > 1e-9:
            values.append(np.sqrt(max(0.0, 1.0 - float(p @ q) / length)))
    return float(np.mean(values)) if values else 0.5


def sample(image_rgb: Uint8Array, points: FloatArray) -> Uint8Array:
    """Return the (N, 3) pixels at those of the points that are inside the image.

    :param image_rgb: (H, W, 3).
    :param points: (P, 2) pixels.
    """
    height, width = image_rgb.shape[:2]
    x, y = np.round(points).astype(int).T
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return image_rgb[y[inside], x[inside]]


def _histogram(pixels: Uint8Array) -> Float64Array:
    if len(pixels) < _MIN_PIXELS:
        return np.zeros(_HUES + _GREYS)
    hue, saturation, value = cv2.cvtColor(pixels[None], cv2.COLOR_RGB2HSV)[0].astype(float).T
    colourful = saturation / 255 * np.sqrt(value / 255)
    hues = _soft_histogram(hue / 180 * _HUES, colourful, _HUES, wraps=True)
    greys = _soft_histogram(value / 256 * _GREYS - 0.5, 1 - colourful, _GREYS, wraps=False)
    return np.concatenate([hues, greys]) / len(pixels)


def _soft_histogram(
    position: Float64Array, weight: Float64Array, count: int, *, wraps: bool
) -> Float64Array:
    """Distribute each weight over the two nearest bins, so that a small change of light does not
    change the bin.
    """
    bins = np.zeros(count)
    low = np.floor(position).astype(int)
    share = position - low
    for index, part in ((low, 1 - share), (low + 1, share)):
        index = index % count if wraps else np.clip(index, 0, count - 1)
        np.add.at(bins, index, weight * part)
    return bins
