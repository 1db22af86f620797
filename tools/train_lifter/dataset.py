# SPDX-License-Identifier: GPL-3.0-or-later
"""Training batches: our body in front of a random camera, as the detector would report it.

A batch is a function of its seed alone, so that any number of processes can make them in any order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...scope_addon.capture.lifter import HIPS, network_input, person_size, virtual_camera
from ...solver.body import Body
from . import detector_noise
from .augment import Motions, PoseSampler, small_rotations

NEAREST_M, FARTHEST_M = 1.8, 12.0
PITCH_LEVEL, PITCH_SPREAD = np.radians(8.0), np.radians(9.0)
PITCH_LOWEST, PITCH_HIGHEST = np.radians(-15.0), np.radians(45.0)
# Most cameras are held or stand: how steeply they look at a person follows from height and distance.
HELD_SHARE, HELD_HEIGHT_M, HELD_SPREAD_M, LOWEST_M = 0.7, 1.3, 0.4, 0.1
ROLL_SPREAD = np.radians(3.0)
FIELD = (0.5, 0.4)  # |x/z| and |y/z| of the person's place in the picture


@dataclass(frozen=True)
class Batch:
    """n samples: ``input`` (n, 200) and ``points`` (n, 33, 3) metres, hips' middle at 0, virtual camera's axes."""

    input: np.ndarray
    points: np.ndarray


@dataclass(frozen=True)
class Scene:
    """n people before a camera: ``points`` (n, 33, 3) true keypoints and ``seen`` (n, 33, 3) where the detector looks
    for them, metres, camera axes; ``focal_ratio`` (n,) assumed focal length over the true one."""

    points: np.ndarray
    seen: np.ndarray
    focal_ratio: np.ndarray


class Dataset:
    """Draws batches for one body from motions."""

    def __init__(self, body: Body, motions: Motions) -> None:
        self.body, self.sampler = body, PoseSampler(body, motions)
        self.part = body.keypoint_part[list(body.keypoint_set("blazepose").values())]

    def keypoints(self, Omega: np.ndarray, bones: np.ndarray, local: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """BlazePose keypoints (n, 33, 3) in the axes of the root's parent, root joint at 0, and R of their parts."""
        R, t = Omega.copy(), np.zeros(bones.shape, np.float32)
        for i in range(1, self.body.K + 1):
            p = self.body.parents[i]
            R[:, i] = R[:, p] @ Omega[:, i]
            t[:, i] = t[:, p] + np.einsum("nij,nj->ni", R[:, p], bones[:, i])
        R = R[:, self.part]
        return np.einsum("nkij,nkj->nki", R, local) + t[:, self.part], R

    def scene(self, rng: np.random.Generator, n: int) -> Scene:
        """n people of random pose, shape and place."""
        Omega = self.sampler.poses(rng, n)
        bones, local = self.sampler.proportions(rng, n)
        points, R = self.keypoints(Omega, bones, local)
        displaced = detector_noise.PLACEMENT[:, None] * rng.standard_normal((n, 33, 3))
        seen = points + np.einsum("nkij,nkj->nki", R, displaced.astype(np.float32))
        middle = points[:, HIPS].mean(axis=1, keepdims=True)
        x, y = rng.uniform(-1, 1, (2, n)) * np.array(FIELD)[:, None]
        ray = np.stack([x, y, np.ones(n)], axis=1)
        distance = np.exp(rng.uniform(np.log(NEAREST_M), np.log(FARTHEST_M), n))
        place = (ray / np.linalg.norm(ray, axis=1, keepdims=True) * distance[:, None]).astype(np.float32)[:, None]
        above_floor = middle[:, 0, 1] - points[..., 1].min(axis=1)
        down = lines_of_sight(rng, above_floor, distance)
        into = np.swapaxes(cameras(rng, n, down - np.arctan2(y, np.hypot(x, 1))), 1, 2)
        focal_ratio = np.exp(detector_noise.FOCAL_SPREAD * rng.standard_normal(n)).astype(np.float32)
        return Scene((points - middle) @ into + place, (seen - middle) @ into + place, focal_ratio)

    def batch(self, seed: tuple[int, ...], n: int) -> Batch:
        """n samples that depend on the seed alone."""
        rng = np.random.default_rng(seed)
        scene = self.scene(rng, n)
        rays = scene.seen[..., :2] / np.maximum(scene.seen[..., 2:], 0.3)
        size = person_size(rays)[:, None, None]
        errors, confidence = detector_noise.image_errors(rng, n)
        relative = scene.seen - scene.seen[:, HIPS].mean(axis=1, keepdims=True)
        # Landmark networks look at a crop, as if the camera looked straight at the person.
        straight = np.swapaxes(virtual_camera(rays), 1, 2)
        world = detector_noise.world_landmarks(rng, relative @ straight)
        rays = (rays + errors * size).astype(np.float32)
        detector_noise.cut_by_edge(rng, rays, confidence)
        detector_noise.swap_sides(rng, rays)
        rays = rays / scene.focal_ratio[:, None, None]
        known = rng.random(n) >= detector_noise.UNKNOWN_SHARE
        x, R = network_input(rays, confidence.astype(np.float32), world, known)
        points = (scene.points - scene.points[:, HIPS].mean(axis=1, keepdims=True)) @ np.swapaxes(R, 1, 2)
        return Batch(x.astype(np.float32), points.astype(np.float32))


def lines_of_sight(rng: np.random.Generator, above_floor: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """(n,) radians by which the line from the camera to the hips points down.

    sin⁻¹((camera's height − hips' height) / distance) for cameras that are held, any angle for the others.
    """
    n = len(distance)
    height = np.maximum(HELD_HEIGHT_M + HELD_SPREAD_M * rng.standard_normal(n), LOWEST_M)
    held = np.arcsin(np.clip((height - above_floor) / distance, -0.7, 0.7))
    return np.where(rng.random(n) < HELD_SHARE, held, rng.uniform(PITCH_LOWEST, PITCH_HIGHEST, n))


def pitches(rng: np.random.Generator, n: int) -> np.ndarray:
    """(n,) radians of cameras that look straight at the person: many nearly level, the others of any pitch."""
    common = rng.random(n) < 0.6
    level = PITCH_LEVEL + PITCH_SPREAD * rng.standard_normal(n)
    return np.where(common, level, rng.uniform(PITCH_LOWEST, PITCH_HIGHEST, n))


def cameras(rng: np.random.Generator, n: int, pitch: np.ndarray) -> np.ndarray:
    """(n, 3, 3) f32 R_camera_world: looking along −z of a world with y up, pitched (positive: down) and rolled."""
    zero = np.zeros(n)
    tilted = small_rotations(np.stack([pitch, zero, zero], axis=1).astype(np.float32))
    rolled = small_rotations(np.stack([zero, zero, ROLL_SPREAD * rng.standard_normal(n)], axis=1).astype(np.float32))
    return rolled @ tilted @ np.diag([1.0, -1.0, -1.0]).astype(np.float32)
