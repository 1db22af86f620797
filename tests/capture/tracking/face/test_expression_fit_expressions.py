# SPDX-License-Identifier: GPL-3.0-or-later
"""Expressions and gaze of a face that is seen briefly: what the networks make of it; of others, the
fit's.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.perception.face_landmarks import (
    EXPRESSION_POINTS,
    ExpressionNetwork,
    FaceNetwork,
)
from scope.scope_addon.capture.perception.face_record import RECORD, gaze, parts, record
from scope.scope_addon.capture.perception.region import Region
from scope.scope_addon.capture.tracking.face import expression_fit
from scope.scope_addon.capture.tracking.face.expression_fit import fitted, with_expressions

FPS = 5
BEFORE = np.zeros(RECORD)  # a frame without a face


@pytest.fixture(scope="module")
def clip(frames):
    """Two and a half seconds of a real face: the network's estimates, and a track's rows of
    them.
    """
    network = FaceNetwork(1)
    region = Region((256.0, 118.0), 200.0, 0.0)
    estimates = []
    for image in frames("clips/squats_5fps", stop=13):
        estimates.append(network.estimate(image, region))
        region = estimates[-1].next_region
    return estimates, np.array([BEFORE, *(record(estimate) for estimate in estimates)], np.float32)


@pytest.mark.parametrize("seen", [1, 9])
def test_a_face_that_was_seen_briefly_gets_the_networks_weights_and_the_gaze_of_its_irises(
    clip, seen
):
    estimates = clip[0][:seen]
    rows = clip[1][: seen + 1]
    out = with_expressions(rows, np.arange(seen + 1) / FPS)
    _, _, weights, directions, _ = parts(out)
    assert not out[0].any()
    network = ExpressionNetwork()
    of_network = [network.estimate(e.landmarks[list(EXPRESSION_POINTS), :2]) for e in estimates]
    np.testing.assert_allclose(weights[1:], of_network, atol=1e-5)
    np.testing.assert_allclose(directions[1:], [gaze(e.landmarks) for e in estimates], atol=1e-5)
    assert weights[1:].any()
    others = np.ones(RECORD, bool)
    others[2 : 2 + weights.shape[1] + 6] = False
    np.testing.assert_array_equal(out[:, others], rows[:, others])


def test_the_expression_network_is_not_opened_for_a_face_that_is_seen_for_longer_or_not_at_all(
    clip, monkeypatch
):
    monkeypatch.setattr(expression_fit, "ExpressionNetwork", None)
    rows = clip[1]
    times = np.arange(len(rows)) / FPS
    np.testing.assert_array_equal(with_expressions(rows, times), fitted(rows, times))
    assert not with_expressions(np.zeros_like(rows), times).any()
