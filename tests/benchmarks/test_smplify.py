# SPDX-License-Identifier: GPL-3.0-or-later
"""SMPLify's objective on keypoints of a known body.

The figures and views of the comparison.

The dense optimizer on problems whose minima are known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.benchmarks.smplify.comparison import errors
from scope.benchmarks.smplify.dense import minimize
from scope.benchmarks.smplify.objective import (
    LAMBDA_3D,
    ROOT,
    SIGMA_PX,
    UPRIGHT,
    Frame,
    Objective,
    PosePrior,
)
from scope.solver import Keypoints3D
from scope.solver.rotations import exp

K = np.array([[900.0, 0, 480], [0, 900, 270], [0, 0, 1]])


NAMES = tuple(
    f"{side}_{part}"
    for part in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle", "heel", "foot_index")
    for side in ("left", "right")
)


@pytest.fixture(scope="module")
def prior(body):
    """Poses around one with bent elbows and knees, 15° wide."""
    poses = np.radians(15.0) * np.random.default_rng(0).normal(size=(4000, 3 * body.K))
    for name, axis, angle in (
        ("left_knee", 0, 0.5),
        ("right_knee", 0, 0.5),
        ("left_elbow", 1, -0.7),
        ("right_elbow", 1, 0.7),
    ):
        poses[:, 3 * (body.joint_names.index(name) - 1) + axis] += angle
    return PosePrior.of(poses)


@pytest.fixture(scope="module")
def truth(body, prior):
    """Somebody who has turned by 100°, at 4 m, in the mean pose."""
    x = np.zeros(ROOT + 3 * body.K + body.P)
    x[1] = np.radians(100.0)
    x[3:ROOT] = [0.2, 0.1, 4.0]
    x[ROOT : ROOT + 3 * body.K] = prior.mean
    return x


def frame_at(body, truth):
    vectors = np.concatenate([truth[:3], truth[ROOT : ROOT + 3 * body.K]]).reshape(-1, 3)
    states = exp(vectors)
    states[0] = UPRIGHT @ states[0]
    points = body.keypoints(*body.forward_kinematics(states, truth[3:ROOT]))
    homogeneous = points[[body.keypoint_set("blazepose")[name] for name in NAMES]] @ K.T
    return Frame(NAMES, homogeneous[:, :2] / homogeneous[:, 2:], np.ones(len(NAMES)), K)


def test_a_known_body_is_found_from_any_heading(body, prior, truth):
    objective = Objective(body, prior, frame_at(body, truth))
    found = objective.fit()
    off = objective.joints(found.x) - objective.joints(truth)
    # a frame alone tells little about depth
    assert np.linalg.norm(off - off[0], axis=1).max() < 0.12
    assert abs(off[0, 2]) < 0.2  # size and distance trade places
    pixels = objective.residuals(found.x[None], 0.0, 0.0)[0, : 2 * len(NAMES)].reshape(-1, 2)
    assert np.linalg.norm(pixels, axis=1).max() < 4.0


def test_the_robust_term_is_geman_mcclures(body, prior, truth):
    frame = frame_at(body, truth)
    frame.pixels[0] += [300.0, 400.0]
    squared = (Objective(body, prior, frame).residuals(truth[None], 0.0, 0.0)[0, :2] ** 2).sum()
    assert squared == pytest.approx(SIGMA_PX**2 * 500.0**2 / (SIGMA_PX**2 + 500.0**2))


def test_3d_keypoints_count_by_where_they_are_to_each_other(body, prior, truth):
    """Wherever the whole body is, and more the farther one of two is from its place."""
    objective = Objective(body, prior, frame_at(body, truth))
    joints = objective.joints(truth)[[4, 5]]
    numbers = len(body.keypoint_names) + np.array([4, 5])
    elsewhere = replace(objective.frame, points=Keypoints3D(numbers, joints + 0.5, np.ones(2)))
    apart = [[0.04, 0.0, 0.0], [-0.04, 0.0, 0.0]]
    farther = replace(objective.frame, points=Keypoints3D(numbers, joints + apart, np.ones(2)))
    exact, off = (
        Objective(body, prior, frame).residuals(truth[None], 0.0, 0.0)[0, -6:]
        for frame in (elsewhere, farther)
    )
    assert np.abs(exact).max() < 1e-9
    assert (off**2).sum() == pytest.approx(LAMBDA_3D * 2 * 0.04**2)


COMPARED_NAMES = [
    side + limb for limb in ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle") for side in "LR"
]


def test_errors_are_those_put_in(body):
    joints = np.tile(body.rest_joints(np.zeros(body.P)), (3, 1, 1))
    sides = {"L": "left", "R": "right"}
    true = joints[
        :,
        [body.joint_names.index(f"{sides[name[0]]}_{name[1:].lower()}") for name in COMPARED_NAMES],
    ].copy()
    joints += [0.3, 0.0, 1.0]
    joints[:, body.joint_names.index("left_wrist")] += [0.0, 0.024, 0.0]
    found = errors(body, joints, true, COMPARED_NAMES)
    assert found["mpjpe_root"] == pytest.approx(2.0)
    assert found["pa_mpjpe"] < 24.0 / np.sqrt(12)


def test_a_linear_problem_has_the_normal_equations_solution():
    rng = np.random.default_rng(0)
    A = rng.normal(size=(20, 6))
    b = rng.normal(size=20)
    found = minimize(lambda x: x @ A.T - b, np.zeros(6), np.ones(6, bool), 50, 1e-15)
    np.testing.assert_allclose(found.x, np.linalg.lstsq(A, b, rcond=None)[0], atol=1e-6)
    assert found.cost == pytest.approx(0.5 * np.sum((A @ found.x - b) ** 2))
