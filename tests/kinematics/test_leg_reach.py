# SPDX-License-Identifier: GPL-3.0-or-later
"""Moving feet by the legs: ankles arrive, feet keep their rotation, knees bend forwards."""

import numpy as np
import pytest
from scope.scope_addon.kinematics.leg_reach import LEGS, move_ends
from scope.solver import rotations
from scope.solver.body_file import load_body


@pytest.fixture(scope="module")
def body():
    return load_body("scope")


def moved(body, omega, shift):
    """Part poses before and after."""
    poses = body.forward_kinematics(omega, np.zeros((len(omega), 3)))
    return poses, body.forward_kinematics(
        move_ends(body, LEGS, omega, poses, shift), np.zeros((len(omega), 3))
    )


def random_legs(body, count, seed):
    rng = np.random.default_rng(seed)
    vectors = 0.2 * rng.normal(size=(count, body.K + 1, 3))
    for side in ("left", "right"):
        vectors[:, body.joint_names.index(f"{side}_knee")] = 0.05 * rng.normal(size=(count, 3))
        vectors[:, body.joint_names.index(f"{side}_knee"), 0] = rng.uniform(0.2, 1.5, count)
    return rotations.exp(vectors)


def test_ankles_arrive_and_everything_else_stays(body):
    omega = random_legs(body, 40, 1)
    shift = 0.02 * np.random.default_rng(2).normal(size=(40, 2, 3)) + [0, 0.06, 0]
    (R, t), (R_new, t_new) = moved(body, omega, shift)
    moves = [name.endswith(("knee", "ankle", "foot")) for name in body.joint_names]
    np.testing.assert_allclose(t_new[:, np.invert(moves)], t[:, np.invert(moves)])
    for side, name in enumerate(("left", "right")):
        hip, knee, ankle, foot = (
            body.joint_names.index(f"{name}_{part}") for part in ("hip", "knee", "ankle", "foot")
        )
        np.testing.assert_allclose(t_new[:, ankle], t[:, ankle] + shift[:, side], atol=2e-3)
        np.testing.assert_allclose(R_new[:, [ankle, foot]], R[:, [ankle, foot]], atol=1e-9)
        np.testing.assert_allclose(
            np.linalg.norm(t_new[:, knee] - t_new[:, hip], axis=1),
            np.linalg.norm(t[:, knee] - t[:, hip], axis=1),
        )


def test_a_goal_out_of_reach_stretches_the_leg_without_a_snap(body):
    omega = random_legs(body, 30, 3)
    (_, t), (_, t_new) = moved(body, omega, np.tile([0.0, -0.6, 0.0], (30, 2, 1)))
    for side in ("left", "right"):
        hip, knee, ankle = (
            body.joint_names.index(f"{side}_{part}") for part in ("hip", "knee", "ankle")
        )
        bones = np.linalg.norm(t[:, knee] - t[:, hip], axis=1) + np.linalg.norm(
            t[:, ankle] - t[:, knee], axis=1
        )
        reach = np.linalg.norm(t_new[:, ankle] - t_new[:, hip], axis=1) / bones
        assert np.all(reach < 0.9951)
        assert np.all(reach > 0.99)
