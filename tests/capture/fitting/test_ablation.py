# SPDX-License-Identifier: GPL-3.0-or-later
"""Leaving parts of the pipeline out."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import Camera
from scope.scope_addon.capture.fitting.ablation import NO_ABLATION, Ablation
from scope.scope_addon.capture.fitting.outline import fit_shape_to_outline, usable_masks
from scope.scope_addon.capture.fitting.prepared_track import prepare_track
from scope.scope_addon.capture.fitting.track_fit import fit_track
from scope.scope_addon.capture.world.camera_path import CameraPath
from scope.scope_addon.capture.world.clip import clip_fit
from scope.scope_addon.errors import UsageError
from scope.solver import Body, Weights

from ..silhouettes import K, seen_in

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


def test_the_mean_shape_stays_when_the_shape_is_left_out(body: Body) -> None:
    betas = np.random.default_rng(2).uniform(-1.2, 1.2, body.P)
    track = seen_in(body, betas, None)
    camera = Camera(K, np.zeros(5), "test")
    found = {}
    for shape in (True, False):
        given = Ablation(lifter=False, keypoint_offsets=False, shape=shape)
        prepared = prepare_track(body, track, camera, given)
        found[shape] = np.abs(
            fit_shape_to_outline(prepared, usable_masks(prepared), None).beta
        ).max()
    assert found[True] > 0.5
    assert found[False] < 0.02


def test_without_its_own_prior_proportions_and_stature_go_together_as_in_the_population(
    body: Body,
) -> None:
    """As in the population, where short people have relatively long trunks: see
    `with_unknown_stature`.
    """
    track = seen_in(body, np.zeros(body.P), None)
    camera = Camera(K, np.zeros(5), "test")
    information = [
        prepare_track(body, track, camera, Ablation(stature=own)).priors.shape_information
        for own in (True, False)
    ]
    assert information[0] is not None
    assert information[1] is None or np.allclose(information[1], np.diag(np.diag(information[1])))
    assert not np.allclose(information[0], np.diag(np.diag(information[0])))


def test_limbs_are_not_searched_for_when_the_search_is_left_out(
    body: Body, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[int] = []
    monkeypatch.setattr(clip_fit, "search_limbs", lambda *_: calls.append(1))
    track = seen_in(body, np.zeros(body.P), None)
    camera = Camera(K, np.zeros(5), "test")
    prepared = prepare_track(body, track, camera, Ablation(lifter=False))
    start = fit_track(prepared, lambda *_: None)
    path = CameraPath.static(len(track))
    for searched in (False, True):
        clip_fit.fit_clip(prepared, start, path, lambda *_: None, Ablation(limb_search=searched))
        assert bool(calls) == searched
