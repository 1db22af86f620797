# SPDX-License-Identifier: GPL-3.0-or-later
"""Training batches: the body moving in front of a random camera, as the detector would report it,
in PyTorch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch
from torch import Tensor

from ...scope_addon.capture.perception.lifter import MIDDLE, OFFSETS_S, WINDOW
from ...solver.body import Body
from . import detector_noise
from .augment import PoseSampler, chance, constant, normal, rotation_matrices, uniform
from .detector_noise import Persistence
from .motions import Motions
from .network_input import hip_center, network_input, person_size, virtual_camera

FARTHEST_M = 12.0
PITCH_LIMITS = (math.radians(-15.0), math.radians(45.0))
# Most cameras are hand-held or on a stand: their pitch towards a person follows from height and
# distance.
HELD_SHARE = 0.7
HELD_HEIGHT_M = 1.3
HELD_SPREAD_M = 0.4
LOWEST_M = 0.1
HEIGHTS_M = (0.3, 3.0)  # see `Variety.any_height_share`
ROLL_SPREAD = math.radians(3.0)
ROLLED_SPREAD = math.radians(15.0)
# one standard deviation, of x/z, y/z and the logarithm of the distance
DRIFT_PER_S = (0.1, 0.03, 0.08)
CUT_SHORT_SHARE = 0.06  # of the windows, those truncated at a clip's start, and as many at its end
NEAREST_DEPTH_M = 0.3  # of a keypoint, to divide by


@dataclass(frozen=True)
class Variety:
    """In what the people and cameras of a training may differ.

    ``natural_share``: of the samples, those whose joints are as recorded, see `augment`.
    ``segment_spread``: standard deviation of the logarithm by which trunk, arms and legs vary in
    length. ``random_offsets``: whether each person has a share of the landmark network's keypoint
    offsets, see `detector_noise.placements`. ``nearest_m``: distance of the nearest person.
    ``field``: largest |x/z| and |y/z| of the person's position in the image. ``any_height_share``:
    of the hand-held cameras, those at any height in HEIGHTS_M instead of a person's.
    ``rolled_share``: of the cameras, those with a roll of ROLLED_SPREAD. ``focal_spread``: standard
    deviation of the logarithm of assumed over true focal length. ``still_share``: of the windows,
    those of still images.
    """

    natural_share: float = 0.0
    segment_spread: float = 0.0
    random_offsets: bool = False
    nearest_m: float = 1.8
    field: tuple[float, float] = (0.5, 0.4)
    any_height_share: float = 0.0
    rolled_share: float = 0.0
    focal_spread: float = 0.1
    still_share: float = 0.06


@dataclass(frozen=True)
class Batch:
    """Samples for training, n of them.

    ``input`` (n, WINDOW, 200); ``points`` (n, 33, 3) of the middle moment: metres, mid-hip at 0,
    the virtual camera's axes.
    """

    input: Tensor
    points: Tensor


@dataclass(frozen=True)
class Scene:
    """People in front of a camera, n of them.

    ``points`` (n, WINDOW, 33, 3) true keypoints and ``seen`` (n, WINDOW, 33, 3) the detector's
    keypoints, metres, camera axes; ``focal_ratio`` (n,) assumed over true focal length.
    """

    points: Tensor
    seen: Tensor
    focal_ratio: Tensor


class Dataset:
    """Draws batches for one body from motions, on one device."""

    def __init__(
        self, body: Body, motions: Motions, variety: Variety | None = None, device: str = "cpu"
    ) -> None:
        self.variety = variety or Variety()
        self.device = device
        self.sampler = PoseSampler(
            body, motions, self.variety.natural_share, self.variety.segment_spread, device
        )
        on_device = partial(constant, device=device)
        indices = partial(constant, device=device, dtype=torch.long)
        self._part = indices(body.keypoint_part[list(body.keypoint_set("blazepose").values())])
        parents = np.asarray(body.parents)
        depth = np.zeros(len(parents), int)
        for k, parent in enumerate(parents[1:], 1):
            depth[k] = depth[parent] + 1
        levels = [np.flatnonzero(depth == level) for level in range(1, depth.max() + 1)]
        self._levels = [(indices(joints), indices(parents[joints])) for joints in levels]
        self._offsets_s = on_device(OFFSETS_S)
        self._moments = torch.arange(WINDOW, device=device)
        self._placement, self._mean_offsets = map(
            on_device, (detector_noise.PLACEMENT, detector_noise.MEAN_OFFSETS)
        )

    def keypoints(
        self, Omega: Tensor, bones: Tensor, local: Tensor, displaced: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return BlazePose keypoints of windows of poses, and the same displaced in the axes of
        their parts.

        R_k = R_p Ω_k, t_k = t_p + R_p l_k with p the parent, one level of the tree after another.

        :param Omega: (n, W, 24, 3, 3);  bones: (n, 24, 3), local: (n, 33, 3) as of
            `PoseSampler.proportions`; displaced: (n, 33, 3) metres.
        :return: (n, W, 33, 3) twice, in the axes of the root's parent, root joint at 0.
        """
        R = torch.empty_like(Omega)
        t = torch.zeros_like(Omega[..., 0])
        R[:, :, 0] = Omega[:, :, 0]
        for joints, parents in self._levels:
            R_parent = R[:, :, parents]
            R[:, :, joints] = R_parent @ Omega[:, :, joints]
            t[:, :, joints] = t[:, :, parents] + _turned(R_parent, bones[:, joints])
        R_part = R[:, :, self._part]
        points = t[:, :, self._part] + _turned(R_part, local)
        return points, points + _turned(R_part, displaced)

    def scene(self, n: int) -> Scene:
        """Draw n people of random motion, shape and position."""
        Omega = self.sampler.motion_windows(n)
        bones, local = self.sampler.proportions(n)
        mean = self._mean_offsets if self.variety.random_offsets else None
        points, seen = self.keypoints(
            Omega, bones, local, detector_noise.placements(n, self._placement, mean)
        )
        return self._before_camera(points, seen)

    def _before_camera(self, points: Tensor, seen: Tensor) -> Scene:
        """Place people (n, WINDOW, 33, 3), y up, before random cameras."""
        v = self.variety
        n = len(points)
        middle = hip_center(points)
        x, y = (uniform(points, (-limit, limit), n) for limit in v.field)
        distance = torch.exp(uniform(points, (math.log(v.nearest_m), math.log(FARTHEST_M)), n))
        above_floor = middle[:, MIDDLE, 0, 1] - points[:, MIDDLE, :, 1].amin(1)
        down = lines_of_sight(above_floor, distance, v.any_height_share)
        pitch = down - torch.atan2(y, torch.hypot(x, torch.ones_like(x)))
        R_world_camera = cameras(pitch, v.rolled_share).transpose(1, 2)[:, None]
        across, up, away = (
            self._offsets_s * (speed * normal(points, n, 1)) for speed in DRIFT_PER_S
        )
        ray = torch.stack([x[:, None] + across, y[:, None] + up, torch.ones_like(across)], -1)
        ray = ray / ray.norm(dim=-1, keepdim=True)
        place = (ray * (distance[:, None] * torch.exp(away))[..., None])[:, :, None]
        focal_ratio = torch.exp(v.focal_spread * normal(points, n))
        return Scene(
            (points - middle) @ R_world_camera + place,
            (seen - middle) @ R_world_camera + place,
            focal_ratio,
        )

    def batch(self, n: int) -> Batch:
        """Draw n samples."""
        scene = self.scene(n)
        persistence = Persistence.draw(n, self.device)
        rays = scene.seen[..., :2] / scene.seen[..., 2:].clamp(min=NEAREST_DEPTH_M)
        errors, confidence = detector_noise.image_errors(persistence)
        # Landmark networks see a crop, as of a camera that points at the person.
        relative = (scene.seen - hip_center(scene.seen)) @ virtual_camera(rays).transpose(-1, -2)
        world = detector_noise.world_landmarks(relative, persistence)
        rays = rays + errors * person_size(rays)[..., None, None]
        rays, confidence = detector_noise.cut_by_edge(rays, confidence, persistence)
        rays = detector_noise.swap_sides(rays) / scene.focal_ratio[:, None, None, None]
        known = (~chance(rays, detector_noise.UNKNOWN_SHARE, n, 1)).float().expand(-1, WINDOW)
        x, R = network_input(rays, confidence, world, known)
        middle = scene.points[:, MIDDLE]
        points = (middle - hip_center(middle)) @ R[:, MIDDLE].transpose(1, 2)
        return Batch(cut_short(x, self._moments, self.variety.still_share), points)


def _turned(R: Tensor, vectors: Tensor) -> Tensor:
    """Return R v (n, W, m, 3) of rotations (n, W, m, 3, 3) and vectors (n, m, 3)."""
    return (R @ vectors[:, None, ..., None])[..., 0]


def cut_short(x: Tensor, moments: Tensor, still_share: float) -> Tensor:
    """Truncate some windows (n, WINDOW, C), so that moments repeat as at a clip's ends or in a
    still image.

    :param moments: 0 to WINDOW − 1, on the device of ``x``;  still_share: of the windows, those of
        still images.
    """
    n = len(x)
    start, end = (uniform(x, (0.0, 1.0), n) for _ in range(2))
    first = torch.where(chance(x, CUT_SHORT_SHARE, n), (start * (MIDDLE + 1)).long(), 0)
    last = torch.where(
        chance(x, CUT_SHORT_SHARE, n), MIDDLE + (end * (WINDOW - MIDDLE)).long(), WINDOW - 1
    )
    still = chance(x, still_share, n)
    first = torch.where(still, MIDDLE, first)
    last = torch.where(still, MIDDLE, last)
    rows = torch.minimum(torch.maximum(moments[None], first[:, None]), last[:, None])
    return x.gather(1, rows[..., None].expand(-1, -1, x.shape[-1]))


def lines_of_sight(above_floor: Tensor, distance: Tensor, any_height_share: float = 0.0) -> Tensor:
    """Draw the angles (n,) in radians by which the line from the camera to the hips points down.

    sin⁻¹((camera's height − hips' height) / distance) for hand-held cameras, any angle for the
    others.

    :param above_floor: (n,) metres, of the hips;  distance: (n,) metres;  any_height_share: see
        `Variety`.
    """
    n = len(distance)
    height = (HELD_HEIGHT_M + HELD_SPREAD_M * normal(distance, n)).clamp(min=LOWEST_M)
    height = torch.where(
        chance(distance, any_height_share, n), uniform(distance, HEIGHTS_M, n), height
    )
    held = torch.asin(((height - above_floor) / distance).clamp(-0.7, 0.7))
    return torch.where(chance(distance, HELD_SHARE, n), held, uniform(distance, PITCH_LIMITS, n))


def cameras(pitch: Tensor, rolled_share: float = 0.0) -> Tensor:
    """Draw R_camera_world (n, 3, 3): looking along −z of a world with y up, pitched (positive:
    down) and rolled.

    :param pitch: (n,) radians;  rolled_share: see `Variety`.
    """
    n = len(pitch)
    zero = torch.zeros_like(pitch)
    roll = torch.where(chance(pitch, rolled_share, n), ROLLED_SPREAD, ROLL_SPREAD) * normal(
        pitch, n
    )
    turned = rotation_matrices(torch.stack([zero, zero, roll], 1)) @ rotation_matrices(
        torch.stack([pitch, zero, zero], 1)
    )
    return torch.cat([turned[..., :1], -turned[..., 1:]], -1)  # times diag(1, −1, −1)
