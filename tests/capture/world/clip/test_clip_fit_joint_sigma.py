# SPDX-License-Identifier: GPL-3.0-or-later
"""The joints' standard deviations along the line of sight and across it."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.world.clip_fit import ACROSS, ALONG, joint_sigma


def _covariances(sights, along_m, across_m):
    """Covariances (T, K+1, 3, 3) with these deviations along unit vectors (T, K+1, 3) and at right
    angles to them.
    """
    outer = sights[..., :, None] * sights[..., None, :]
    return along_m**2 * outer + across_m**2 * (np.eye(3) - outer)


def test_deviations_are_those_along_each_joints_own_line_of_sight():
    rng = np.random.default_rng(0)
    joints = rng.normal(0.0, 1.0, (5, 4, 3)) + [0.0, 0.0, 4.0]
    sights = joints / np.linalg.norm(joints, axis=-1, keepdims=True)
    pelvis = _covariances(sights, 0.03, 0.01)
    others = _covariances(sights, 0.006, 0.002)
    sigma = joint_sigma(pelvis[:, 0], others, joints, np.arange(5) / 60.0)
    np.testing.assert_allclose(sigma[:, 0], np.tile([0.03 * ALONG, 0.01 * ACROSS], (5, 1)))
    np.testing.assert_allclose(sigma[:, 1:], np.tile([0.006 * ALONG, 0.002 * ACROSS], (5, 3, 1)))


@pytest.mark.parametrize(("first", "second", "ratio"), [(30.0, 60.0, 2**0.3), (1.0, 10.0, 1.0)])
def test_the_same_covariance_says_less_of_more_frames(first, second, ratio):
    joints = np.tile([0.0, 0.0, 3.0], (3, 2, 1))
    covariance = np.tile(1e-5 * np.eye(3), (3, 2, 1, 1))
    slow, fast = (
        joint_sigma(covariance[:, 0], covariance, joints, np.arange(3) / rate)
        for rate in (first, second)
    )
    np.testing.assert_allclose(fast, ratio * slow)


def test_a_single_frame_is_as_one_of_few():
    joints = np.tile([0.0, 0.0, 3.0], (2, 2, 1))
    covariance = np.tile(1e-5 * np.eye(3), (2, 2, 1, 1))
    one = joint_sigma(covariance[:1, 0], covariance[:1], joints[:1], np.zeros(1))
    np.testing.assert_allclose(
        one, joint_sigma(covariance[:, 0], covariance, joints, np.array([0.0, 0.1]))[:1]
    )
