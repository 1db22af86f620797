# SPDX-License-Identifier: GPL-3.0-or-later
"""The limits of knees and elbows against anatomy: which way they bend, how far, and mirrored left
and right.
"""

import numpy as np
import pytest
from scope.solver import rotations
from scope.solver.part import Part
from scope.solver.residuals.joint_limits import HINGES

from .references import joint_limits

# T-pose
REST = {"knee": [0.0, -1.0, 0.0], "left_elbow": [1.0, 0.0, 0.0], "right_elbow": [-1.0, 0.0, 0.0]}
# at 90 degrees: the shin backwards, the forearm forwards
BENT = {"knee": [0.0, 0.0, -1.0], "elbow": [0.0, 0.0, 1.0]}


def cost(name, rotation_vector):
    axis, lower, upper, swing_limit = HINGES[name]
    Omega = rotations.exp(rotation_vector)
    origin = np.zeros(3)
    identity = np.eye(3)
    part = Part(Omega, origin, np.zeros((3, 0)), Omega, identity, origin, np.zeros(0))
    return float(
        np.sum(joint_limits(part, np.array(axis), lower, upper, swing_limit, 1.0, 1.0) ** 2)
    )


@pytest.mark.parametrize("name", HINGES)
def test_knees_bend_backwards_and_elbows_forwards(name):
    axis = np.array(HINGES[name][0])
    limb = name.split("_")[1]
    rest = np.array(REST.get(name, REST.get(limb)))
    np.testing.assert_allclose(rotations.exp(np.pi / 2 * axis) @ rest, BENT[limb], atol=1e-12)


@pytest.mark.parametrize("name", HINGES)
def test_straight_and_bent_limbs_are_within_the_limits_and_overextended_ones_beyond(name):
    axis = np.array(HINGES[name][0])
    for angle in (0.0, 0.5, 1.5, 2.5):
        assert cost(name, angle * axis) == 0.0
    for angle in (-0.3, 3.0):
        assert cost(name, angle * axis) > 0.0


@pytest.mark.parametrize("limb", ["knee", "elbow"])
def test_left_and_right_mirror_each_other(limb):
    for angle in np.random.default_rng(0).normal(size=(20, 3)) * 1.5:
        mirrored = angle * [1, -1, -1]  # a rotation vector in the mirror x -> -x
        assert np.isclose(cost(f"left_{limb}", angle), cost(f"right_{limb}", mirrored), atol=1e-12)
