# SPDX-License-Identifier: GPL-3.0-or-later
r"""SMPLify's objective for one frame, with what this body and these keypoints have.

    E = Σ_i w_i ρ(Π(x_i) − p_i) + λ_θ (θ − μ)ᵀ Σ⁻¹ (θ − μ) + λ_β ‖β‖² + λ_a Σ_bends exp(θ)²
with the Geman-McClure ρ(e) = σ² ‖e‖² / (σ² + ‖e‖²), σ = 100 px, of keypoints p_i with confidence
w_i. The pose prior is one Gaussian instead of a mixture of eight, over the rotation vectors of all
recordings in ../shared; interpenetration is left out. The weights fall in four stages, as there.
Where 3D keypoints q_i are given, as Fan et al. (ICCV 2021) gave it some, it also has
    λ_3 Σ_i c_i ‖(x_i − x̄) − (q_i − q̄)‖², relative to the means of all.
Source: Bogo et al., Keep it SMPL, ECCV 2016; the weights are those of its published code.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ...solver import Body, Keypoints3D
from ...solver.rotations import exp
from ...tools.render_sample.truth import project
from .dense import Minimum, minimize

SIGMA_PX = 100.0
STAGES = ((404.0, 100.0), (404.0, 50.0), (57.4, 10.0), (4.78, 5.0))  # λ_θ, λ_β
BEND = 15.0  # λ_a
# λ_3: 8 cm count as much as 100 px at this kernel's width do
LAMBDA_3D = (SIGMA_PX / 0.08) ** 2
LIMIT = 60
TOLERANCE = 1e-4
START_LIMIT = 30
ROOT = 6  # rotation vector and translation of the root
TRUNK = ("left_shoulder", "right_shoulder", "left_hip", "right_hip")
UPRIGHT = np.diag([1.0, -1.0, -1.0])  # camera from model: upright, facing the camera
Vector = NDArray[np.float64]


@dataclass(frozen=True)
class PosePrior:
    """A Gaussian over the rotation vectors of all joints but the root."""

    mean: Vector  # (3K,)
    whitening: Vector  # (3K, 3K): W with WᵀW = Σ⁻¹

    @classmethod
    def of(cls, poses: Vector) -> PosePrior:
        """Fit the Gaussian to poses (n, 3K); its standard deviations are at least one degree."""
        covariance = np.cov(poses.T) + np.radians(1.0) ** 2 * np.eye(poses.shape[1])
        return cls(poses.mean(axis=0), np.linalg.inv(np.linalg.cholesky(covariance)))


@dataclass(frozen=True)
class Frame:
    """What is known of one frame."""

    names: tuple[str, ...]  # of the keypoints
    pixels: Vector  # (J, 2)
    confidence: Vector  # (J,)
    intrinsics: Vector  # (3, 3)
    points: Keypoints3D | None = None  # numbered as on the body, for `LAMBDA_3D`


class Objective:
    """The residuals of one frame; unknowns are the root's rotation vector and translation, 3K
    angles and β.
    """

    def __init__(self, body: Body, prior: PosePrior, frame: Frame) -> None:
        self.body = body
        self.prior = prior
        self.frame = frame
        points = body.keypoint_set("blazepose")
        self.at = np.array([points[name] for name in frame.names])
        self.trunk = np.array([frame.names.index(name) for name in TRUNK])
        bends = [
            ("left_knee", 0, -1.0),
            ("right_knee", 0, -1.0),
            ("left_elbow", 1, 1.0),
            ("right_elbow", 1, -1.0),
        ]
        self.bends = np.array(
            [ROOT + 3 * (body.joint_names.index(name) - 1) + axis for name, axis, _ in bends]
        )
        self.signs = np.array([sign for *_, sign in bends])
        self.n = ROOT + 3 * body.K + body.P

    def fit(self) -> Minimum:
        """Return the minimum of the last stage, from the best of four headings."""
        starts = [self._place(np.radians(heading)) for heading in (0, 90, 180, 270)]
        found = min(starts, key=lambda start: start.cost)
        x = found.x
        iterations = sum(start.iterations for start in starts)
        for pose_weight, shape_weight in STAGES:
            residuals = partial(self.residuals, pose_weight=pose_weight, shape_weight=shape_weight)
            found = minimize(residuals, x, np.ones(self.n, bool), LIMIT, TOLERANCE)
            x = found.x
            iterations = iterations + found.iterations
        return Minimum(x, found.cost, iterations)

    def pose(self, x: Vector) -> tuple[Vector, Vector, Vector]:
        """Return joint states (B, K+1, 3, 3), translations (B, 3) and shapes (B, P) of unknowns (B,
        n).
        """
        K = self.body.K
        vectors = np.concatenate([x[:, :3], x[:, ROOT : ROOT + 3 * K]], axis=1).reshape(
            len(x), K + 1, 3
        )
        states = exp(vectors)
        states[:, 0] = UPRIGHT @ states[:, 0]
        return states, x[:, 3:ROOT], x[:, ROOT + 3 * K :]

    def joints(self, x: Vector) -> Vector:
        """Return the joints (K+1, 3) of one vector of unknowns, in the camera frame, metres."""
        states, trans, betas = self.pose(x[None])
        joints: Vector = self.body.forward_kinematics(states[0], trans[0], betas[0])[1]
        return joints

    def residuals(self, x: Vector, pose_weight: float, shape_weight: float) -> Vector:
        """Return the residuals (B, m) of unknowns (B, n)."""
        K = self.body.K
        theta = x[:, ROOT : ROOT + 3 * K]
        betas = x[:, ROOT + 3 * K :]
        off = self._offsets(x)
        squared = (off**2).sum(axis=-1, keepdims=True)
        robust = (
            off
            * (SIGMA_PX / np.sqrt(SIGMA_PX**2 + squared))
            * np.sqrt(self.frame.confidence)[:, None]
        )
        prior = np.sqrt(pose_weight) * (theta - self.prior.mean) @ self.prior.whitening.T
        bends = BEND * np.exp(np.clip(self.signs * x[:, self.bends], -10, 3))
        parts = [robust.reshape(len(x), -1), prior, np.sqrt(shape_weight) * betas, bends]
        if self.frame.points is not None:
            parts.append(self._offsets_in_space(x, self.frame.points))
        return np.concatenate(parts, axis=1)

    def _offsets_in_space(self, x: Vector, seen: Keypoints3D) -> Vector:
        """Return weighted differences (B, 3 J) from the 3D keypoints, without the means of both."""
        numbers = np.asarray(seen.indices)
        measured = np.asarray(seen.points, dtype=float)
        weight = np.asarray(seen.confidence, dtype=float)[:, None]
        off = self._points(x, numbers) - measured
        off = off - (weight * off).sum(axis=-2, keepdims=True) / weight.sum()
        return (np.sqrt(LAMBDA_3D * weight) * off).reshape(len(x), -1)

    def _offsets(self, x: Vector) -> Vector:
        """Return projected minus seen keypoints (B, J, 2), pixels."""
        points = self._points(x, self.at)
        points[..., 2] = np.maximum(points[..., 2], 0.1)
        return project(points, self.frame.intrinsics) - self.frame.pixels

    def _points(self, x: Vector, numbers: NDArray[np.intp]) -> Vector:
        """Return keypoints and joints (B, J, 3) of these numbers, in the camera frame."""
        states, trans, betas = self.pose(x)
        points = np.empty((len(x), len(numbers), 3))
        # most points of a Jacobian share theirs
        shapes, of = np.unique(betas, axis=0, return_inverse=True)
        for k, shape in enumerate(shapes):
            rows = of.reshape(-1) == k
            R, t = self.body.forward_kinematics(states[rows], trans[rows], shape)
            everything = np.concatenate([self.body.keypoints(R, t, shape), t], axis=1)
            points[rows] = everything[:, numbers]
        return points

    def _place(self, heading: float) -> Minimum:
        """Return root rotation and translation that fit the trunk, with the prior's mean pose, from
        one heading.
        """
        x = np.zeros(self.n)
        x[1] = heading
        x[ROOT : ROOT + 3 * self.body.K] = self.prior.mean
        rest = self.body.keypoints(
            *self.body.forward_kinematics(*(each[0] for each in self.pose(x[None])))
        )[self.at]
        shoulders = self.trunk[:2]
        hips = self.trunk[2:]
        pixels = self.frame.pixels
        K = self.frame.intrinsics
        tall_px = np.linalg.norm(pixels[shoulders].mean(axis=0) - pixels[hips].mean(axis=0))
        tall_m = np.linalg.norm(rest[shoulders].mean(axis=0) - rest[hips].mean(axis=0))
        depth = K[0, 0] * tall_m / max(float(tall_px), 1.0)
        ray = np.linalg.solve(K, np.append(pixels[self.trunk].mean(axis=0), 1.0))
        x[3:ROOT] = depth * ray - rest[self.trunk].mean(axis=0)
        free = np.arange(self.n) < ROOT
        return minimize(
            lambda x: self._offsets(x)[:, self.trunk].reshape(len(x), -1),
            x,
            free,
            START_LIMIT,
            TOLERANCE,
        )
