# SPDX-License-Identifier: GPL-3.0-or-later
"""`python -m scope.benchmarks.solver.cold_starts [COUNT]`: how often fits that are given only
measurements find the person, and whether the deviations that they state are right.

Random people, 1,000 unless said otherwise: every joint drawn from the joint prior, the shape from
the population, any heading, 2.5 to 5 m away. COCO's 17 keypoints are seen with 2 px at a focal
length of 1,000 px, and where a network is meant to lift them, in space with 2 cm.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ... import solver
from ...solver import (
    Body,
    JointPrior,
    Keypoints2D,
    Keypoints3D,
    Measurements,
    State,
    View,
    rotations,
)
from ..perception.render_shots import fitted_motions

COUNT = 1000
FOCAL = 1000.0
CAMERA = np.array([[FOCAL, 0.0, 500.0], [0.0, FOCAL, 500.0], [0.0, 0.0, 1.0]])
SIGMA_PX = 2.0
SIGMA_M = 0.02
MARKER_M = 0.002
FAR_M = 0.2  # a keypoint that is farther away from its true place is at a wrong limb
CLIPS = 40
FRAMES = 20
RATE_HZ = 30.0  # of the recordings, too
CLIP_SIGMA_PX = 4.0
CLIP_SIGMA_M = 0.01
FARTHEST_M = 1.0  # from where a clip begins: a person who walks farther may get behind a camera
COSTLY = 1.5  # times the cost of a fit that starts from the truth: another minimum
Array = NDArray[np.float64]


class Person(NamedTuple):
    """A random person, and what was measured."""

    state: State
    joints: Array  # (K+1, 3) camera frame, metres
    points: Array  # (17, 3) COCO's keypoints
    seen: Measurements


def coco_of(body: Body) -> list[int]:
    """Return the numbers of COCO's 17 keypoints."""
    return list(body.keypoint_set("coco").values())[:17]


def random_person(body: Body, prior: JointPrior, seed: int) -> Person:
    """Return a person, whose standard deviations the measurements state."""
    rng = np.random.default_rng(seed)
    turns = np.tile(np.eye(3), (body.K + 1, 1, 1))
    for i, name in enumerate(body.joint_names):
        if i > 0 and name in prior.names:
            turns[i] = prior.sample(name, 1, rng)[0]
    beta = rng.standard_normal(body.P)
    heading = rotations.exp([0.0, rng.uniform(-np.pi, np.pi), 0.0])
    lean = rotations.exp(0.2 * rng.standard_normal(3))
    turns[0] = np.diag([1.0, -1.0, -1.0]) @ heading @ lean
    root = np.array([rng.uniform(-0.5, 0.5), rng.uniform(-0.3, 0.3), rng.uniform(2.5, 5.0)])
    R, t = body.forward_kinematics(turns, root - body.rest_joints(beta)[0], beta)
    index = coco_of(body)
    points = body.keypoints(R, t, beta, index)
    pixels = FOCAL * points[:, :2] / points[:, 2:] + 500.0
    pixels += SIGMA_PX * rng.standard_normal((17, 2))
    space = points + SIGMA_M * rng.standard_normal((17, 3))
    seen = Measurements(
        CAMERA,
        Keypoints2D(index, pixels, sigma_px=SIGMA_PX),
        Keypoints3D(index, space, sigma_m=SIGMA_M),
    )
    return Person(State(turns[0], t[0], turns[1:], beta), t, points, seen)


def without_deviations(seen: Measurements) -> Measurements:
    """Return measurements that state none, so that the default weights hold."""
    assert seen.keypoints2d is not None
    assert seen.keypoints3d is not None
    return replace(
        seen,
        keypoints2d=replace(seen.keypoints2d, sigma_px=None),
        keypoints3d=replace(seen.keypoints3d, sigma_m=None),
    )


def farthest(body: Body, people: list[Person], seen: list[Measurements]) -> Array:
    """Return the largest distance (n,) of a fitted keypoint from its true place, metres."""
    index = coco_of(body)
    found = []
    for person, fit in zip(people, solver.fit_batch(body, seen), strict=True):
        points = body.keypoints(fit.R_camera_part, fit.t_camera_part, fit.state.beta, index)
        found.append(np.linalg.norm(points - person.points, axis=1).max())
    return np.array(found)


def image_of(person: Person) -> Measurements:
    """Return the 2D keypoints alone, without their deviations."""
    return replace(without_deviations(person.seen), keypoints3d=None)


def markers_of(person: Person, body: Body) -> Measurements:
    """Return markers at all joints, without noise."""
    seen = Keypoints3D(body.joint_names, person.joints, sigma_m=MARKER_M)
    return Measurements(keypoints3d=seen)


def excess(body: Body, people: list[Person], seen: list[Measurements]) -> Array:
    """Return the cost (n,) of cold starts over that of fits from the truth."""
    from_truth = solver.fit_batch(body, seen, init=[person.state for person in people])
    found = solver.fit_batch(body, seen)
    return np.array([a.cost / b.cost for a, b in zip(found, from_truth, strict=True)])


def calibration(body: Body, people: list[Person]) -> float:
    """Return the root mean square of the errors of all joints over their standard deviations, 1 if
    these are right.
    """
    squares = []
    for person in people:
        found = solver.fit_motion(body, [person.seen], [0.0], init=[person.state], covariance=True)
        squares.append(whitened(found, person.joints[None]))
    return float(np.sqrt(np.mean(squares)))


def whitened(found: solver.MotionFit, joints: Array) -> Array:
    """Return the squared errors (T, K+1) of joints (T, K+1, 3) over their stated covariance, 1 on
    average if that is right.
    """
    assert found.joint_covariance is not None
    off = found.t_world_part - joints
    over = np.linalg.solve(found.joint_covariance, off[..., None])[..., 0]
    squares: Array = np.sum(off * over, axis=-1) / 3.0
    return squares


def recorded_clips(body: Body) -> Iterator[tuple[Array, Array, Array]]:
    """Yield clips of recorded people, of random shapes and headings, in a camera's axes: R (T, K+1,
    3, 3) and t (T, K+1, 3) of the parts, and the shape (P,).
    """
    with np.load(fitted_motions()) as data:
        starts = data["take_start"]
        valid = data["valid"]
        poses = data["poses"].astype(float)
        places = data["trans"].astype(float)
    rng = np.random.default_rng(0)
    count = 0
    while count < CLIPS:
        first = int(rng.integers(len(valid) - FRAMES))
        rows = slice(first, first + FRAMES)
        path = places[rows] - places[first]
        is_cut = np.any((starts > first) & (starts < first + FRAMES))
        if is_cut or not valid[rows].all() or np.linalg.norm(path, axis=1).max() > FARTHEST_M:
            continue
        count += 1
        heading = rotations.exp([0.0, rng.uniform(-np.pi, np.pi), 0.0])
        R_camera_world = np.diag([1.0, -1.0, -1.0]) @ heading
        turns = rotations.exp(poses[rows].reshape(FRAMES, -1, 3))
        turns[:, 0] = R_camera_world @ turns[:, 0]
        root = path @ R_camera_world.T + [0.0, 0.0, rng.uniform(2.5, 5.0)]
        beta = rng.standard_normal(body.P)
        R, t = body.forward_kinematics(turns, root, beta)
        yield R, t, beta


def clip_calibration(body: Body) -> tuple[Array, Array]:
    """Return the root mean square of the errors of all joints over their deviations, and the mean
    error in metres: (2,) each, by three cameras and by points in space.
    """
    index = coco_of(body)
    rng = np.random.default_rng(0)
    times = np.arange(FRAMES) / RATE_HZ
    ratios: tuple[list[Array], list[Array]] = ([], [])
    errors: tuple[list[float], list[float]] = ([], [])
    for R, t, beta in recorded_clips(body):
        points = np.array(
            [body.keypoints(R_f, t_f, beta, index) for R_f, t_f in zip(R, t, strict=True)]
        )
        by_cameras = solver.fit_motion(body, views_of(points, index, rng), times, covariance=True)
        in_space = solver.fit_motion(body, space_of(points, index, rng), times, covariance=True)
        for k, found in enumerate((by_cameras, in_space)):
            ratios[k].append(whitened(found, t))
            errors[k].append(float(np.linalg.norm(found.t_world_part - t, axis=-1).mean()))
    return np.sqrt(np.mean(ratios, axis=(1, 2, 3))), np.mean(errors, axis=1)


def views_of(points: Array, index: list[int], rng: np.random.Generator) -> list[View]:
    """Return three cameras around keypoints (T, 17, 3) that see them with `CLIP_SIGMA_PX`."""
    middle = points.mean(axis=(0, 1))
    views = []
    for angle in (0.0, 1.2, -1.2):
        R = rotations.exp([0.0, angle, 0.0])
        t = middle - R @ middle
        seen = points @ R.T + t
        pixels = FOCAL * seen[..., :2] / seen[..., 2:] + 500.0
        pixels += CLIP_SIGMA_PX * rng.standard_normal(pixels.shape)
        keypoints = Keypoints2D(index, pixels, sigma_px=CLIP_SIGMA_PX)
        views.append(View(Measurements(CAMERA, keypoints), R, t))
    return views


def space_of(points: Array, index: list[int], rng: np.random.Generator) -> Measurements:
    """Return keypoints (T, 17, 3) in space, seen with `CLIP_SIGMA_M`."""
    seen = points + CLIP_SIGMA_M * rng.standard_normal(points.shape)
    return Measurements(keypoints3d=Keypoints3D(index, seen, sigma_m=CLIP_SIGMA_M))


def main() -> int:
    """Measure, and print the figures."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else COUNT
    body = solver.load_body("scope")
    prior = solver.load_joint_prior()
    people = [random_person(body, prior, seed) for seed in range(count)]
    default = farthest(body, people, [without_deviations(person.seen) for person in people])
    stated = farthest(body, people, [person.seen for person in people])
    image = excess(body, people, [image_of(person) for person in people])
    markers = excess(body, people, [markers_of(person, body) for person in people])
    rows = [
        ["wrong limbs, 2D and 3D, default weights", f"{100 * (default > FAR_M).mean():.1f} %"],
        ["wrong limbs, 2D and 3D, deviations given", f"{100 * (stated > FAR_M).mean():.1f} %"],
        ["another minimum, 2D alone", f"{100 * (image > COSTLY).mean():.1f} %"],
        ["another minimum, markers of 2 mm", f"{100 * (markers > COSTLY).mean():.1f} %"],
        ["errors over their standard deviations", f"{calibration(body, people):.2f}"],
    ]
    ratios, errors = clip_calibration(body)
    for name, ratio, error in zip(
        ("three cameras", "points in space"), ratios, errors, strict=True
    ):
        rows.append(
            [f"the same in clips, {name}", f"{ratio:.2f}, of errors of {1e3 * error:.1f} mm"]
        )
    print(f"{count} people")
    for name, value in rows:
        print(f"{name}: {value}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
