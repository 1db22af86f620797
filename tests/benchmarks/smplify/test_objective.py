# SPDX-License-Identifier: GPL-3.0-or-later
"""SMPLify's objective on keypoints of a known body."""

from __future__ import annotations

import numpy as np
import pytest
from scope.benchmarks.smplify.objective import ROOT, SIGMA_PX, UPRIGHT, Frame, Objective, PosePrior
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
