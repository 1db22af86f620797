# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of the ablation leave out what they say, and only as long as they are measured."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from scope.benchmarks.ablation import LANDMARKS_AS_LIFTED, ROWS, WITHOUT_OFFSETS, replaced
from scope.scope_addon.capture.camera.intrinsics import Camera
from scope.scope_addon.capture.fitting.prepared_track import PreparedTrack, prepare_track
from scope.scope_addon.capture.fitting.weights import WEIGHTS
from scope.solver import Body

from ..capture.silhouettes import K, seen_in

CAMERA = Camera(K, np.zeros(5), "test")


def prepared_in(row: str, body: Body, betas: np.ndarray) -> PreparedTrack:
    """Somebody who is lifted exactly, prepared as in a row."""
    replacements = ROWS[row].get("replacements", ())
    with replaced([LANDMARKS_AS_LIFTED, WITHOUT_OFFSETS, *replacements]):
        return prepare_track(body, seen_in(body, betas, None), CAMERA)


def test_every_row_replaces_something_that_there_is_and_puts_it_back() -> None:
    for row in ROWS.values():
        replacements = row.get("replacements", ())
        before = [getattr(owner, name) for owner, name, _ in replacements]
        with replaced(replacements):
            assert all(getattr(owner, name) is value for owner, name, value in replacements)
        assert [getattr(owner, name) for owner, name, _ in replacements] == before


@pytest.mark.parametrize(
    ("row", "name"),
    [
        ("without 3D keypoints", "keypoints3d"),
        ("without the orientation field", "orientation_field"),
        ("without the joint prior", "joint_prior"),
    ],
)
def test_a_term_left_out_has_weight_zero_and_the_others_keep_theirs(
    row: str, name: str, body: Body
) -> None:
    left_out: dict[str, Any] = {name: 0.0}
    weights = prepared_in(row, body, np.zeros(body.P)).weights
    assert weights == dataclasses.replace(WEIGHTS, **left_out)
