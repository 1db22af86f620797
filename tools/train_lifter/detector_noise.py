# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulated detector errors: displaced and uncertain 2D keypoints, distorted world landmarks.

The detector's keypoints differ from the body's: each has a constant offset in its body part,
specific to the person (people differ in build and clothes), on request around a share of that of
`keypoint_offsets`. Image errors are added and, in the world landmarks, a tilt, scale and flattening
of the whole, errors in the depth of limbs, and sometimes a limb mirrored in depth.

Errors are correlated in time. The autocorrelation of errors in the depth of bones, of
`pose_landmark_heavy` on footage and renders with ground truth, is 0.8, 0.65, 0.5 and 0.5 after 0.1,
0.2, 0.4 and 0.8 seconds: half of the variance is constant within the window, most of the rest
changes within a few tenths of a second, see `Persistence`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ...scope_addon.capture.fitting.keypoint_offsets import offset
from ...scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from ...scope_addon.capture.perception.lifter import MIDDLE, WINDOW
from .augment import chance, normal, rotation_matrices, uniform
from .network_input import hip_center

# Metres, one standard deviation per coordinate, of a person's keypoint offsets.
PLACEMENT = np.full(33, 0.012)
PLACEMENT[[11, 12]] = 0.02
PLACEMENT[[23, 24]] = 0.025
PLACEMENT[25:33] = 0.015
MEAN_OFFSETS = np.array([offset(name) for name in KEYPOINT_NAMES])
OFFSETS_FACTOR = (-0.5, 1.5)  # per person, on MEAN_OFFSETS, where they are used
# of the person's size s (see lifter.py), times a factor per sample of exp(N(0, 0.5))
IMAGE_NOISE = 0.03
CONFIDENT_SHARE = 0.8
UNSURE_FACTOR = 3.5  # on the image noise of a keypoint with no confidence
SWAP_SHARE = 0.01  # samples in which the arms, or the legs, have left and right swapped
CUT_SHARE = 0.12  # samples in which part of the body is outside the image
# sums of their shares: cut below, at the right, above, and the rest at the left
CUT_UP_TO = (0.5, 0.6, 0.8)
SWAP_LASTS = 0.7  # of the window's moments
CONFIDENCE_LASTS = 0.7  # of the keypoints keep their confidence through the window
# World landmarks. Depth is mostly too small: on renders by a factor of 0.3 for arms, 0.6 for trunk
# and legs.
UNKNOWN_SHARE = 0.3
TILT = math.radians(10.0)
TURN = math.radians(9.0)
SCALE_SPREAD = 0.07
ARM_GAIN = (0.2, 1.1)
LEG_GAIN = (0.5, 1.1)
TRUNK_GAIN = (0.4, 1.1)
SHOULDER_GAIN = (0.6, 1.1)
LIMB_DEPTH = 0.25  # error of a bone's slope in depth, over its length
LIMB_ACROSS = 0.1
WORLD_NOISE_M = 0.012
FLIP_SHARE = 0.05  # per limb: its depth relative to shoulder or hip has the wrong sign
FLIP_LASTS = 0.8  # of the window's moments
# see `Persistence`
CONSTANT_SHARE = (0.2, 0.8)
KEPT = (0.4, 0.9)

# Each limb from the trunk outwards, with the keypoints attached to its ends.
LIMBS = (
    ((11, 13), (13, 15), (15, 17), (15, 19), (15, 21)),
    ((12, 14), (14, 16), (16, 18), (16, 20), (16, 22)),
    ((23, 25), (25, 27), (27, 29), (27, 31)),
    ((24, 26), (26, 28), (28, 30), (28, 32)),
)
# first keypoint and one past the last, left and right in turn
_ARMS = (11, 23)
_LEGS = (23, 33)


@dataclass(frozen=True)
class Persistence:
    """Correlation in time of the errors of n people in a window of WINDOW moments, each standard
    normal.

        e_t = √ρ c + √(1 − ρ) z_t,   z_t = a z_{t−1} + √(1 − a²) w_t

    with c and w_t independent; ``constant`` (n,) is ρ, ``kept`` (n,) is a.
    """

    constant: Tensor
    kept: Tensor

    @staticmethod
    def draw(n: int, device: str) -> Persistence:
        """Draw, for n people, the constant share of errors and the correlation from one moment to
        the next.
        """
        like = torch.empty(n, device=device)
        return Persistence(uniform(like, CONSTANT_SHARE, n), uniform(like, KEPT, n))

    def mix(self, constant: Tensor, white: Tensor) -> Tensor:
        """Return e_t of c (n, 1, ...) and w_t (n, WINDOW, ...)."""
        a = self.kept.reshape(-1, *[1] * (white.ndim - 2))
        b = torch.sqrt(1 - a * a)
        z = [white[:, 0]]
        for t in range(1, white.shape[1]):
            z.append(a * z[-1] + b * white[:, t])
        rho = self.constant.reshape(-1, *[1] * (white.ndim - 1))
        return torch.sqrt(rho) * constant + torch.sqrt(1 - rho) * torch.stack(z, 1)

    def normal(self, *shape: int) -> Tensor:
        """Draw e_t, (n, WINDOW, *shape)."""
        n = len(self.constant)
        return self.mix(
            normal(self.constant, n, 1, *shape), normal(self.constant, n, WINDOW, *shape)
        )


def placements(n: int, deviation: Tensor, mean: Tensor | None = None) -> Tensor:
    """Draw keypoint offsets (n, 33, 3), metres, of n people, in the axes of their parts.

    :param deviation: (33,) metres, `PLACEMENT` on the device;  mean: (33, 3) metres, `MEAN_OFFSETS`
        on the device, of which each person has a share of `OFFSETS_FACTOR`; None: offsets around
        zero.
    """
    own = deviation[:, None] * normal(deviation, n, 33, 3)
    return own if mean is None else own + mean * uniform(deviation, OFFSETS_FACTOR, n, 1, 1)


def image_errors(persistence: Persistence) -> tuple[Tensor, Tensor]:
    """Draw errors (n, WINDOW, 33, 2) of 2D keypoints, in units of the person's size s, and
    confidences.
    """
    like = persistence.constant
    n = len(persistence.constant)
    (constant, lasting) = moment_errors(like, n)
    (white, passing) = moment_errors(like, n, WINDOW)
    keeps = chance(like, CONFIDENCE_LASTS, n, 1, 33)
    return persistence.mix(constant[:, None], white), torch.where(keeps, lasting[:, None], passing)


def moment_errors(like: Tensor, *n: int) -> tuple[Tensor, Tensor]:
    """Draw errors of 2D keypoints (*n, 33, 2) in units of the person's size s, and confidences (*n,
    33).
    """
    one = (0.0, 1.0)
    unsure = uniform(like, one, *n, 33) > CONFIDENT_SHARE + 0.18 * uniform(like, one, *n, 1)
    doubtful = uniform(like, one, *n, 33) ** 0.7
    sure = 1 - 0.1 * uniform(like, one, *n, 33) ** 2
    confidence = torch.where(unsure, doubtful, sure)
    # Half of the error of a hand or foot is that of the joint before it.
    own = normal(like, *n, 33, 2)
    for limb in LIMBS:
        for parent, child in limb:
            if parent not in (11, 12, 23, 24):
                own[..., child, :] = 0.7 * own[..., parent, :] + 0.7 * own[..., child, :]
    own[..., 1:11, :] = 0.8 * own[..., :1, :] + 0.4 * own[..., 1:11, :]
    level = IMAGE_NOISE * torch.exp(0.5 * normal(like, *n, 1, 1))
    return own * level * (1 + (UNSURE_FACTOR - 1) * (1 - confidence[..., None])), confidence


def cut_by_edge(
    rays: Tensor, confidence: Tensor, persistence: Persistence
) -> tuple[Tensor, Tensor]:
    """Cut some people (n, WINDOW, 33, 2) at the image border: beyond it, the network guesses with
    low confidence.

    :return: the same, and confidences (n, WINDOW, 33).
    """
    n = len(rays)
    drawn = uniform(rays, (0.0, 1.0), n)
    angle = 0.5 * math.pi * sum((drawn >= share).float() for share in CUT_UP_TO)
    outwards = torch.stack([torch.sin(angle), torch.cos(angle)], 1)[:, None, None]  # y down
    height = (rays * outwards).sum(-1)
    low = height[:, MIDDLE].amin(1)
    high = height[:, MIDDLE].amax(1)
    edge = low + uniform(rays, (0.35, 1.0), n) * (high - low)
    beyond = (height - edge[:, None, None]).clamp(min=0) * chance(rays, CUT_SHARE, n)[:, None, None]
    guess = persistence.normal(33, 2) * (0.5 * beyond[..., None])
    pulled = uniform(rays, (0.0, 0.7), n, 1, 1) * beyond
    low_confidence = torch.where(beyond > 0, uniform(rays, (0.0, 0.3), n, WINDOW, 33), 1.0)
    return rays + guess - pulled[..., None] * outwards, confidence * low_confidence


def swap_sides(rays: Tensor) -> Tensor:
    """Swap left and right of the arms or the legs of some people (n, WINDOW, 33, 2)."""
    n = len(rays)
    parts = [rays[:, :, : _ARMS[0]]]
    for first, end in (_ARMS, _LEGS):
        swapped = chance(rays, SWAP_SHARE, n, 1) & chance(rays, SWAP_LASTS, n, WINDOW)
        group = rays[:, :, first:end]
        other = group.unflatten(2, (-1, 2)).flip(3).flatten(2, 3)
        parts.append(torch.where(swapped[..., None, None], other, group))
    return torch.cat(parts, 2)


def world_landmarks(points: Tensor, persistence: Persistence) -> Tensor:
    """Distort true keypoints (n, WINDOW, 33, 3), metres, in the axes of a camera that points at the
    person.
    """
    n = len(points)
    strength = torch.exp(0.4 * normal(points, n, 1, 1))
    out = _flattened_trunk(points, persistence)
    bend = persistence.normal(sum(map(len, LIMBS)), 3)
    bend = strength[..., None] * torch.cat(
        [LIMB_ACROSS * bend[..., :2], LIMB_DEPTH * bend[..., 2:]], -1
    )
    bends = iter(bend.unbind(2))
    for number, limb in enumerate(LIMBS):
        flipped = chance(points, FLIP_SHARE, n, 1) & chance(points, FLIP_LASTS, n, WINDOW)
        gain = uniform(points, ARM_GAIN if number < 2 else LEG_GAIN, n, 1) * torch.where(
            flipped, -1.0, 1.0
        )
        scale = torch.stack([torch.ones_like(gain), torch.ones_like(gain), gain], -1)
        for parent, child in limb:
            bone = points[:, :, child] - points[:, :, parent]
            error = next(bends) * bone.norm(dim=-1, keepdim=True)
            out[child] = out[parent] + bone * scale + error
    tilt, turn, roll = persistence.normal(3).unbind(-1)
    turned = torch.stack(out, 2) @ rotation_matrices(
        torch.stack([TILT * tilt, TURN * turn, 0.3 * TURN * roll], -1)
    )
    scaled = turned * torch.exp(SCALE_SPREAD * normal(points, n, 1, 1, 1))
    found = scaled + WORLD_NOISE_M * persistence.normal(33, 3)
    return found - hip_center(found)


def _flattened_trunk(points: Tensor, persistence: Persistence) -> list[Tensor]:
    """Return each keypoint (n, WINDOW, 3) after the trunk has tilted in depth as one; shoulders
    turn too little.
    """
    n = len(points)
    hips = hip_center(points)
    upper = points[:, :, :23] - hips
    middle = upper[:, :, 11:13, 2].mean(2, keepdim=True)
    shoulders = uniform(points, SHOULDER_GAIN, n, 1, 1)
    trunk = uniform(points, TRUNK_GAIN, n, 1, 1)
    depth = (upper[..., 2] - middle) * shoulders + middle * trunk
    z = hips[..., 2] + depth + 0.1 * persistence.normal(1) * upper[..., 1]
    upper_points = torch.cat([points[:, :, :23, :2], z[..., None]], -1)
    return list(torch.cat([upper_points, points[:, :, 23:]], 2).unbind(2))
