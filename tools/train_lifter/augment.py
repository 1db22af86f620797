# SPDX-License-Identifier: GPL-3.0-or-later
"""Augment few recordings to many motions and proportions.

A pose is a state of each joint, Ω (24, 3, 3), and a root rotation into a world with y up; a motion is a window of poses
at the lifter's moments. Torso, arms and legs sometimes come from different recordings, joints are rotated at random
by a constant of the window, the body leans, some motions run slower, faster or backwards, and half of all samples are
mirrored. On request, the arms of a share of the samples hang as in some recording, see `Variety`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ...scope_addon.capture.perception.lifter_window import OFFSETS_S, WINDOW, ends_of_runs
from ...solver.body import Body
from ...solver.rotations import exp

_MIRROR = np.diag([-1.0, 1.0, 1.0])
# Share of samples in which a part comes from another frame.
SWAP_UPPER, SWAP_ARM, SWAP_LEG = 0.5, 0.4, 0.2
# Radians about a random axis, times a factor per sample of |N(0, 1)|.
JOINT_NOISE = {"shoulder": 0.45, "collar": 0.1, "elbow": 0.25, "wrist": 0.3, "hand": 0.2, "hip": 0.2, "knee": 0.2}
JOINT_NOISE |= {"ankle": 0.2, "foot": 0.1, "spine": 0.08, "neck": 0.15, "head": 0.2}
LEAN, STRONG_LEAN, STRONG_LEAN_SHARE = np.radians(7.0), np.radians(45.0), 0.1
AS_RECORDED = 0.25  # share of samples whose joints are not rotated
SPEED_SPREAD = 0.2  # of the logarithm of a motion's speed
SHAPE_SPREAD, SHAPE_LIMIT = 1.0, 2.5
BONE_SPREAD = 0.04  # of the logarithm of each bone's length, left and right alike
CLUSTERS = 256
# Hanging arms: the most that upper arms and forearms may be off straight down, and the share of JOINT_NOISE they get.
HANGING_UPPER, HANGING_FORE, HANGING_NOISE = np.radians(25.0), np.radians(45.0), 0.3


@dataclass(frozen=True)
class Motions:
    """Frames of all takes: ``Omega`` (F, 24, 3, 3) f32, row 0 the root into the world; (F,) ``take``, and ``fps``."""

    Omega: NDArray[np.float32]
    take: NDArray[np.intp]
    fps: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.Omega)

    def select(self, frames: NDArray[Any]) -> Motions:
        """Return only these frames (mask or indices)."""
        return Motions(self.Omega[frames], self.take[frames], self.fps[frames])

    @cached_property
    def ends(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return (F,) the first and (F,) the last frame of each frame's take."""
        return ends_of_runs(self.take)

    @cached_property
    def share(self) -> NDArray[np.float64]:
        """Return (F,) the probability of drawing a frame, so that common poses, such as walking, do not dominate.

        Proportional to 1/√(frames in the same cluster of joint states), clusters by k-means on Ω.
        """
        x = self.Omega[:, 1:].reshape(len(self), -1)
        rng = np.random.default_rng(0)
        centers = x[rng.choice(len(x), min(CLUSTERS, len(x)), replace=False)]
        for _ in range(5):
            label = np.argmin(np.square(centers).sum(1) - 2 * x @ centers.T, axis=1)
            count = np.bincount(label, minlength=len(centers))
            total = np.stack([np.bincount(label, x[:, d], len(centers)) for d in range(x.shape[1])], axis=1)
            centers = np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], centers).astype(x.dtype)
        share = 1 / np.sqrt(count[label])
        return share / share.sum()


def load_motions(path: Path) -> Motions:
    """Read the valid frames of a file written by ``tools.mocap.fit_body``."""
    with np.load(path) as data:
        poses, valid, start, fps = data["poses"], data["valid"], data["take_start"], data["take_fps"]
    take = np.repeat(np.arange(len(start) - 1), np.diff(start))
    Omega = exp(poses.reshape(len(poses), -1, 3).astype(float)).astype(np.float32)
    return Motions(Omega[valid], take[valid], fps[take[valid]])


class PoseSampler:
    """Draws augmented poses and shapes for one body.

    :raises ValueError: hanging arms are asked for, but no recording has any.
    """

    def __init__(self, body: Body, motions: Motions, hanging_share: float = 0.0) -> None:
        self.body, self.motions, self.hanging_share = body, motions, hanging_share
        self._cumulative = np.cumsum(motions.share)
        if hanging_share:
            self._hanging = np.cumsum(motions.share * arms_hang(body, motions.Omega))
            if not self._hanging[-1]:
                raise ValueError("in none of the recordings, both arms hang; ask for a share of 0")
        names = body.joint_names
        partner = {"left": "right", "right": "left"}
        self.partner = np.array([names.index("_".join(partner.get(w, w) for w in n.split("_"))) for n in names])
        roots = ("spine1", "left_collar", "right_collar", "left_hip", "right_hip")
        self._parts = [self._below(root) for root in roots]
        self._noise = np.array([next((v for k, v in JOINT_NOISE.items() if k in n), 0.0) for n in names])

    def _below(self, joint: str) -> NDArray[np.intp]:
        """Return the indices of the joint and of all its descendants."""
        inside = {self.body.joint_names.index(joint)}
        for i, parent in enumerate(self.body.parents):
            if int(parent) in inside:
                inside.add(i)
        return np.array(sorted(inside))

    def mirror(self, Omega: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the mirror image of poses (..., 24, 3, 3) about the body's (and the world's) x = 0."""
        signs = np.outer(np.diag(_MIRROR), np.diag(_MIRROR)).astype(Omega.dtype)
        return (Omega * signs)[..., self.partner, :, :]

    def _windows(
        self, rng: np.random.Generator, n: int, cumulative: NDArray[np.float64] | None = None
    ) -> NDArray[np.float32]:
        """Draw windows (n, WINDOW, 24, 3, 3) of one recording each; ``cumulative`` (F,) sums of the frames' shares."""
        cumulative = self._cumulative if cumulative is None else cumulative
        drawn = np.searchsorted(cumulative, rng.random(n) * cumulative[-1])
        middle = np.minimum(drawn, len(self.motions) - 1)
        speed = np.exp(SPEED_SPREAD * rng.standard_normal(n)) * np.where(rng.random(n) < 0.5, 1, -1)
        frames = np.round(OFFSETS_S * self.motions.fps[middle][:, None] * speed[:, None]).astype(int)
        first, last = (ends[middle][:, None] for ends in self.motions.ends)
        Omega = self.motions.Omega[np.clip(middle[:, None] + frames, first, last)]
        flip = rng.random(n) < 0.5
        Omega[flip] = self.mirror(Omega[flip])
        return Omega

    def motion_windows(self, rng: np.random.Generator, n: int) -> NDArray[np.float32]:
        """Draw windows (n, WINDOW, 24, 3, 3) f32; row 0 of a pose is R_world_root, y up, with a random heading."""
        Omega = self._windows(rng, n)
        for joints, share in zip(self._parts, (SWAP_UPPER, SWAP_ARM, SWAP_ARM, SWAP_LEG, SWAP_LEG), strict=True):
            rows = np.flatnonzero(rng.random(n) < share)
            other = self._windows(rng, len(rows))
            for joint in joints:
                Omega[rows, :, joint] = other[:, :, joint]
        strength = np.abs(rng.standard_normal((n, 1, 1), np.float32)) * (rng.random((n, 1, 1)) > AS_RECORDED)
        turn = rng.standard_normal((n, len(self._noise), 3), np.float32) * self._noise[:, None] * strength
        if self.hanging_share:
            self._let_arms_hang(rng, Omega, turn)
        _turn_joints(Omega, small_rotations(turn.astype(np.float32)))
        heading, direction = rng.uniform(0, 2 * np.pi, (2, n))
        lean = rng.standard_normal(n) * np.where(rng.random(n) < STRONG_LEAN_SHARE, STRONG_LEAN, LEAN)
        axis = np.stack([np.cos(direction), np.zeros(n), np.sin(direction)], axis=1)
        about_y = np.stack([np.zeros(n), heading, np.zeros(n)], axis=1)
        turned = small_rotations((axis * lean[:, None]).astype(np.float32)) @ small_rotations(
            about_y.astype(np.float32)
        )
        Omega[:, :, 0] = turned[:, None] @ Omega[:, :, 0]
        return Omega

    def _let_arms_hang(self, rng: np.random.Generator, Omega: NDArray[np.float32], turn: NDArray[np.float32]) -> None:
        """Replace the arms of some windows (n, WINDOW, 24, 3, 3), and reduce their rotations (n, 24, 3), in place."""
        rows = np.flatnonzero(rng.random(len(Omega)) < self.hanging_share)
        other = self._windows(rng, len(rows), self._hanging)
        for joint in np.concatenate(self._parts[1:3]):
            Omega[rows, :, joint] = other[:, :, joint]
            turn[rows, joint] *= HANGING_NOISE

    def pose(self, rng: np.random.Generator) -> NDArray[np.float32]:
        """Draw the pose (24, 3, 3) of one moment."""
        return self.motion_windows(rng, 1)[0, WINDOW // 2]

    def proportions(self, rng: np.random.Generator, n: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Draw bodies: joints relative to parents (n, 24, 3), BlazePose keypoints relative to joints (n, 33, 3)."""
        body, at = self.body, np.array(list(self.body.keypoint_set("blazepose").values()))
        betas = np.clip(rng.standard_normal((n, body.P)) * SHAPE_SPREAD, -SHAPE_LIMIT, SHAPE_LIMIT)
        factor = np.exp(rng.standard_normal((n, body.K + 1)) * BONE_SPREAD)
        factor = factor[:, np.minimum(np.arange(body.K + 1), self.partner)]
        bones = (body.l + np.einsum("ijp,np->nij", body.S, betas)) * factor[..., None]
        keypoints = body.v_bar[at] + np.einsum("ijp,np->nij", body.V[at], betas)
        return bones.astype(np.float32), keypoints.astype(np.float32)


def arms_hang(body: Body, Omega: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return (F,) bool: whether both upper arms and both forearms of poses (F, 24, 3, 3), y up, point down."""
    R, hang, at = [Omega[:, 0]], np.ones(len(Omega), bool), body.joint_names.index
    for k, parent in enumerate(body.parents[1:], 1):
        R.append(R[int(parent)] @ Omega[:, k])
    for side in ("left", "right"):
        for start, end, most in (("shoulder", "elbow", HANGING_UPPER), ("elbow", "wrist", HANGING_FORE)):
            bone = body.l[at(f"{side}_{end}")]
            hang &= -(R[at(f"{side}_{start}")] @ bone)[:, 1] > np.cos(most) * np.linalg.norm(bone)
    return hang


@njit(fastmath=True)
def _turn_joints(Omega: NDArray[np.float32], turn: NDArray[np.float32]) -> None:
    """Multiply Omega[a, w, k] by turn[a, k] from the right, in place."""
    for a in range(Omega.shape[0]):
        for w in range(Omega.shape[1]):
            for k in range(Omega.shape[2]):
                for i in range(3):
                    x, y, z = Omega[a, w, k, i, 0], Omega[a, w, k, i, 1], Omega[a, w, k, i, 2]
                    for j in range(3):
                        Omega[a, w, k, i, j] = x * turn[a, k, 0, j] + y * turn[a, k, 1, j] + z * turn[a, k, 2, j]


def small_rotations(phi: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return exp of rotation vectors (..., 3) in their own precision: I + sin θ/θ [φ] + (1 − cos θ)/θ² [φ]²."""
    x, y, z = np.moveaxis(phi, -1, 0)
    theta = np.sqrt(x * x + y * y + z * z) + 1e-8
    a, b = np.sin(theta) / theta, (1 - np.cos(theta)) / (theta * theta)
    R = np.empty((*phi.shape, 3), phi.dtype)
    R[..., 0, 0], R[..., 1, 1], R[..., 2, 2] = 1 - b * (y * y + z * z), 1 - b * (x * x + z * z), 1 - b * (x * x + y * y)
    R[..., 0, 1], R[..., 1, 0] = b * x * y - a * z, b * x * y + a * z
    R[..., 0, 2], R[..., 2, 0] = b * x * z + a * y, b * x * z - a * y
    R[..., 1, 2], R[..., 2, 1] = b * y * z - a * x, b * y * z + a * x
    return R
