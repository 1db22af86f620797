# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras, clocks, bones and keypoints of a clip as one problem (bundle adjustment).

    minimize  sum over k, n of c rho(|r_kn|^2 / sigma^2) + priors
              + sum over frames, bones of rho(log(|X_a - X_b| / L_ab)^2 (M_ab / sigma_L)^2),
    r_kn = s_k pi(R_k X_n + t_k) - x_kn(t_n + tau_k + d_k (t_n - t_mean))

over the keypoints X_n in the first camera's axes, the lengths L of bones, which are the same in all
frames and on both sides (M: the mean body's), and of each camera k its pose R_k, t_k
(R_camera_first), the scale s_k of its focal length, and the offset tau_k and the drift d_k of its
clock. x_kn are rays between frames, by linear interpolation, c is the confidence, rho(s) = log(1 +
s). The first camera has R = 1, t = 0, tau = 0, d = 0.

A person who fills a small part of two images hardly shows perspective there, and two such images do
not tell the angle between their cameras (Koenderink and van Doorn 1991). Lengths that do not change
while the body moves do. Their prior, an adult's bones, gives the whole its size.

The points of a frame depend on no other frame's, so they are eliminated from the normal equations
(Schur complement), and a dense system of 9 unknowns a camera and one a bone is left.

Sources: Triggs et al. 2000, Bundle adjustment - a modern synthesis; Albl et al. 2017 for the
offsets of unsynchronized cameras, whose points move linearly between frames.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....solver.rotations import exp
from ...arrays import BoolArray, Float64Array, unit_vectors
from ..camera.bundle_adjustment import (
    damped_steps,
    pose_jacobian,
    projected,
    projection_jacobian,
)
from .seen_person import BONE_ENDS, BONE_OF_ROW, BONE_STARTS, MIN_CONFIDENCE, SeenPerson

KEYPOINT_SIGMA = 0.004  # of a keypoint, normalized image coordinates
# Of a bone's length in one frame: networks place hips and shoulders by 1 to 3 cm differently from
# the front and from the side.
BONE_SIGMA_M = 0.02
BONE_PRIOR = 0.07  # relative deviation of a length from the mean body's
# A network's errors are alike in neighbouring frames and keypoints, so that this share of them
# counts against priors. With 0.1, focal lengths of two phones that are known to 3 and 20 % end 2
# and 8 % off, with all of them 13 and 11 %; with 0.01, offsets get worse.
_INDEPENDENT = 0.03
_UNKNOWNS = 9  # of a camera: rotation 3, position 3, logarithm of the focal scale, offset, drift
_FOCAL = 6
_CLOCK = 7
_DRIFT = 8
_CLOCK_SIGMA_S = 0.1  # of the offset that the bundle starts from
DRIFT_SIGMA = 1e-4  # of clocks: those of phones differ by up to 0.1 s in twenty minutes
_MOST_TRIALS = 60
NEAREST_M = 0.2  # the least distance of a keypoint from a camera


@dataclass(frozen=True)
class CameraPlace:
    """Where a camera is, in the first camera's axes, and its clock and focal length."""

    R_camera_first: Float64Array  # (3, 3)
    t_camera_first: Float64Array  # (3,) metres
    log_focal: float = 0.0  # of the true focal length over the assumed one
    offset_s: float = 0.0  # its clock less the first camera's, when that shows 0
    drift: float = 0.0  # by how many seconds a second its clock is faster than the first one's
    # Standard deviations of the two, and of the pose: rotation in radians, position in metres.
    focal_sigma: float = 0.0
    offset_sigma_s: float = 0.0
    rotation_sigma: float = 0.0
    position_sigma_m: float = 0.0

    @classmethod
    def first(cls) -> CameraPlace:
        """Return the place of the first camera."""
        return cls(np.eye(3), np.zeros(3))

    def of(self, points: Float64Array) -> Float64Array:
        """Return points (..., 3) of the first camera's axes in this camera's."""
        return points @ self.R_camera_first.T + self.t_camera_first

    def own_times(self, times: Float64Array) -> Float64Array:
        """Return times (...) of the first camera's clock as this one's shows them, seconds."""
        return times + self.offset_s + self.drift * times

    def first_times(self, times: Float64Array) -> Float64Array:
        """Return times (...) of this camera's clock as the first one's shows them, seconds."""
        return (times - self.offset_s) / (1.0 + self.drift)

    @property
    def center(self) -> Float64Array:
        """The camera in the first camera's axes, metres."""
        return -self.R_camera_first.T @ self.t_camera_first


@dataclass(frozen=True)
class Given:
    """What is known of a camera before its pictures are compared with others'."""

    focal_sigma: float = 0.0  # relative error of its focal length; 0: it is known
    offset_s: float | None = None  # of its clock; None: unknown
    # (4, 4) from the first camera's axes to its own, metres; None: unknown
    T_camera_first: Float64Array | None = None
    drift: float = 0.0  # of its clock
    # Standard deviation of the clock, as sound tells it, seconds; 0: it stays as it is.
    offset_sigma_s: float = 0.0

    @property
    def without_clock(self) -> Given:
        """The same, with nothing known of the clock."""
        return replace(self, offset_s=None, drift=0.0, offset_sigma_s=0.0)


@dataclass(frozen=True)
class AdjustedCameras:
    """Adjusted cameras, the cost, and how many keypoints at least two cameras see."""

    cameras: list[CameraPlace]
    cost: float
    known: int


@dataclass(frozen=True)
class _Unknowns:
    """All that is adjusted."""

    cameras: list[CameraPlace]
    lengths: Float64Array
    points: Float64Array

    def moved(self, step: Float64Array, points: Float64Array, mean_s: float) -> _Unknowns:
        """Return them after a step of cameras and lengths, and one of the points.

        :param mean_s: the time for which the steps of offsets are.
        """
        count = len(self.cameras)
        of_cameras = step[: count * _UNKNOWNS].reshape(count, _UNKNOWNS)
        return _Unknowns(
            [
                _moved(place, own, mean_s)
                for place, own in zip(self.cameras, of_cameras, strict=True)
            ],
            self.lengths * np.exp(step[count * _UNKNOWNS :]),
            self.points + points,
        )


def adjust(
    people: Sequence[SeenPerson],
    cameras: Sequence[CameraPlace],
    times: Float64Array,
    given: Sequence[Given],
    mean_lengths: Float64Array,
) -> AdjustedCameras:
    """Adjust cameras to what they see of one person.

    :param people: the person as each of the V cameras sees them.
    :param cameras: where to start; the first one is at the origin.
    :param times: (N,) of the first camera's clock, seconds.
    :param given: (V,) what is known of the cameras, which stays as `cameras` has it.
    :param mean_lengths: (B,) the bones of the mean body, or of one of the person's stature, metres.
    """
    problem = _Problem(people, times, list(cameras), given, mean_lengths)
    start = triangulate(*problem.observed(cameras), cameras)
    now = _Unknowns(list(cameras), mean_lengths.copy(), start)
    best, cost = damped_steps(
        now, problem.cost, problem.step_from, 1e-3, _MOST_TRIALS, rise=10.0, least_damping=1e-9
    )
    return problem.result(best, cost)


def triangulate(
    rays: Float64Array, confidence: Float64Array, cameras: Sequence[CameraPlace]
) -> Float64Array:
    """Return the points (..., 3), first camera's axes, that are nearest to the rays of all cameras.

    :param rays: (V, ..., 2) normalized image coordinates. :param confidence: (V, ...).
    """
    A = np.zeros((*confidence.shape[1:], 3, 3))
    b = np.zeros((*confidence.shape[1:], 3))
    for ray, weight, camera in zip(rays, confidence, cameras, strict=True):
        line = np.concatenate(
            [ray / np.exp(camera.log_focal), np.ones((*ray.shape[:-1], 1))], axis=-1
        )
        line = unit_vectors(line) @ camera.R_camera_first
        across = np.eye(3) - line[..., :, None] * line[..., None, :]
        across = across * weight[..., None, None]
        A += across
        b += across @ camera.center
    A += 1e-9 * np.eye(3)
    return np.linalg.solve(A, b[..., None])[..., 0]


def _moved(place: CameraPlace, step: Float64Array, mean_s: float) -> CameraPlace:
    turn = exp(step[:3])
    return replace(
        place,
        R_camera_first=turn @ place.R_camera_first,
        t_camera_first=turn @ place.t_camera_first + step[3:6],
        log_focal=place.log_focal + float(step[_FOCAL]),
        offset_s=place.offset_s + float(step[_CLOCK] - step[_DRIFT] * mean_s),
        drift=place.drift + float(step[_DRIFT]),
    )


@dataclass
class _System:
    """The normal equations H d = -g of cameras and lengths, and of each frame's points."""

    H_global: Float64Array  # (G, G)
    g_global: Float64Array  # (G,)
    H_points: Float64Array  # (N, n, 3, n, 3)
    g_points: Float64Array  # (N, n, 3)
    coupling: Float64Array  # (N, G, n, 3)
    is_free: BoolArray  # (G,)

    @classmethod
    def empty(cls, is_free: BoolArray, frames: int, keypoints: int) -> _System:
        """Return equations of no measurement."""
        G = len(is_free)
        return cls(
            np.zeros((G, G)),
            np.zeros(G),
            np.zeros((frames, keypoints, 3, keypoints, 3)),
            np.zeros((frames, keypoints, 3)),
            np.zeros((frames, G, keypoints, 3)),
            is_free,
        )

    def solve(self, damping: float) -> tuple[Float64Array, Float64Array]:
        """Return the steps of cameras and lengths (G,) and of points (N, n, 3)."""
        S, reduced, from_global, alone = self._reduced(damping)
        free = self.is_free
        step = np.zeros(len(free))
        step[free] = np.linalg.solve(S[np.ix_(free, free)], -reduced[free])
        points = -(alone + from_global @ step)
        return step, points.reshape(len(points), -1, 3)

    def sigmas(self) -> Float64Array:
        """Return the (G,) standard deviations of cameras and lengths."""
        S, *_ = self._reduced(1e-9)
        free = self.is_free
        variance = np.zeros(len(free))
        variance[free] = np.diag(np.linalg.pinv(S[np.ix_(free, free)], rcond=1e-12))
        return np.sqrt(np.maximum(variance, 0.0) / _INDEPENDENT)

    def _reduced(
        self, damping: float
    ) -> tuple[Float64Array, Float64Array, Float64Array, Float64Array]:
        """Return the Schur complement and its gradient, and the points' steps: by step of a global
        unknown (N, 3n, G), and alone (N, 3n).
        """
        N, size, n, _ = self.coupling.shape
        damped = self.H_points.reshape(N, 3 * n, 3 * n).copy()
        np.einsum("nii->ni", damped)[:] += damping * np.einsum("nii->ni", damped) + 1e-6
        coupling = self.coupling.reshape(N, size, 3 * n)
        both = np.concatenate(
            [np.swapaxes(coupling, 1, 2), self.g_points.reshape(N, 3 * n, 1)], axis=2
        )
        solved = np.linalg.solve(damped, both)
        from_global = solved[:, :, :-1]
        alone = solved[:, :, -1]
        rows = np.swapaxes(coupling, 0, 1).reshape(size, -1)
        S = self.H_global + damping * np.diag(np.diag(self.H_global))
        S = S - rows @ from_global.reshape(-1, size)
        return S, self.g_global - rows @ alone.ravel(), from_global, alone


class _Problem:
    """What is given of a bundle."""

    def __init__(
        self,
        people: Sequence[SeenPerson],
        times: Float64Array,
        start: list[CameraPlace],
        given: Sequence[Given],
        mean_lengths: Float64Array,
    ) -> None:
        self.people = people
        self.times = times
        self.mean_s = float(times.mean()) if len(times) else 0.0
        self.start = start
        self.focal_sigma = [each.focal_sigma for each in given]
        self.clock_sigma_s = [each.offset_sigma_s or _CLOCK_SIGMA_S for each in given]
        self.mean_lengths = mean_lengths
        of_cameras = np.ones((len(people), _UNKNOWNS), bool)
        for free, each in zip(of_cameras, given, strict=True):
            free[:_FOCAL] = each.T_camera_first is None
            free[_FOCAL] = each.focal_sigma > 0
            free[_CLOCK:] = each.offset_s is None or each.offset_sigma_s > 0
        of_cameras[0, :_FOCAL] = False
        of_cameras[0, _CLOCK:] = False
        self.is_free = np.append(of_cameras.ravel(), np.ones(len(mean_lengths), bool))

    def observed(self, places: Sequence[CameraPlace]) -> tuple[Float64Array, Float64Array]:
        """Return rays (V, N, n, 2) and their confidence (V, N, n) at the cameras' own times; a
        keypoint that fewer than two cameras see has none.
        """
        at = [
            person.at(place.own_times(self.times))
            for person, place in zip(self.people, places, strict=True)
        ]
        rays = np.array([each.rays for each in at])
        confidence = np.array([each.confidence for each in at])
        confidence[confidence < MIN_CONFIDENCE] = 0.0
        confidence *= (confidence > 0).sum(axis=0) >= 2
        return rays, confidence

    def cost(self, now: _Unknowns) -> float:
        """Return the sum of all terms."""
        rays, confidence = self.observed(now.cameras)
        total = self._prior_cost(now)
        for ray, weight, place in zip(rays, confidence, now.cameras, strict=True):
            residual, depth = image_residual(ray, place, now.points)
            square = np.square(residual).sum(axis=-1) / KEYPOINT_SIGMA**2
            square = np.where(depth > NEAREST_M, square, 1e4)
            total += float((weight * np.log1p(square)).sum())
        known = (confidence > 0).any(axis=0)
        stretch = self._stretch(now)[0]
        weight = (known[:, BONE_STARTS] & known[:, BONE_ENDS]).astype(float)
        return total + float((weight * np.log1p(np.square(stretch / BONE_SIGMA_M))).sum())

    def _prior_cost(self, now: _Unknowns) -> float:
        lengths = np.log(now.lengths / self.mean_lengths) / BONE_PRIOR
        total = float(np.square(lengths).sum())
        for v, (place, start) in enumerate(zip(now.cameras, self.start, strict=True)):
            later_s, faster = self._clock_change(place, start)
            total += (later_s / self.clock_sigma_s[v]) ** 2 + (faster / DRIFT_SIGMA) ** 2
            if self.focal_sigma[v] > 0:
                total += (place.log_focal / self.focal_sigma[v]) ** 2
        return total / _INDEPENDENT

    def _clock_change(self, place: CameraPlace, start: CameraPlace) -> tuple[float, float]:
        """Return by how much a clock is ahead of where it started, at the mean time, and faster."""
        faster = place.drift - start.drift
        return place.offset_s - start.offset_s + faster * self.mean_s, faster

    def step_from(self, now: _Unknowns) -> Callable[[float], _Unknowns]:
        """Return a function that gives the unknowns after a step with some damping."""
        system = self.linearize(now)
        return lambda damping: now.moved(*system.solve(damping), self.mean_s)

    def linearize(self, now: _Unknowns) -> _System:
        """Return the normal equations, by iterated weights."""
        N, n = now.points.shape[:2]
        system = _System.empty(self.is_free, N, n)
        rays, confidence = self.observed(now.cameras)
        flat = now.points.reshape(-1, 3)
        each = np.arange(n)
        for v, place in enumerate(now.cameras):
            own = slice(v * _UNKNOWNS, (v + 1) * _UNKNOWNS)
            speed = self._speed(v, place).reshape(-1, 2)
            residual, depth = image_residual(rays[v].reshape(-1, 2), place, flat)
            square = np.square(residual).sum(axis=-1) / KEYPOINT_SIGMA**2
            weight = (
                confidence[v].ravel() * (depth > NEAREST_M) / (1.0 + square) / KEYPOINT_SIGMA**2
            )
            since_mean_s = np.repeat(self.times - self.mean_s, n)
            J_point, J_camera = _derivatives(place, flat, speed, since_mean_s)
            weighted_camera = J_camera * weight[:, None, None]
            weighted_point = J_point * weight[:, None, None]
            system.H_global[own, own] += np.einsum("mri,mrj->ij", weighted_camera, J_camera)
            system.g_global[own] += np.einsum("mri,mr->i", weighted_camera, residual)
            block = np.swapaxes(weighted_point, 1, 2) @ J_point
            system.H_points[:, each, :, each, :] += np.swapaxes(block.reshape(N, n, 3, 3), 0, 1)
            pull = np.einsum("mrp,mr->mp", weighted_point, residual)
            system.g_points += pull.reshape(N, n, 3)
            between = np.swapaxes(weighted_camera, 1, 2) @ J_point
            system.coupling[:, own] += np.swapaxes(between.reshape(N, n, _UNKNOWNS, 3), 1, 2)
        known = (confidence > 0).any(axis=0)
        self._add_bones(now, known, system)
        self._add_priors(now, system)
        return system

    def _stretch(self, now: _Unknowns) -> tuple[Float64Array, Float64Array]:
        """Return by how much bones are too long (N, rows), metres of the mean body, and the
        derivative (N, rows, 3) by the position of their ends.
        """
        bones = now.points[:, BONE_ENDS] - now.points[:, BONE_STARTS]
        length = np.maximum(np.linalg.norm(bones, axis=-1), 1e-3)
        mean = self.mean_lengths[BONE_OF_ROW]
        stretch = mean * np.log(length / now.lengths[BONE_OF_ROW])
        return stretch, mean[:, None] * bones / np.square(length)[..., None]

    def _add_bones(self, now: _Unknowns, known: BoolArray, system: _System) -> None:
        """Add what bones say about their lengths, and about the points at their ends."""
        stretch, gradient = self._stretch(now)
        both = known[:, BONE_STARTS] & known[:, BONE_ENDS]
        weight = both / (1.0 + np.square(stretch / BONE_SIGMA_M)) / BONE_SIGMA_M**2
        lengths = len(now.cameras) * _UNKNOWNS + BONE_OF_ROW
        mean = self.mean_lengths[BONE_OF_ROW]
        np.add.at(system.H_global, (lengths, lengths), weight.sum(axis=0) * mean**2)
        np.add.at(system.g_global, lengths, -(weight * stretch).sum(axis=0) * mean)
        for row, (start, end) in enumerate(zip(BONE_STARTS, BONE_ENDS, strict=True)):
            u = gradient[:, row]
            w = weight[:, row, None]
            block = w[..., None] * u[:, :, None] * u[:, None, :]
            system.H_points[:, start, :, start] += block
            system.H_points[:, end, :, end] += block
            system.H_points[:, start, :, end] -= block
            system.H_points[:, end, :, start] -= block
            pull = w * stretch[:, row, None] * u
            system.g_points[:, end] += pull
            system.g_points[:, start] -= pull
            system.coupling[:, lengths[row], end] -= mean[row] * w * u
            system.coupling[:, lengths[row], start] += mean[row] * w * u

    def _add_priors(self, now: _Unknowns, system: _System) -> None:
        diagonal = np.zeros(len(system.g_global))
        pull = np.zeros(len(system.g_global))
        for v, (place, start) in enumerate(zip(now.cameras, self.start, strict=True)):
            clock = v * _UNKNOWNS + _CLOCK
            diagonal[clock] = 1.0 / self.clock_sigma_s[v] ** 2
            diagonal[clock + 1] = 1.0 / DRIFT_SIGMA**2
            pull[clock], pull[clock + 1] = self._clock_change(place, start)
            if self.focal_sigma[v] > 0:
                focal = v * _UNKNOWNS + _FOCAL
                diagonal[focal] = 1.0 / self.focal_sigma[v] ** 2
                pull[focal] = place.log_focal
        lengths = slice(len(now.cameras) * _UNKNOWNS, None)
        diagonal[lengths] = 1.0 / BONE_PRIOR**2
        pull[lengths] = np.log(now.lengths / self.mean_lengths)
        system.H_global += np.diag(diagonal) / _INDEPENDENT
        system.g_global += diagonal * pull / _INDEPENDENT

    def _speed(self, v: int, place: CameraPlace) -> Float64Array:
        """Return how fast rays (N, n, 2) move, 1/s."""
        half = 1.0 / 120.0
        times = place.own_times(self.times)
        later = self.people[v].at(times + half)
        earlier = self.people[v].at(times - half)
        both = (later.seen & earlier.seen)[:, None, None]
        return np.where(both, (later.rays - earlier.rays) / (2.0 * half), 0.0)

    def result(self, now: _Unknowns, cost: float) -> AdjustedCameras:
        """Return cameras with their deviations."""
        count = len(now.cameras)
        sigmas = self.linearize(now).sigmas()[: count * _UNKNOWNS].reshape(count, _UNKNOWNS)
        _, confidence = self.observed(now.cameras)
        cameras = [
            replace(
                place,
                rotation_sigma=float(np.linalg.norm(sigma[:3])),
                position_sigma_m=float(np.linalg.norm(sigma[3:6])),
                focal_sigma=float(sigma[_FOCAL]),
                offset_sigma_s=float(sigma[_CLOCK]),
            )
            for place, sigma in zip(now.cameras, sigmas, strict=True)
        ]
        return AdjustedCameras(cameras, cost, int((confidence > 0).any(axis=0).sum()))


def image_residual(
    rays: Float64Array, place: CameraPlace, points: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return the residuals (..., 2) of points, and their depths (...).

    :param rays: (..., 2) normalized image coordinates. :param points: (..., 3) first camera's axes.
    """
    seen = place.of(points)
    return np.exp(place.log_focal) * projected(seen) - rays, seen[..., 2]


def _derivatives(
    place: CameraPlace, points: Float64Array, speed: Float64Array, since_mean_s: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return the derivatives of the residuals by points (M, 2, 3), and by the camera (M, 2, 9)."""
    seen = place.of(points)
    scale = np.exp(place.log_focal)
    J_seen = scale * projection_jacobian(seen)
    J_camera = np.zeros((len(points), 2, _UNKNOWNS))
    J_camera[:, :, :6] = pose_jacobian(seen, J_seen)
    J_camera[:, :, _FOCAL] = scale * projected(seen)
    J_camera[:, :, _CLOCK] = -speed
    J_camera[:, :, _DRIFT] = -speed * since_mean_s[:, None]
    return J_seen @ place.R_camera_first, J_camera
