# SPDX-License-Identifier: GPL-3.0-or-later
"""Somebody who steps up or down: exact keypoints and world landmarks, solved with one floor and on
uneven ground.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.reporting import floor_warnings
from scope.scope_addon.capture.solve import solve
from scope.scope_addon.kinematics.foot_skin import foot_heights, under_floor

from .standing_people import BODY, RATE, STAYS_S, seen, steps

pytestmark = pytest.mark.usefixtures("exact_lifting")
STEP_M = 0.2  # a height at which a foot is taken to be on the floor, unless the ground is uneven


@pytest.mark.parametrize(
    ("height_m", "is_uneven"), [(STEP_M, False), (STEP_M, True), (-STEP_M, True)]
)
def test_feet_rest_on_a_step_and_nothing_is_under_the_floor_only_where_the_ground_is_uneven(
    height_m: float, is_uneven: bool
) -> None:
    track = steps(height_m)
    shot = seen(track, is_uneven)
    (captured,) = solve(shot, [track], lambda *_: None, [BODY.stature()]).motions
    assert captured.uneven_ground is is_uneven
    heights = foot_heights(captured, BODY)
    stays = round(STAYS_S * RATE) - 4
    rise = (np.median(heights[-stays:]) - np.median(heights[:stays])) / height_m
    if is_uneven:
        assert rise == pytest.approx(1.0, abs=0.15)
    else:
        assert rise < 0.6
    for part in (heights[:stays], heights[-stays:]):
        assert np.ptp(part, axis=0).max() < 0.01
    sunk = replace(captured, trans=captured.trans - np.array([0.0, 0.0, 0.3], np.float32))
    warned = floor_warnings("made.mp4", BODY, [sunk], sunk.timestamps)
    assert bool(warned) != is_uneven
    assert under_floor(sunk, BODY).any() != is_uneven
