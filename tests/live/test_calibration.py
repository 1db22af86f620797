# SPDX-License-Identifier: GPL-3.0-or-later
"""The approach to a new estimate against its closed form, and against what a jump of velocity would
do.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import Camera
from scope.scope_addon.live.calibration import GradualCalibration, LiveCalibration
from scope.scope_addon.live.session import SETTLED_S, SETTLING_S


def calibration(height_m=1.2, tilt=0.0, focal_px=1000.0, beta=0.0):
    camera = Camera(np.diag([focal_px, focal_px, 1.0]), np.zeros(5), "")
    up = np.array([0.0, -np.cos(tilt), np.sin(tilt)])
    return LiveCalibration(camera, np.full(3, beta), up, np.array([0.0, 0.0, height_m]))


BEFORE = calibration(1.0)
AFTER = calibration(1.1)


def course(step_s, seconds, world_s=SETTLING_S, before=BEFORE, after=AFTER):
    """The calibrations of an approach that has long been at one estimate, from when another one
    comes.
    """
    gradual = GradualCalibration(before, SETTLING_S)
    return [gradual.step(after, step_s, world_s) for _ in range(round(seconds / step_s))]


def heights(calibrations):
    return np.array([each.camera_position[2] for each in calibrations])


def test_an_estimate_is_approached_as_by_three_stages_in_a_row():
    t = np.arange(1, 1001) * 1e-3 / SETTLING_S
    expected = 1.0 + 0.1 * (1 - np.exp(-t) * (1 + t + t**2 / 2))
    np.testing.assert_allclose(heights(course(1e-3, 1.0)), expected, atol=1e-3)


def test_everything_has_arrived_when_it_is_said_to_at_any_rate():
    after = calibration(1.1, 0.1, 1200.0, 2.0)
    for rate in (2, 30):
        last = course(1 / rate, SETTLED_S, after=after)[-1]
        assert last.camera_position[2] == pytest.approx(1.1, abs=1e-4)
        assert last.up @ after.up == pytest.approx(1.0, abs=1e-6)
        assert last.betas == pytest.approx(after.betas, abs=1e-3)
