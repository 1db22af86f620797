# SPDX-License-Identifier: GPL-3.0-or-later
"""What a person is wearing, as a colour histogram: tells people apart where place and motion do not."""

from __future__ import annotations

import cv2
import numpy as np

from ..perception.landmark_network import KEYPOINT_NAMES

_AT = {name: i for i, name in enumerate(KEYPOINT_NAMES)}
_TORSO = [_AT[name] for name in ("left_shoulder", "right_shoulder", "left_hip", "right_hip")]
_LEGS = [[_AT[f"{side}_{joint}"] for joint in ("hip", "knee", "ankle")] for side in ("left", "right")]
_INSET = np.linspace(0.15, 0.85, 9)  # the outline of the torso is background as often as not
_ALONG = np.linspace(0.1, 0.9, 12)
_HUES, _GREYS = 12, 6
SIZE = 2 * (_HUES + _GREYS)


def appearance(image_rgb: np.ndarray, keypoints_px: np.ndarray) -> np.ndarray:
    """(36,) square roots of two colour histograms, torso and legs, each of 12 hues and 6 greys; zeros where unseen.

    A pixel counts as its hue by how colourful it is, c = saturation · √value, and as its grey by the rest, 1 − c. The
    distance of two people is `distance`.

    :param image_rgb: (H, W, 3) uint8.  keypoints_px: (33, 2).
    """
    left_top, right_top, left_low, right_low = keypoints_px[_TORSO]
    across, down = np.meshgrid(_INSET, _INSET)
    top = left_top + across[..., None] * (right_top - left_top)
    low = left_low + across[..., None] * (right_low - left_low)
    torso = (top + down[..., None] * (low - top)).reshape(-1, 2)
    legs = []
    for hip, knee, ankle in _LEGS:
        for a, b in ((hip, knee), (knee, ankle)):
            legs.append(keypoints_px[a] + _ALONG[:, None] * (keypoints_px[b] - keypoints_px[a]))
    parts = [_histogram(_sample(image_rgb, points)) for points in (torso, np.concatenate(legs))]
    return np.sqrt(np.concatenate(parts))


def distance(a: np.ndarray, b: np.ndarray) -> float:
    """Hellinger distance 0..1 of two appearances (or of sums of several), over the parts that both of them show.

    d² = 1 − Σ √(p q) for each part's histogram p, q; the mean over the parts. ½ when they have no part in common.
    """
    values = []
    for p, q in zip(a.reshape(2, -1), b.reshape(2, -1), strict=True):
        length = float(np.linalg.norm(p) * np.linalg.norm(q))
        if length > 1e-9:
            values.append(np.sqrt(max(0.0, 1.0 - float(p @ q) / length)))
    return float(np.mean(values)) if values else 0.5


def _sample(image_rgb: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(N, 3) pixels at those points that lie in the image."""
    height, width = image_rgb.shape[:2]
    x, y = np.round(points).astype(int).T
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return image_rgb[y[inside], x[inside]]


def _histogram(pixels: np.ndarray) -> np.ndarray:
    if len(pixels) < 6:
        return np.zeros(_HUES + _GREYS)
    hue, saturation, value = cv2.cvtColor(pixels[None], cv2.COLOR_RGB2HSV)[0].astype(float).T
    colourful = saturation / 255 * np.sqrt(value / 255)
    out = np.zeros(_HUES + _GREYS)
    _spread(out[:_HUES], hue / 180 * _HUES, colourful, wrap=True)
    _spread(out[_HUES:], value / 256 * _GREYS - 0.5, 1 - colourful, wrap=False)
    return out / len(pixels)


def _spread(bins: np.ndarray, place: np.ndarray, weight: np.ndarray, wrap: bool) -> None:
    """Add each weight to the two bins beside its place, so that a little more light does not change the bin."""
    low = np.floor(place).astype(int)
    share = place - low
    for index, part in ((low, 1 - share), (low + 1, share)):
        index = index % len(bins) if wrap else np.clip(index, 0, len(bins) - 1)
        np.add.at(bins, index, weight * part)
