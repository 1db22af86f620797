# SPDX-License-Identifier: GPL-3.0-or-later
"""Limbs mirrored in depth, on random poses."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.kinematics.mirrored_limbs import (
    LIMBS,
    bone_depths,
    mirrored_limb,
    runs_of_one_sign,
)
from scope.solver import load_body
from scope.solver.rotations import exp

BODY = load_body("scope")
FRAMES = 6


def _posed(rotations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return BODY.forward_kinematics(
        rotations, np.tile([0.3, -0.2, 3.0], (len(rotations), 1)), np.zeros(BODY.P)
    )


@pytest.mark.parametrize("names", LIMBS[1:3])
@pytest.mark.parametrize(("upper", "lower"), [(True, False), (False, True), (True, True)])
def test_a_mirrored_bone_has_the_other_depth_and_looks_the_same(
    names: tuple[str, ...], upper: bool, lower: bool
) -> None:
    rng = np.random.default_rng(0)
    rotations = exp(rng.normal(0.0, 0.5, (FRAMES, BODY.K + 1, 3)))
    center = rng.normal(0.0, 0.1, (FRAMES, 3))
    R, before = _posed(rotations)
    a, b, c = (BODY.joint_names.index(name) for name in names)
    rotations[:, [a, b]] = mirrored_limb(BODY.parents, R, before, center, (a, b, c), upper, lower)
    after = _posed(rotations)[1]
    np.testing.assert_allclose(after[:, a], before[:, a], atol=1e-9)
    for is_mirrored, start, end in ((upper, a, b), (lower, b, c)):
        bone = before[:, end] - before[:, start]
        other = after[:, end] - after[:, start]
        sight = before[:, end] - center
        sight /= np.linalg.norm(sight, axis=1, keepdims=True)
        along = (bone * sight).sum(axis=1)
        expected = bone - 2 * is_mirrored * along[:, None] * sight
        np.testing.assert_allclose(other, expected, atol=1e-9)
        depths = bone_depths(before[:, start], before[:, end], center)
        np.testing.assert_allclose(depths, along, atol=1e-9)


def test_runs_end_where_a_bone_is_shallow_and_are_deep_somewhere() -> None:
    depths = np.array([0.05, 0.12, 0.2, 0.01, 0.06, 0.04, -0.04, -0.3, -0.02, 0.11])
    assert list(runs_of_one_sign(depths, 0.03, 0.1)) == [slice(0, 3), slice(6, 8), slice(9, 10)]
    assert list(runs_of_one_sign(depths[:0], 0.03, 0.1)) == []
    assert list(runs_of_one_sign(np.full(4, 0.02), 0.03, 0.0)) == []
