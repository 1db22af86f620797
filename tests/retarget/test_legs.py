# SPDX-License-Identifier: GPL-3.0-or-later
"""Legs that are bent for the ankle to reach a goal: lengths, the plane of the knee, and goals out
of reach.

Lowering the pelvis for the legs to reach the floor.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.retarget.foot_placement import pelvis_drop, solve_leg
from scope.solver.rotations import exp

FRAMES = 200


def bent_legs(axis: int) -> tuple[np.ndarray, ...]:
    """Return rotations of thigh and shin, and hip, knee and ankle, of legs that hang along -y of
    their bones.

    :param axis: of the bones, about which their knees are bent.
    """
    rng = np.random.default_rng(5)
    thigh = exp(rng.normal(size=(FRAMES, 3)))
    shin = thigh @ exp(np.outer(rng.uniform(0.05, 2.5, FRAMES), np.eye(3)[axis]))
    hip = rng.normal(size=(FRAMES, 3))
    knee = hip - 0.42 * thigh[:, :, 1]
    return thigh, shin, hip, knee, knee - 0.38 * shin[:, :, 1]


@pytest.fixture
def legs() -> tuple[np.ndarray, ...]:
    return bent_legs(axis=0)


def test_the_ankle_reaches_its_goal_and_no_bone_changes_its_length(legs):
    thigh, shin, hip, knee, ankle = legs
    direction = np.random.default_rng(6).normal(size=(FRAMES, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    goal = hip + direction * np.random.default_rng(7).uniform(0.1, 0.79, (FRAMES, 1))
    # Whatever the knee's axis is said to be.
    sideways = exp(np.random.default_rng(8).normal(size=(FRAMES, 3)))[:, 0]
    new_thigh, new_shin = solve_leg(thigh, shin, (hip, knee, ankle), goal, sideways)
    new_knee = hip - 0.42 * new_thigh[:, :, 1]
    np.testing.assert_allclose(new_knee - 0.38 * new_shin[:, :, 1], goal, atol=1e-9)
    np.testing.assert_allclose(
        np.swapaxes(new_shin, 1, 2) @ new_shin, np.tile(np.eye(3), (FRAMES, 1, 1)), atol=1e-12
    )


@pytest.mark.parametrize(("axis", "other"), [(0, (2, 1)), (2, (1, 0))])
def test_the_knee_bends_about_the_same_axis_of_the_bones_as_before(axis, other):
    """A knee that bends forward must not turn into one that bends sideways, nor the reverse."""
    thigh, shin, hip, knee, ankle = bent_legs(axis)
    goal = hip + 0.7 * (ankle - hip)
    new_thigh, new_shin = solve_leg(thigh, shin, (hip, knee, ankle), goal, thigh[:, :, axis])
    np.testing.assert_allclose(new_thigh[:, :, axis], new_shin[:, :, axis], atol=1e-9)
    bend = np.swapaxes(new_thigh, 1, 2) @ new_shin
    assert (bend[:, other[0], other[1]] > 0).all()  # and to the same side


def test_a_single_key_gets_its_own_drop():
    """Of a leg that is 5 cm too short for it."""
    hips = np.array([[[0.0, 0.0, 1.0]], [[0.0, 0.0, 1.05]]])
    drop = pelvis_drop(hips, np.zeros((2, 1, 3)), np.array([1.0]), np.array([0.0, 1.0]))
    assert drop.tolist() == pytest.approx([0.0, 0.05])
