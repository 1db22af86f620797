# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures and views of the comparison."""

import numpy as np
import pytest
from scope.benchmarks.smplify.comparison import errors

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
