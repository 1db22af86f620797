# SPDX-License-Identifier: GPL-3.0-or-later
"""What a detector makes of true keypoints: displaced and uncertain 2D keypoints, distorted world landmarks.

The detector's keypoints are not our body's: each lies at a constant offset in its body part (people differ in build
and clothes, detectors in what they call a hip). To this come errors of the image and, in the world landmarks, a whole
that is tilted, scaled and flattened, limbs that point elsewhere in depth, and now and then a limb mirrored in depth.
"""

from __future__ import annotations

import numpy as np

from .augment import small_rotations

# Metres, one standard deviation per coordinate, of where the detector sees a keypoint of a body part.
PLACEMENT = np.full(33, 0.012)
PLACEMENT[[11, 12]], PLACEMENT[[23, 24]], PLACEMENT[25:33] = 0.02, 0.025, 0.015
IMAGE_NOISE = 0.03  # of the person's size s (see lifter.py), times a factor per sample of exp(N(0, 0.5))
CONFIDENT_SHARE = 0.8
UNSURE_FACTOR = 3.5  # on the image noise of a keypoint with no confidence
SWAP_SHARE = 0.01  # samples in which the arms, or the legs, have left and right exchanged
CUT_SHARE = 0.12  # samples in which part of the body lies outside the picture
FOCAL_SPREAD = 0.1  # of the logarithm of the focal length assumed over the true one
# World landmarks. Depth is mostly too shallow: on renders the slope of arms is right by 0.3, of trunk and legs by 0.6.
UNKNOWN_SHARE = 0.3
TILT, TURN = np.radians(10.0), np.radians(9.0)
SCALE_SPREAD = 0.07
ARM_GAIN, LEG_GAIN, TRUNK_GAIN, SHOULDER_GAIN = (0.2, 1.1), (0.5, 1.1), (0.4, 1.1), (0.6, 1.1)
LIMB_DEPTH = 0.25  # error of a bone's slope in depth, over its length
LIMB_ACROSS = 0.1
WORLD_NOISE_M = 0.012
FLIP_SHARE = 0.05  # per limb: its depth relative to shoulder or hip has the wrong sign

# Each limb from the trunk outwards with what hangs on its ends.
LIMBS = (
    ((11, 13), (13, 15), (15, 17), (15, 19), (15, 21)),
    ((12, 14), (14, 16), (16, 18), (16, 20), (16, 22)),
    ((23, 25), (25, 27), (27, 29), (27, 31)),
    ((24, 26), (26, 28), (28, 30), (28, 32)),
)
SWAPPED = np.array([0, 4, 5, 6, 1, 2, 3, 8, 7, 10, 9, *(i + 1 - 2 * (i % 2 == 0) for i in range(11, 33))])
_ARMS = np.arange(11, 23)
_LEGS = np.arange(23, 33)


def image_errors(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Errors of 2D keypoints (n, 33, 2) in units of the person's size s, and confidences (n, 33)."""
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


def cut_by_edge(rng: np.random.Generator, rays: np.ndarray, confidence: np.ndarray) -> None:
    """Let the picture's edge cut some people, in place: beyond it, the network guesses with low confidence."""
    cut = np.flatnonzero(rng.random(len(rays)) < CUT_SHARE)
    angle = rng.choice(4, len(cut), p=[0.5, 0.1, 0.2, 0.2]) * np.pi / 2
    normal = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    height = np.einsum("njd,nd->nj", rays[cut], normal)
    low, high = height.min(axis=1), height.max(axis=1)
    edge = low + rng.uniform(0.35, 1.0, len(cut)) * (high - low)
    beyond = np.maximum(height - edge[:, None], 0.0)
    pulled = rng.uniform(0.0, 0.7, (len(cut), 1)) * beyond
    guess = rng.standard_normal((len(cut), 33, 2)) * (0.5 * beyond[..., None])
    rays[cut] += guess - pulled[..., None] * normal[:, None]
    confidence[cut] *= np.where(beyond > 0, rng.uniform(0, 0.3, (len(cut), 33)), 1.0)


def swap_sides(rng: np.random.Generator, rays: np.ndarray) -> None:
    """Exchange left and right of the arms or the legs of some people, in place."""
    for group in (_ARMS, _LEGS):
        rows = np.flatnonzero(rng.random(len(rays)) < SWAP_SHARE)
        rays[np.ix_(rows, group)] = rays[np.ix_(rows, SWAPPED[group])]


def world_landmarks(rng: np.random.Generator, points: np.ndarray) -> np.ndarray:
    """Distorted landmarks (n, 33, 3) of true keypoints (n, 33, 3), metres, in axes that look straight at the person."""
    n = len(points)

    def normal(*shape: int) -> np.ndarray:
        return rng.standard_normal((n, *shape), np.float32)

    strength = np.exp(0.4 * normal(1, 1))
    out = points.copy()
    # The trunk leans to and fro in depth as one, shoulders turn less than they should.
    hips = points[:, [23, 24]].mean(axis=1, keepdims=True)
    upper = points[:, :23] - hips
    middle = upper[:, [11, 12]].mean(axis=1, keepdims=True)[..., 2]
    depth = (upper[..., 2] - middle) * rng.uniform(*SHOULDER_GAIN, (n, 1)) + middle * rng.uniform(*TRUNK_GAIN, (n, 1))
    out[:, :23, 2] = hips[..., 2] + depth + 0.1 * normal(1) * upper[..., 1]
    for number, limb in enumerate(LIMBS):
        gain = rng.uniform(*(ARM_GAIN if number < 2 else LEG_GAIN), n) * np.where(rng.random(n) < FLIP_SHARE, -1.0, 1.0)
        scale = np.stack([np.ones(n), np.ones(n), gain], axis=1).astype(np.float32)
        for parent, child in limb:
            bone = points[:, child] - points[:, parent]
            length = np.linalg.norm(bone, axis=1, keepdims=True)
            error = normal(3) * np.array([LIMB_ACROSS, LIMB_ACROSS, LIMB_DEPTH], np.float32) * strength[:, 0]
            out[:, child] = out[:, parent] + bone * scale + error * length
    turn = np.stack([TILT * normal(), TURN * normal(), 0.3 * TURN * normal()], axis=1)
    out = out @ small_rotations(turn.astype(np.float32))
    out *= np.exp(SCALE_SPREAD * normal(1, 1))
    out += WORLD_NOISE_M * normal(33, 3)
    return (out - out[:, [23, 24]].mean(axis=1, keepdims=True)).astype(np.float32)
