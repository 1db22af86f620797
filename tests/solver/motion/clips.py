# SPDX-License-Identifier: GPL-3.0-or-later
"""Synthetic clips, and the objective of a clip written down from its definition."""

from dataclasses import dataclass

import numpy as np
from scope.solver import (
    Keypoints2D,
    Keypoints3D,
    Measurements,
    Options,
    Priors,
    Stage,
    State,
    Weights,
    make_tree,
    rotations,
)
from scope.solver.gauss_newton.optimizer import SharedPriors, make_settings
from scope.solver.gauss_newton.terms import pack_priors
from scope.solver.motion.prior import MotionPrior, StandingPoints
from scope.solver.motion.problem import ClipProblem, MotionTerms
from scope.solver.motion.system import make_poses
from scope.solver.motion.views import View, pack_frames

from ..dense import complex_log, moved
from ..synthetic import INTRINSICS, forward, random_body, random_state

K = 6
P = 3
M = 10
FOCAL_WEIGHT = 7.0
FLAT = Options(stages=[Stage(Weights(joint_prior=0.0, joint_limits=0.0))], curvature=False)
PRIOR = MotionPrior(
    joints=np.linspace(0.1, 0.3, K), root_rotation=0.4, root_position=5.0, robust_joints=300.0,
    robust_root_rotation=200.0, robust_root_position=50.0, contact=800.0,
)  # fmt: skip
CAMERAS = [
    (np.eye(3), np.zeros(3)),
    (rotations.exp(np.array([0.1, 0.7, -0.2])), np.array([-2.5, 0.3, 1.5])),
]


def walk(rng, frames, body=None, step=0.05):
    """Return a body, its states over a random walk, and uneven times."""
    body = random_body(rng, K, P, M) if body is None else body
    R0, t0, Omega, beta = random_state(rng, len(body.parents) - 1, body.S.shape[2], angle=0.3)
    states = []
    for _ in range(frames):
        R0 = rotations.exp(step * rng.standard_normal(3)) @ R0
        t0 = t0 + 0.02 * rng.standard_normal(3)
        Omega = Omega @ rotations.exp(step * rng.standard_normal((len(Omega), 3)))
        states.append(State(R0, t0, Omega, beta))
    return body, states, np.cumsum(rng.uniform(0.02, 0.05, frames))


@dataclass
class Clip:
    """A clip seen by several cameras, as arrays and as the solver gets it."""

    body: object
    starts: list[State]
    times: np.ndarray
    pixels: list[np.ndarray]  # of each camera (T, M, 2)
    points: np.ndarray  # (T, M, 3), in the world
    stands: StandingPoints
    cameras: list

    def frames(self):
        index = np.arange(M)
        ones = np.ones(M)
        out = []
        for f in range(len(self.times)):
            views = []
            for k, (R, t) in enumerate(self.cameras):
                points = Keypoints3D(index, self.points[f], ones) if k == 0 else None
                views.append(
                    View(
                        Measurements(
                            INTRINSICS, Keypoints2D(index, self.pixels[k][f], ones), points
                        ),
                        R,
                        t,
                    )
                )
            out.append(views)
        return out

    def problem(self, prior=PRIOR, focal=True, pool=None):
        """Return the solver's problem, its poses at the start, and a system."""
        tree = make_tree(self.body, focal)
        packed = pack_priors(tree, Priors())
        views, _ = pack_frames(tree, self.frames(), packed)
        motion = MotionTerms.make(tree, self.times, prior, self.stands)
        settings = make_settings(FLAT, FLAT.schedule(cold=False))
        shared = SharedPriors(np.zeros(P), np.eye(P), FOCAL_WEIGHT if focal else None)
        problem = ClipProblem(tree, views, motion, shared, settings, pool)
        poses = make_poses(tree, problem.frames)
        for f, s in enumerate(self.starts):
            poses.R[f, 0] = s.R_camera_root
            poses.t[f, 0] = s.t_camera_root
            poses.Omega[f, 1:] = s.Omega
        poses.beta[:P] = self.starts[0].beta
        return problem, poses, problem.make_system()


def noisy_clip(seed, frames=6, cameras=2):
    """Return a clip whose measurements are near the states that it starts from."""
    rng = np.random.default_rng(seed)
    body, states, times = walk(rng, frames)
    pixels = [[] for _ in range(cameras)]
    points = []
    for s in states:
        p = forward(body, s.R_camera_root, s.t_camera_root, s.Omega, s.beta)[2]
        points.append(p + 0.02 * rng.standard_normal(p.shape))
        for k in range(cameras):
            R, t = CAMERAS[k]
            q = (p @ R.T + t) @ INTRINSICS.T
            pixels[k].append(q[:, :2] / q[:, 2:] + 5.0 * rng.standard_normal((M, 2)))
    stands = StandingPoints([1, M + K], rng.uniform(0.0, 1.0, (frames, 2)))
    return Clip(body, states, times, pixels, np.array(points), stands, CAMERAS[:cameras])


def gauss_newton_residuals(clip, prior=PRIOR, focal=True):
    """The function (d of all frames and globals) -> list of (residuals (n, w), weights (n,), sigmas
    (n,)).

    From the definition; analytic, so that complex steps give its Jacobian.
    """
    body = clip.body
    T = len(clip.times)
    n = 6 + 3 * K
    h = np.diff(clip.times)
    indices = np.asarray(clip.stands.indices)
    p = np.asarray(clip.stands.probability)
    table = prior.packed(K)

    def velocity(A, B, step):
        return complex_log(A.T @ B) / step

    def all_of_them(d):
        shared = d[T * n :]
        log_focal = shared[P] if focal else 0.0
        poses = []
        out = []
        for f in range(T):
            s = clip.starts[f]
            state = (s.R_camera_root, s.t_camera_root, s.Omega, clip.starts[0].beta)
            state = moved(body, state, np.concatenate([d[f * n : (f + 1) * n], shared[:P]]))
            R, t, points = forward(body, *state)
            poses.append((R, t, state[2], np.concatenate([points, t])))
            for (R_c, t_c), pixels in zip(clip.cameras, clip.pixels, strict=True):
                q = points @ R_c.T + t_c
                uv = (pixels[f] - INTRINSICS[:2, 2]) / np.diag(INTRINSICS)[:2]
                out.append(
                    (
                        np.exp(log_focal) * q[:, :2] / q[:, 2:] - uv,
                        np.full(M, 1e6),
                        np.full(M, 0.01),
                    )
                )
            out.append(
                (points - clip.points[f], np.full(M, Weights().keypoints3d), np.full(M, 0.1))
            )
        for f in range(2, T):
            mean = 0.5 * (h[f - 1] + h[f - 2])
            a = poses[f - 2]
            b = poses[f - 1]
            c = poses[f]
            rows = [
                (velocity(b[0][0], c[0][0], h[f - 1]) - velocity(a[0][0], b[0][0], h[f - 2])) / mean
            ]
            for k in range(K):
                rows.append(
                    (velocity(b[2][k], c[2][k], h[f - 1]) - velocity(a[2][k], b[2][k], h[f - 2]))
                    / mean
                )
            rows.append(((c[1][0] - b[1][0]) / h[f - 1] - (b[1][0] - a[1][0]) / h[f - 2]) / mean)
            out.append((np.array(rows), table[:, 0] * mean, 1.0 / table[:, 1]))
        for f in range(1, T):
            rows = poses[f][3][indices] - poses[f - 1][3][indices]
            out.append(
                (
                    rows,
                    prior.contact * np.minimum(p[f], p[f - 1]) / h[f - 1],
                    np.full(len(indices), np.inf),
                )
            )
        beta = clip.starts[0].beta + shared[:P]
        out.append((beta[:, None], np.full(P, Weights().shape), np.full(P, np.inf)))
        if focal:
            out.append((np.array([[log_focal]]), np.array([FOCAL_WEIGHT]), np.array([np.inf])))
        return out

    return all_of_them


def kernel(rows, sigmas):
    """Geman-McClure's rho (n,) and rho' of the rows' squares."""
    s = (np.real(rows) ** 2).sum(1)
    k = 1.0 / (1.0 + s / sigmas)
    return s * k, k * k


def cost_of(groups):
    """Return the cost of all residuals."""
    return 0.5 * sum(np.sum(w * kernel(r, sigma)[0]) for r, w, sigma in groups)
