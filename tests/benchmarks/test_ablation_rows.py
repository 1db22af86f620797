# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of the ablation leave out what they say, and only as long as they are measured."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from scope.benchmarks.ablation import LANDMARKS_AS_LIFTED, ROWS, WITHOUT_OFFSETS, replaced
from scope.scope_addon.capture.camera.intrinsics import Camera
from scope.scope_addon.capture.fitting.outline import fit_shape_to_outline, usable_masks
from scope.scope_addon.capture.fitting.prepared_track import PreparedTrack, prepare_track
from scope.scope_addon.capture.fitting.track_fit import fit_track
from scope.scope_addon.capture.fitting.weights import WEIGHTS
from scope.scope_addon.capture.world import clip_fit
from scope.scope_addon.capture.world.camera_path import CameraPath
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


def test_the_mean_shape_stays_when_the_shape_is_left_out(body: Body) -> None:
    betas = np.random.default_rng(2).uniform(-1.2, 1.2, body.P)
    found = {}
    for row in ("all parts", "without a shape: the mean body"):
        prepared = prepared_in(row, body, betas)
        found[row] = np.abs(fit_shape_to_outline(prepared, usable_masks(prepared), None).beta).max()
    assert found["all parts"] > 0.5
    assert found["without a shape: the mean body"] < 0.02


def test_without_its_own_prior_proportions_and_stature_go_together_as_in_the_population(
    body: Body,
) -> None:
    """As in the population, where short people have relatively long trunks: see
    `with_unknown_stature`.
    """
    information = [
        prepared_in(row, body, np.zeros(body.P)).priors.shape_information
        for row in ("all parts", "without the stature's own prior")
    ]
    assert information[0] is not None
    assert information[1] is None or np.allclose(information[1], np.diag(np.diag(information[1])))
    assert not np.allclose(information[0], np.diag(np.diag(information[0])))


def test_limbs_are_not_searched_for_when_the_search_is_left_out(
    body: Body, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[int] = []
    monkeypatch.setattr(clip_fit, "search_limbs", lambda *_: calls.append(1))
    prepared = prepared_in("all parts", body, np.zeros(body.P))
    start = fit_track(prepared, lambda *_: None)
    path = CameraPath.static(len(prepared.track))
    for row in ("without the search for mirrored limbs", "all parts"):
        with replaced(ROWS[row].get("replacements", ())):
            clip_fit.fit_clip(prepared, start, path, lambda *_: None)
        assert bool(calls) == (row == "all parts")
