# SPDX-License-Identifier: GPL-3.0-or-later
"""Straightening legs: of a made leg whose joints are wrong in a known way, and never what CMU's
solver held at 0.
"""

import numpy as np
import pytest
from scope.tools.mocap.straight_legs import MOST_M, flexion, knee_flexions, straightened
from scope.tools.mocap.take import Take

THIGH = 0.42
SHANK = 0.41
NAMES = ("pelvis", *(f"{s}_{j}" for s in ("left", "right") for j in ("hip", "knee", "ankle")))


def made_take(knee_deg, name="train_directing_traffic_1", source="cmu_expmap", lowered_m=0.025):
    """Somebody who stands facing +z and bends the knees by these angles (T,), hips and ankles
    displaced as CMU's are.

    ``lowered_m``: how far the hips are below where they should be.
    """
    half = 0.5 * np.radians(np.asarray(knee_deg, float))
    T = len(half)
    positions = np.zeros((T, len(NAMES), 3))
    positions[:, 0, 1] = 0.95
    orientations = np.tile(np.eye(3), (T, len(NAMES), 1, 1))
    for k, x in ((1, 0.09), (4, -0.09)):
        zero = np.zeros(T)
        hip = np.array([x, 0.9, 0.0]) + np.zeros((T, 1))
        knee = hip + np.stack([zero, -THIGH * np.cos(half), THIGH * np.sin(half)], axis=1)
        ankle = knee + np.stack([zero, -SHANK * np.cos(half), -SHANK * np.sin(half)], axis=1)
        positions[:, k : k + 3] = np.stack([hip - [0.0, lowered_m, 0.0], knee, ankle], axis=1)
    return Take(name, "expmap_someone", 30.0, NAMES, positions, source, orientations=orientations)


def legs(take):
    return {name: take.joint(name) for name in NAMES[1:]}


def test_flexion_has_the_sign_of_the_side_to_which_a_knee_bends():
    left = np.array([[1.0, 0.0, 0.0]])
    hip = np.array([[0.0, 1.0, 0.0]])
    ankle = np.array([[0.0, 0.0, 0.0]])
    assert flexion(hip, np.array([[0.0, 0.5, 0.1]]), ankle, left) == pytest.approx(
        2 * np.degrees(np.arctan(0.2))
    )
    assert flexion(hip, np.array([[0.0, 0.5, -0.1]]), ankle, left) == pytest.approx(
        -2 * np.degrees(np.arctan(0.2))
    )
    assert flexion(hip, np.array([[0.0, 0.5, 0.0]]), ankle, left) == pytest.approx(0.0)


def test_standing_knees_get_the_flexion_of_people():
    before = made_take(np.linspace(12.0, 30.0, 40))
    after = straightened(before)
    flexed = knee_flexions(legs(after))
    assert np.percentile(flexed, 5) == pytest.approx(4.0, abs=0.1)
    # The same distance turns all knees by nearly as much.
    turned = knee_flexions(legs(before)) - flexed
    assert np.ptp(turned) < 1.5
    moved = before.joint("left_knee") - after.joint("left_knee")
    x = np.linalg.norm(moved, axis=1) / np.cos(np.radians(knee_flexions(legs(after))[0]) / 2) ** 2
    assert 0.0 < x.min() < x.max() < MOST_M
    np.testing.assert_allclose(
        after.joint("left_hip") - before.joint("left_hip"), [[0.0, 0.025, 0.0]] * 40, atol=1e-12
    )
    np.testing.assert_array_equal(after.joint("pelvis"), before.joint("pelvis"))
