# SPDX-License-Identifier: GPL-3.0-or-later
"""The detector's errors as observed on renders of our body (``render_pairs``), carried over to other poses.

What a landmark network sees of a pose g (33 points, its own axes) is taken as linear in g plus what is left over,

    y = A [g, 1] + r,    y = [(detected − true image points) / s, world landmarks]

A by ridge regression over all pairs. A new pose gets the r (and the confidences) of one of the pairs with the most
similar poses, so that errors keep their correlation with each other and with the pose. Of A [g, 1] it gets the rows of
the landmarks' depth. The others say what the network calls the shoulder or the ankle of a body like our renders',
which is not so for other people: with them, the lifter took real people to lean by 6 to 9 degrees.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...scope_addon.capture.lifter import HIPS, LIMBS, person_size, virtual_camera
from .detector_noise import SWAPPED

RIDGE_M2 = 0.003  # per pair; beside a variance of 0.06 m² per coordinate it shrinks A by 5 %
NEIGHBOURS = 24
LEFT_OVER = (0.4, 1.0)  # factor on r: real people are easier for the network than our renders
LEAST_PRESENCE, LEAST_SPREAD, MOST_DISAGREEMENT = 0.9, 0.38, 0.2  # below, the tracker would not believe its eyes


class ObservedErrors:
    """Errors to draw from; ``points`` (n, 33, 3), ``rays`` (n, 33, 2), ``confidence`` (n, 33), ``world`` (n, 33, 3)."""

    def __init__(self, points: np.ndarray, rays: np.ndarray, confidence: np.ndarray, world: np.ndarray) -> None:
        true_rays = points[..., :2] / points[..., 2:]
        errors = (rays - true_rays) / person_size(true_rays)[:, None, None]
        pose = (points - points[:, HIPS].mean(axis=1, keepdims=True)) @ np.swapaxes(virtual_camera(true_rays), 1, 2)
        pose, errors, world = (with_mirror_images(a, (-1, 1, 1)[: a.shape[2]]) for a in (pose, errors, world))
        self.confidence = np.concatenate([confidence, confidence[:, SWAPPED]])
        n = len(pose)
        G = np.concatenate([pose.reshape(n, -1), np.ones((n, 1))], axis=1)
        y = np.concatenate([errors.reshape(n, -1), (world - pose).reshape(n, -1)], axis=1)
        keep = np.diag(np.append(np.full(99, RIDGE_M2), 0.0)) * n
        self.A = np.linalg.solve(G.T @ G + keep, G.T @ y).astype(np.float32)
        self.used = np.concatenate([np.zeros(66), np.tile([0, 0, 1], 33)]).astype(np.float32)
        self.left_over = (y - G @ self.A).astype(np.float32)
        self.limbs = pose[:, LIMBS].reshape(n, 3 * len(LIMBS)).astype(np.float32)

    @classmethod
    def load(cls, path: Path, held_out: bool = False) -> ObservedErrors:
        """From a file of ``render_pairs``; every fifth pair is held out."""
        return cls(*load_pairs(path, held_out))

    def draw(self, rng: np.random.Generator, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Errors for poses (n, 33, 3).

        :return: of image points over s (n, 33, 2); confidences (n, 33); world landmarks (n, 33, 3) metres.
        """
        n = len(pose)
        limbs = pose[:, LIMBS].reshape(n, 3 * len(LIMBS))
        distance = np.square(self.limbs).sum(axis=1) - 2 * limbs @ self.limbs.T
        k = min(NEIGHBOURS, distance.shape[1] - 1)
        nearest = np.argpartition(distance, k, axis=1)[:, :k]
        pick = nearest[np.arange(n), rng.integers(0, k, n)]
        G = np.concatenate([pose.reshape(n, 99), np.ones((n, 1), pose.dtype)], axis=1)
        y = G @ (self.A * self.used) + self.left_over[pick] * rng.uniform(*LEFT_OVER, (n, 1)).astype(np.float32)
        world = pose + y[:, 66:].reshape(n, 33, 3)
        return y[:, :66].reshape(n, 33, 2), self.confidence[pick], world - world[:, HIPS].mean(axis=1, keepdims=True)


def with_mirror_images(points: np.ndarray, signs: tuple[int, ...]) -> np.ndarray:
    """(n, 33, D) and after them the same with x turned round and left and right exchanged: (2n, 33, D)."""
    return np.concatenate([points, points[:, SWAPPED] * np.array(signs)])


def load_pairs(path: Path, held_out: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Points, rays, confidences and world landmarks of the pairs that a tracker would accept."""
    with np.load(path) as data:
        good = (data["presence"] >= LEAST_PRESENCE) & (data["spread"] >= LEAST_SPREAD)
        good &= data["disagreement"] <= MOST_DISAGREEMENT
        good &= (np.arange(len(good)) % 5 == 4) == held_out
        return data["points"][good], data["rays"][good], data["confidence"][good], data["world"][good]
