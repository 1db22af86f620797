# SPDX-License-Identifier: GPL-3.0-or-later
"""Training batches: the body moving in front of a random camera, as the detector would report it.

A batch depends only on its seed, so that any number of processes can make batches in any order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ...scope_addon.capture.perception.lifter import HIPS, KEYPOINT_COUNT, network_input, person_size, virtual_camera
from ...scope_addon.capture.perception.lifter_window import MIDDLE, OFFSETS_S, WINDOW
from ...solver.body import Body
from . import detector_noise
from .augment import Motions, PoseSampler, small_rotations
from .detector_noise import Persistence

FARTHEST_M = 12.0
PITCH_LEVEL, PITCH_SPREAD = np.radians(8.0), np.radians(9.0)
PITCH_LOWEST, PITCH_HIGHEST = np.radians(-15.0), np.radians(45.0)
# Most cameras are hand-held or on a stand: their pitch towards a person follows from height and distance.
HELD_SHARE, HELD_HEIGHT_M, HELD_SPREAD_M, LOWEST_M = 0.7, 1.3, 0.4, 0.1
HEIGHTS_M = (0.3, 3.0)  # see `Variety.any_height_share`
ROLL_SPREAD = np.radians(3.0)
DRIFT_PER_S = (0.1, 0.03, 0.08)  # one standard deviation, of x/z, y/z and the logarithm of the distance
# Windows truncated at a clip's start or end, and windows of still images.
CUT_SHORT_SHARE, STILL_SHARE = 0.06, 0.06


@dataclass(frozen=True)
class Variety:
    """In what the people and cameras of a training may differ.

    ``nearest_m``: distance of the nearest person. ``field``: largest |x/z| and |y/z| of the person's position in the
    image. ``any_height_share``: of the hand-held cameras, those at any height in HEIGHTS_M instead of a person's.
    ``focal_spread``: standard deviation of the logarithm of assumed over true focal length. ``hanging_share``: of the
    samples, those whose arms hang. ``mean_offsets``: see `detector_noise.placements`.
    """

    nearest_m: float = 1.8
    field: tuple[float, float] = (0.5, 0.4)
    any_height_share: float = 0.0
    focal_spread: float = 0.1
    hanging_share: float = 0.0
    mean_offsets: bool = True


USUAL = Variety()
# Wide-angle lenses, near and off-centre people, cameras at any height, focal lengths as uncertain as those of captures.
WIDE = Variety(1.2, (0.75, 0.5), 0.5, 0.35, 0.25)


@dataclass(frozen=True)
class Batch:
    """Samples for training, n of them.

    ``input`` (n, WINDOW, 200); ``points`` (n, 33, 3) of the middle moment: metres, mid-hip at 0, the virtual camera's
    axes.
    """

    input: NDArray[np.float32]
    points: NDArray[np.float32]


@dataclass(frozen=True)
class Scene:
    """People in front of a camera, n of them.

    ``points`` (n, WINDOW, 33, 3) true keypoints and ``seen`` (n, WINDOW, 33, 3) the detector's keypoints, metres,
    camera axes; ``focal_ratio`` (n,) assumed over true focal length.
    """

    points: NDArray[np.float32]
    seen: NDArray[np.float32]
    focal_ratio: NDArray[np.float32]


class Dataset:
    """Draws batches for one body from motions."""

    def __init__(self, body: Body, motions: Motions, variety: Variety = USUAL) -> None:
        self.body, self.variety = body, variety
        self.sampler = PoseSampler(body, motions, variety.hanging_share)
        self.part = body.keypoint_part[list(body.keypoint_set("blazepose").values())].astype(np.int64)
        self._parents = np.asarray(body.parents, np.int64)

    def keypoints(
        self,
        Omega: NDArray[np.float32],
        bones: NDArray[np.float32],
        local: NDArray[np.float32],
        displaced: NDArray[np.float32],
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return BlazePose keypoints of windows of poses, and the same displaced in the axes of their parts.

        :param Omega: (n, W, 24, 3, 3);  bones: (n, 24, 3), local: (n, 33, 3) as of `PoseSampler.proportions`;
            displaced: (n, 33, 3) metres.  All f32.
        :return: (n, W, 33, 3) twice, in the axes of the root's parent, root joint at 0.
        """
        points, seen = (np.empty((*Omega.shape[:2], KEYPOINT_COUNT, 3), np.float32) for _ in range(2))
        K = Omega.shape[2]
        R, t = np.empty((K, 3, 3), np.float32), np.empty((K, 3), np.float32)
        _forward(Omega, bones, local, displaced, self._parents, self.part, R, t, points, seen)
        return points, seen

    def scene(self, rng: np.random.Generator, n: int) -> Scene:
        """Draw n people of random motion, shape and position."""
        Omega = self.sampler.motion_windows(rng, n)
        bones, local = self.sampler.proportions(rng, n)
        displaced = detector_noise.placements(rng, n, self.variety.mean_offsets)
        points, seen = self.keypoints(Omega, bones, local, displaced)
        middle = points[:, :, HIPS].mean(axis=2, keepdims=True)
        x, y = rng.uniform(-1, 1, (2, n)) * np.array(self.variety.field)[:, None]
        distance = np.exp(rng.uniform(np.log(self.variety.nearest_m), np.log(FARTHEST_M), n))
        above_floor = middle[:, MIDDLE, 0, 1] - points[:, MIDDLE, :, 1].min(axis=1)
        down = lines_of_sight(rng, above_floor, distance, self.variety.any_height_share)
        into = np.swapaxes(cameras(rng, n, down - np.arctan2(y, np.hypot(x, 1))), 1, 2)[:, None]
        drift = [OFFSETS_S * (speed * rng.standard_normal((n, 1))) for speed in DRIFT_PER_S]
        ray = np.stack([x[:, None] + drift[0], y[:, None] + drift[1], np.ones((n, WINDOW))], axis=-1)
        away = (distance[:, None] * np.exp(drift[2]))[..., None]
        place = (ray / np.linalg.norm(ray, axis=-1, keepdims=True) * away).astype(np.float32)[:, :, None]
        focal_ratio = np.exp(self.variety.focal_spread * rng.standard_normal(n)).astype(np.float32)
        return Scene((points - middle) @ into + place, (seen - middle) @ into + place, focal_ratio)

    def batch(self, seed: tuple[int, ...], n: int) -> Batch:
        """Draw n samples that depend on the seed only."""
        rng = np.random.default_rng(seed)
        scene = self.scene(rng, n)
        persistence = Persistence.draw(rng, n)
        rays = scene.seen[..., :2] / np.maximum(scene.seen[..., 2:], 0.3)
        flat = (n * WINDOW, KEYPOINT_COUNT)
        size = person_size(rays.reshape(*flat, 2)).reshape(n, WINDOW, 1, 1)
        errors, confidence = detector_noise.image_errors(rng, persistence)
        relative = scene.seen - scene.seen[:, :, HIPS].mean(axis=2, keepdims=True)
        # Landmark networks see a crop, as of a camera that points at the person.
        straight = np.swapaxes(virtual_camera(rays.reshape(*flat, 2)), 1, 2).reshape(n, WINDOW, 3, 3)
        relative = (relative @ straight.astype(np.float32)).astype(np.float32)
        world = detector_noise.world_landmarks(rng, relative, persistence)
        rays = (rays + errors * size).astype(np.float32)
        detector_noise.cut_by_edge(rng, rays, confidence, persistence)
        detector_noise.swap_sides(rng, rays)
        rays = rays / scene.focal_ratio[:, None, None, None]
        known = np.repeat(rng.random(n) >= detector_noise.UNKNOWN_SHARE, WINDOW)
        x, R = network_input(
            rays.reshape(*flat, 2), confidence.reshape(flat).astype(np.float32), world.reshape(*flat, 3), known
        )
        x = cut_short(rng, x.reshape(n, WINDOW, -1))
        points = scene.points[:, MIDDLE]
        R = R.reshape(n, WINDOW, 3, 3)[:, MIDDLE]
        points = (points - points[:, HIPS].mean(axis=1, keepdims=True)) @ np.swapaxes(R, 1, 2)
        return Batch(x.astype(np.float32), points.astype(np.float32))


def cut_short(rng: np.random.Generator, x: NDArray[np.float32]) -> NDArray[np.float32]:
    """Truncate some windows (n, WINDOW, ...), so that moments repeat as at a clip's ends or in a still image."""
    n = len(x)
    first = np.where(rng.random(n) < CUT_SHORT_SHARE, rng.integers(0, MIDDLE + 1, n), 0)
    last = np.where(rng.random(n) < CUT_SHORT_SHARE, rng.integers(MIDDLE, WINDOW, n), WINDOW - 1)
    still = rng.random(n) < STILL_SHARE
    first[still] = last[still] = MIDDLE
    return x[np.arange(n)[:, None], np.clip(np.arange(WINDOW), first[:, None], last[:, None])]


@njit(fastmath=True)
def _forward(
    Omega: NDArray[np.float32],
    bones: NDArray[np.float32],
    local: NDArray[np.float32],
    displaced: NDArray[np.float32],
    parents: NDArray[np.int64],
    part: NDArray[np.int64],
    R: NDArray[np.float32],
    t: NDArray[np.float32],
    points: NDArray[np.float32],
    seen: NDArray[np.float32],
) -> None:
    """Compute `Dataset.keypoints`; ``R`` (24, 3, 3) and ``t`` (24, 3) are work arrays."""
    for a in range(Omega.shape[0]):
        for w in range(Omega.shape[1]):
            for i in range(3):  # element by element: numba compiles assignments of whole rows for seconds
                t[0, i] = 0.0
                for j in range(3):
                    R[0, i, j] = Omega[a, w, 0, i, j]
            for k in range(1, len(parents)):
                p = parents[k]
                for i in range(3):
                    x, y, z = R[p, i, 0], R[p, i, 1], R[p, i, 2]
                    t[k, i] = t[p, i] + x * bones[a, k, 0] + y * bones[a, k, 1] + z * bones[a, k, 2]
                    for j in range(3):
                        R[k, i, j] = x * Omega[a, w, k, 0, j] + y * Omega[a, w, k, 1, j] + z * Omega[a, w, k, 2, j]
            for j in range(local.shape[1]):
                p = part[j]
                for i in range(3):
                    x, y, z = R[p, i, 0], R[p, i, 1], R[p, i, 2]
                    point = t[p, i] + x * local[a, j, 0] + y * local[a, j, 1] + z * local[a, j, 2]
                    points[a, w, j, i] = point
                    seen[a, w, j, i] = point + x * displaced[a, j, 0] + y * displaced[a, j, 1] + z * displaced[a, j, 2]


def lines_of_sight(
    rng: np.random.Generator,
    above_floor: NDArray[np.float32],
    distance: NDArray[np.float32],
    any_height_share: float = 0.0,
) -> NDArray[np.float32]:
    """Draw the angles (n,) in radians by which the line from the camera to the hips points down.

    sin⁻¹((camera's height − hips' height) / distance) for hand-held cameras, any angle for the others.

    :param above_floor: (n,) metres, of the hips;  distance: (n,) metres;  any_height_share: see `Variety`.
    """
    n = len(distance)
    height = np.maximum(HELD_HEIGHT_M + HELD_SPREAD_M * rng.standard_normal(n), LOWEST_M)
    if any_height_share:
        height = np.where(rng.random(n) < any_height_share, rng.uniform(*HEIGHTS_M, n), height)
    held = np.arcsin(np.clip((height - above_floor) / distance, -0.7, 0.7))
    return np.where(rng.random(n) < HELD_SHARE, held, rng.uniform(PITCH_LOWEST, PITCH_HIGHEST, n))


def pitches(rng: np.random.Generator, n: int) -> NDArray[np.float32]:
    """Draw the pitches (n,), radians, of cameras that point at the person: many nearly level, others of any pitch."""
    common = rng.random(n) < 0.6
    level = PITCH_LEVEL + PITCH_SPREAD * rng.standard_normal(n)
    return np.where(common, level, rng.uniform(PITCH_LOWEST, PITCH_HIGHEST, n))


def cameras(rng: np.random.Generator, n: int, pitch: NDArray[np.float32]) -> NDArray[np.float32]:
    """Draw R_camera_world (n, 3, 3) f32: looking along −z of a world with y up, pitched (positive: down) and rolled."""
    zero = np.zeros(n)
    tilted = small_rotations(np.stack([pitch, zero, zero], axis=1).astype(np.float32))
    rolled = small_rotations(np.stack([zero, zero, ROLL_SPREAD * rng.standard_normal(n)], axis=1).astype(np.float32))
    return rolled @ tilted @ np.diag([1.0, -1.0, -1.0]).astype(np.float32)
