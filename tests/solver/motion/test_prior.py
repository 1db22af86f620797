# SPDX-License-Identifier: GPL-3.0-or-later
"""The tables of a motion's prior: one number for all joints or each, kernels turned off, and
standing since when.
"""

import math

import numpy as np
import pytest
from scope.solver import InvalidValueError, ShapeError
from scope.solver.motion.prior import MotionPrior, StandingPoints


def test_weights_and_kernels_have_their_rows() -> None:
    prior = MotionPrior(
        [1.0, 2.0, 3.0],
        4.0,
        5.0,
        robust_joints=[10.0, 20.0, math.inf],
        robust_root_position=math.inf,
    )
    table = prior.packed(3)
    np.testing.assert_array_equal(table[:, 0], [4.0, 1.0, 2.0, 3.0, 5.0])
    np.testing.assert_allclose(table[:, 1], [1 / 4e4, 1 / 10, 1 / 20, 0.0, 0.0])
    np.testing.assert_array_equal(MotionPrior(7.0).packed(2)[1:3, 0], [7.0, 7.0])


def test_a_pose_counts_as_often_as_a_process_with_its_memory_tells_of_its_mean() -> None:
    """The information 1ᵀ C⁻¹ 1 on the mean, of samples at uneven times with correlation C."""
    times = np.cumsum(np.random.default_rng(0).uniform(0.01, 0.5, 12))
    C = np.exp(-np.abs(times[:, None] - times) / 0.3)
    independent = np.linalg.solve(C, np.ones(12)).sum()
    prior = MotionPrior(pose_memory=0.3)
    np.testing.assert_allclose(12 * prior.pose_share(times), independent, rtol=1e-12)
    assert prior.pose_share(times[:1]) == 1.0
    assert MotionPrior(pose_memory=0.0).pose_share(times) == 1.0


@pytest.mark.parametrize(
    ("prior", "error"),
    [
        (lambda: MotionPrior([1.0, 2.0]).packed(3), ShapeError),
        (lambda: MotionPrior(pose_memory=-0.1), InvalidValueError),
    ],
)
def test_what_is_no_weight_is_refused(prior, error) -> None:
    with pytest.raises(error, match="MotionPrior"):
        prior()


def test_a_point_stands_between_frames_as_surely_as_in_the_less_sure_one() -> None:
    given = StandingPoints([4, 2], [[1.0, 0.2], [0.5, 0.9], [0.8, 0.0]])
    indices, both = given.packed(points=6, frames=3)
    np.testing.assert_array_equal(indices, [4, 2])
    np.testing.assert_array_equal(both, [[0.0, 0.0], [0.5, 0.2], [0.5, 0.0]])
    assert StandingPoints().packed(6, 3)[1].shape == (3, 0)
    with pytest.raises(ShapeError):
        given.packed(points=4, frames=3)
    with pytest.raises(ShapeError):
        given.packed(points=6, frames=4)
