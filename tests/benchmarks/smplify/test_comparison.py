# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures and views of the comparison."""

import numpy as np
import pytest
from scope.benchmarks.smplify.comparison import errors, turned

NAMES = [
    side + limb for limb in ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle") for side in "LR"
]


def test_errors_are_those_put_in(body):
    joints = np.tile(body.rest_joints(np.zeros(body.P)), (3, 1, 1))
    sides = {"L": "left", "R": "right"}
    true = joints[
        :, [body.joint_names.index(f"{sides[name[0]]}_{name[1:].lower()}") for name in NAMES]
    ].copy()
    joints += [0.3, 0.0, 1.0]
    joints[:, body.joint_names.index("left_wrist")] += [0.0, 0.024, 0.0]
    found = errors(body, joints, true, NAMES)
    assert found["mpjpe_root"] == pytest.approx(2.0)
    assert found["pa_mpjpe"] < 24.0 / np.sqrt(12)


def test_a_quarter_turn_keeps_heights_and_distances():
    points = np.random.default_rng(0).normal(size=(40, 3)) + [0, 0, 5]
    around = turned(points)
    np.testing.assert_allclose(around[:, 1], points[:, 1])
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(around, axis=0), axis=1),
        np.linalg.norm(np.diff(points, axis=0), axis=1),
    )
    np.testing.assert_allclose(around.mean(axis=0), points.mean(axis=0))
    assert np.argmax(around[:, 2]) == np.argmax(points[:, 0])  # what was on the right is far
