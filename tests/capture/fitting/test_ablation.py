# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaving parts of the pipeline out."""

import dataclasses
from typing import Any

import pytest
from scope.scope_addon.capture.fitting.ablation import NO_ABLATION, Ablation
from scope.scope_addon.errors import UsageError
from scope.solver import Weights

WEIGHTS = Weights(keypoints2d=1e5, keypoints3d=100.0, orientation_field=400.0, joint_prior=3.0)


def test_no_ablation_changes_no_weight() -> None:
    assert NO_ABLATION.weights(WEIGHTS) == WEIGHTS


@pytest.mark.parametrize("name", ["keypoints3d", "orientation_field", "joint_prior"])
def test_a_term_left_out_has_weight_zero_and_the_others_keep_theirs(name: str) -> None:
    found = Ablation(**{name: False}).weights(WEIGHTS)
    left_out: dict[str, Any] = {name: 0.0}
    assert found == dataclasses.replace(WEIGHTS, **left_out)


def test_a_source_of_depth_is_required() -> None:
    with pytest.raises(UsageError, match="nothing else provides depth"):
        Ablation(lifter=False, world_landmarks=False)
