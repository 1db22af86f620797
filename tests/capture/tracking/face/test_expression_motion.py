# SPDX-License-Identifier: GPL-3.0-or-later
"""Expressions over time: noise goes, blinks stay, and a face that is lost goes to rest."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.perception.face_record import RECORD
from scope.scope_addon.capture.tracking.expression_motion import RELEASE_S, expression_motion
from scope.scope_addon.kinematics.face import EXPRESSIONS

JAW = EXPRESSIONS.index("jawOpen")
BLINK = EXPRESSIONS.index("eyeBlinkLeft")
T = 120
TIMES = np.arange(T) / 30
LIGHT = RECORD - 1
GAZE = slice(2 + len(EXPRESSIONS), 8 + len(EXPRESSIONS))


def seen_face(size: float = 100.0) -> np.ndarray:
    rows = np.zeros((T, RECORD))
    rows[:, 0] = 0.9
    rows[:, 1] = size
    rows[:, GAZE] = [0, 0, 1, 0, 0, 1]
    rows[:, LIGHT] = 1.0
    return rows


def test_rest_is_calm_and_a_blink_stays_sharp():
    rows = seen_face()
    rng = np.random.default_rng(0)
    blink = np.zeros(T)
    blink[60:64] = 0.4, 0.9, 0.8, 0.3
    rows[:, 2 + JAW] = 0.3 + 0.02 * rng.standard_normal(T)
    rows[:, 2 + BLINK] = blink + 0.01 * np.abs(rng.standard_normal(T))
    weights = expression_motion(rows.copy(), TIMES, smoothing=True)["expressions"]
    assert np.abs(np.diff(weights[:, JAW])).mean() < 0.3 * np.abs(np.diff(rows[:, 2 + JAW])).mean()
    assert weights[:, JAW].mean() == pytest.approx(0.3, abs=0.01)
    found = weights[:, BLINK]
    assert abs(int(found.argmax()) - 61) <= 1
    assert found.max() > 0.9 * 0.9
    assert (found > 0.5).sum() == 2
    assert np.abs(np.diff(found[:55])).max() < 0.01


def test_without_smoothing_the_networks_weights_stay():
    rows = seen_face()
    rows[:, 2 + JAW] = np.random.default_rng(0).uniform(0, 1, T)
    face = expression_motion(rows, TIMES, smoothing=False)
    np.testing.assert_allclose(face["expressions"][:, JAW], rows[:, 2 + JAW], atol=1e-6)
    np.testing.assert_allclose(face["expression_confidence"], 0.9, atol=1e-6)


@pytest.mark.parametrize("smoothing", [False, True])
def test_a_face_that_is_lost_goes_to_rest(smoothing):
    rows = seen_face()
    rows[:, 2 + JAW] = 0.8
    rows[:, GAZE] = [0.6, 0, 0.8, 0.6, 0, 0.8]
    rows[40:90] = 0.0
    face = expression_motion(rows, TIMES, smoothing)
    jaw = face["expressions"][:, JAW]
    gaze = face["gaze"]
    assert (face["expression_confidence"][40:90] == 0).all()
    assert jaw[65] == pytest.approx(0, abs=0.05)
    np.testing.assert_allclose(jaw[[30, 100]], 0.8, atol=0.05)
    assert np.abs(np.diff(jaw)).max() < 2.0 * 0.8 / (30 * RELEASE_S)  # no jump
    np.testing.assert_allclose(gaze[65], [[0, 0, 1]] * 2, atol=0.05)
    np.testing.assert_allclose(np.linalg.norm(gaze, axis=-1), 1, atol=1e-5)


def test_a_face_that_was_never_seen_is_at_rest():
    face = expression_motion(np.zeros((T, RECORD)), TIMES, smoothing=True)
    assert not face["expressions"].any()
    assert not face["expression_confidence"].any()
    np.testing.assert_allclose(face["gaze"], np.tile([0, 0, 1.0], (T, 2, 1)))


@pytest.mark.parametrize("smoothing", [False, True])
def test_eyes_that_look_half_closed_are_open(smoothing):
    rows = seen_face()
    rows[:, 2 + BLINK] = 0.45 + 0.02 * np.random.default_rng(0).standard_normal(T)
    rows[60:63, 2 + BLINK] = 0.9
    found = expression_motion(rows, TIMES, smoothing)["expressions"][:, BLINK]
    assert np.median(found) < 0.03
    assert found[61] == pytest.approx((0.9 - 0.45) / 0.55, abs=0.06)


@pytest.mark.parametrize("smoothing", [False, True])
def test_behind_dark_glasses_eyes_go_to_rest_and_the_mouth_goes_on(smoothing):
    rows = seen_face()
    rows[:, 2 + JAW] = 0.5
    rows[::9, 2 + BLINK] = 0.8
    rows[:, GAZE] = [0.6, 0, 0.8, 0.6, 0, 0.8]
    rows[:60, LIGHT] = 0.3
    rows[[20, 40], LIGHT] = 1.2  # a reflection in two frames
    rows[100, LIGHT] = 0.1  # a shadow that passes
    face = expression_motion(rows, TIMES, smoothing)
    weights = face["expressions"]
    sure = face["expression_confidence"]
    assert weights[:40, BLINK].max() < 0.02
    np.testing.assert_allclose(face["gaze"][:40], [[[0, 0, 1]] * 2] * 40, atol=0.05)
    np.testing.assert_allclose(weights[:, JAW], 0.5, atol=1e-3)
    assert sure[:45].max() < 0.6
    assert sure[80:].min() > 0.85
    assert weights[75:, BLINK].max() > 0.7
    np.testing.assert_allclose(face["gaze"][[70, 80, 119], 0], [[0.6, 0, 0.8]] * 3, atol=0.05)
