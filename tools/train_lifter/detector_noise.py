# SPDX-License-Identifier: GPL-3.0-or-later
"""Simulated detector errors: displaced and uncertain 2D keypoints, distorted world landmarks.

The detector's keypoints differ from the body's: each has a constant offset in its body part, that of
`keypoint_offsets` and one specific to the person (people differ in build and clothes). Image errors are added and, in
the world landmarks, a tilt, scale and flattening of the whole, errors in the depth of limbs, and sometimes a limb
mirrored in depth.

Errors are correlated in time. The autocorrelation of errors in the depth of bones, of `pose_landmark_heavy` on footage
and renders with ground truth, is 0.8, 0.65, 0.5 and 0.5 after 0.1, 0.2, 0.4 and 0.8 seconds: half of the variance is
constant within the window, most of the rest changes within a few tenths of a second, see `Persistence`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...scope_addon.capture.fitting.keypoint_offsets import offset
from ...scope_addon.capture.perception.landmark_network import KEYPOINT_NAMES
from ...scope_addon.capture.perception.lifter_window import WINDOW
from .augment import small_rotations

# Metres, one standard deviation per coordinate, of a person's keypoint offsets.
PLACEMENT = np.full(33, 0.012)
PLACEMENT[[11, 12]], PLACEMENT[[23, 24]], PLACEMENT[25:33] = 0.02, 0.025, 0.015
IMAGE_NOISE = 0.03  # of the person's size s (see lifter.py), times a factor per sample of exp(N(0, 0.5))
CONFIDENT_SHARE = 0.8
UNSURE_FACTOR = 3.5  # on the image noise of a keypoint with no confidence
SWAP_SHARE = 0.01  # samples in which the arms, or the legs, have left and right swapped
CUT_SHARE = 0.12  # samples in which part of the body is outside the image
SWAP_LASTS = 0.7  # of the window's moments
CONFIDENCE_LASTS = 0.7  # of the keypoints keep their confidence through the window
# World landmarks. Depth is mostly too small: on renders by a factor of 0.3 for arms, 0.6 for trunk and legs.
UNKNOWN_SHARE = 0.3
TILT, TURN = np.radians(10.0), np.radians(9.0)
SCALE_SPREAD = 0.07
ARM_GAIN, LEG_GAIN, TRUNK_GAIN, SHOULDER_GAIN = (0.2, 1.1), (0.5, 1.1), (0.4, 1.1), (0.6, 1.1)
LIMB_DEPTH = 0.25  # error of a bone's slope in depth, over its length
LIMB_ACROSS = 0.1
WORLD_NOISE_M = 0.012
FLIP_SHARE = 0.05  # per limb: its depth relative to shoulder or hip has the wrong sign
FLIP_LASTS = 0.8  # of the window's moments
CONSTANT_SHARE, KEPT = (0.2, 0.8), (0.4, 0.9)  # see `Persistence`

# Each limb from the trunk outwards, with the keypoints attached to its ends.
LIMBS = (
    ((11, 13), (13, 15), (15, 17), (15, 19), (15, 21)),
    ((12, 14), (14, 16), (16, 18), (16, 20), (16, 22)),
    ((23, 25), (25, 27), (27, 29), (27, 31)),
    ((24, 26), (26, 28), (28, 30), (28, 32)),
)
MIRROR_PARTNER = np.array([0, 4, 5, 6, 1, 2, 3, 8, 7, 10, 9, *(i + 1 - 2 * (i % 2 == 0) for i in range(11, 33))])
_ARMS = np.arange(11, 23)
_LEGS = np.arange(23, 33)


@dataclass(frozen=True)
class Persistence:
    """Correlation in time of the errors of n people in a window of WINDOW moments, each standard normal.

        e_t = √ρ c + √(1 − ρ) z_t,   z_t = a z_{t−1} + √(1 − a²) w_t

    with c and w_t independent; ``constant`` (n,) is ρ, ``kept`` (n,) is a.
    """

    constant: NDArray[np.float32]
    kept: NDArray[np.float32]

    @staticmethod
    def draw(rng: np.random.Generator, n: int) -> Persistence:
        """Draw, for n people, the constant share of errors and the correlation from one moment to the next."""
        return Persistence(*(rng.uniform(*limits, n).astype(np.float32) for limits in (CONSTANT_SHARE, KEPT)))

    def of(self, rows: NDArray[Any]) -> Persistence:
        """Return the persistence of some of the people."""
        return Persistence(self.constant[rows], self.kept[rows])

    def mix(self, constant: NDArray[np.float32], white: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return e_t of c (n, 1, ...) and w_t (n, WINDOW, ...); overwrites the latter."""
        a = self.kept.reshape(-1, *[1] * (white.ndim - 2))
        b = np.sqrt(1 - a * a)
        for t in range(1, white.shape[1]):
            white[:, t] = a * white[:, t - 1] + b * white[:, t]
        rho = self.constant.reshape(-1, *[1] * (white.ndim - 1))
        return np.sqrt(rho) * constant + np.sqrt(1 - rho) * white

    def normal(self, rng: np.random.Generator, *shape: int) -> NDArray[np.float32]:
        """Draw e_t, (n, WINDOW, *shape)."""
        n = len(self.constant)
        constant = rng.standard_normal((n, 1, *shape), np.float32)
        return self.mix(constant, rng.standard_normal((n, WINDOW, *shape), np.float32))


def placements(rng: np.random.Generator, n: int, mean_offsets: bool = True) -> NDArray[np.float32]:
    """Draw keypoint offsets (n, 33, 3) f32, metres, of n people, in the axes of their parts.

    :param mean_offsets: around those of `keypoint_offsets`; otherwise around zero.
    """
    own = PLACEMENT[:, None] * rng.standard_normal((n, len(PLACEMENT), 3))
    mean = np.array([offset(name) for name in KEYPOINT_NAMES]) if mean_offsets else 0.0
    return (mean + own).astype(np.float32)


def image_errors(rng: np.random.Generator, persistence: Persistence) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Draw errors (n, WINDOW, 33, 2) of 2D keypoints, in units of the person's size s, and confidences."""
    n = len(persistence.constant)
    constant, lasting = moment_errors(rng, n)
    white, passing = (x.reshape(n, WINDOW, *x.shape[1:]) for x in moment_errors(rng, n * WINDOW))
    errors = persistence.mix(constant[:, None], white)
    confidence = np.where(rng.random((n, 1, 33)) < CONFIDENCE_LASTS, lasting[:, None], passing)
    return errors, confidence


def moment_errors(rng: np.random.Generator, n: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Draw errors of 2D keypoints (n, 33, 2) in units of the person's size s, and confidences (n, 33)."""
    unsure = rng.random((n, 33)) > CONFIDENT_SHARE + 0.18 * rng.random((n, 1))
    confidence = np.where(unsure, rng.random((n, 33)) ** 0.7, 1 - 0.1 * rng.random((n, 33)) ** 2)
    # Half of the error of a hand or foot is that of the joint before it.
    own = rng.standard_normal((n, 33, 2), np.float32)
    for limb in LIMBS:
        for parent, child in limb:
            if parent not in (11, 12, 23, 24):
                own[:, child] = 0.7 * own[:, parent] + 0.7 * own[:, child]
    own[:, 1:11] = 0.8 * own[:, :1] + 0.4 * own[:, 1:11]
    level = IMAGE_NOISE * np.exp(0.5 * rng.standard_normal((n, 1, 1), np.float32))
    return own * level * (1 + (UNSURE_FACTOR - 1) * (1 - confidence[..., None])), confidence


def cut_by_edge(
    rng: np.random.Generator, rays: NDArray[np.float32], confidence: NDArray[np.float32], persistence: Persistence
) -> None:
    """Cut some people at the image border, in place: beyond it, the network guesses with low confidence."""
    cut = np.flatnonzero(rng.random(len(rays)) < CUT_SHARE)
    angle = rng.choice(4, len(cut), p=[0.5, 0.1, 0.2, 0.2]) * np.pi / 2
    normal = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    height = np.einsum("nwjd,nd->nwj", rays[cut], normal)
    low, high = height[:, WINDOW // 2].min(axis=1), height[:, WINDOW // 2].max(axis=1)
    edge = low + rng.uniform(0.35, 1.0, len(cut)) * (high - low)
    beyond = np.maximum(height - edge[:, None, None], 0.0)
    pulled = rng.uniform(0.0, 0.7, (len(cut), 1, 1)) * beyond
    guess = persistence.of(cut).normal(rng, 33, 2) * (0.5 * beyond[..., None])
    rays[cut] += (guess - pulled[..., None] * normal[:, None, None]).astype(rays.dtype)
    confidence[cut] *= np.where(beyond > 0, rng.uniform(0, 0.3, (len(cut), WINDOW, 33)), 1.0)


def swap_sides(rng: np.random.Generator, rays: NDArray[np.float32]) -> None:
    """Swap left and right of the arms or the legs of some people (n, WINDOW, 33, 2), in place."""
    n = len(rays)
    for group in (_ARMS, _LEGS):
        people, moments = np.nonzero((rng.random(n) < SWAP_SHARE)[:, None] & (rng.random((n, WINDOW)) < SWAP_LASTS))
        rays[people[:, None], moments[:, None], group] = rays[people[:, None], moments[:, None], MIRROR_PARTNER[group]]


def world_landmarks(
    rng: np.random.Generator, points: NDArray[np.float32], persistence: Persistence
) -> NDArray[np.float32]:
    """Distort true keypoints (n, WINDOW, 33, 3), metres, in the axes of a camera that points at the person."""
    n, W = points.shape[:2]

    def normal(*shape: int) -> NDArray[np.float32]:
        return rng.standard_normal((n, 1, *shape), np.float32)

    def lasting(*shape: int) -> NDArray[np.float32]:
        return persistence.normal(rng, *shape)

    strength = np.exp(0.4 * normal(1, 1))
    out = points.copy()
    # The trunk tilts in depth as one; shoulders turn too little.
    hips = points[:, :, [23, 24]].mean(axis=2, keepdims=True)
    upper = points[:, :, :23] - hips
    middle = upper[:, :, [11, 12]].mean(axis=2)[..., 2:]
    shoulders, trunk = (rng.uniform(*gain, (n, 1, 1)) for gain in (SHOULDER_GAIN, TRUNK_GAIN))
    depth = (upper[..., 2] - middle) * shoulders + middle * trunk
    out[:, :, :23, 2] = hips[..., 2] + depth + 0.1 * lasting(1) * upper[..., 1]
    for number, limb in enumerate(LIMBS):
        flipped = (rng.random((n, 1)) < FLIP_SHARE) & (rng.random((n, W)) < FLIP_LASTS)
        gain = rng.uniform(*(ARM_GAIN if number < 2 else LEG_GAIN), (n, 1)) * np.where(flipped, -1.0, 1.0)
        scale = np.stack([np.ones((n, W)), np.ones((n, W)), gain], axis=-1).astype(np.float32)
        for parent, child in limb:
            bone = points[:, :, child] - points[:, :, parent]
            length = np.linalg.norm(bone, axis=-1, keepdims=True)
            error = lasting(3) * np.array([LIMB_ACROSS, LIMB_ACROSS, LIMB_DEPTH], np.float32) * strength[..., 0]
            out[:, :, child] = out[:, :, parent] + bone * scale + error * length
    turn = np.stack([TILT * lasting(), TURN * lasting(), 0.3 * TURN * lasting()], axis=-1)
    out = out @ small_rotations(turn.astype(np.float32))
    out *= np.exp(SCALE_SPREAD * normal(1, 1))
    out += WORLD_NOISE_M * lasting(33, 3)
    return (out - out[:, :, [23, 24]].mean(axis=2, keepdims=True)).astype(np.float32)
