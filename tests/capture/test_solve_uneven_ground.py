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
from scope.scope_addon.motion import Motion

from .standing_people import BODY, RATE, STAYS_S, seen, steps

pytestmark = pytest.mark.usefixtures("exact_lifting")
STEP_M = 0.2  # a height at which a foot is taken to be on the floor, unless the ground is uneven


@pytest.fixture(scope="module", params=[STEP_M, -STEP_M], ids=["up", "down"])
def height_m(request: pytest.FixtureRequest) -> float:
    return request.param


@pytest.fixture(scope="module", params=[False, True], ids=["one_floor", "uneven"])
def captured(request: pytest.FixtureRequest, height_m: float) -> Motion:
    track = steps(height_m)
    return solve(seen(track, request.param), [track], lambda *_: None, [BODY.stature()]).motions[0]


def test_feet_rest_on_a_step_only_where_the_ground_is_uneven(
    captured: Motion, height_m: float
) -> None:
    heights = foot_heights(captured, BODY)
    stays = round(STAYS_S * RATE) - 4
    rise = (np.median(heights[-stays:]) - np.median(heights[:stays])) / height_m
    if captured.uneven_ground:
        assert rise == pytest.approx(1.0, abs=0.15)
    else:
        assert rise < 0.6
    for part in (heights[:stays], heights[-stays:]):
        assert np.ptp(part, axis=0).max() < 0.01


def test_nothing_is_under_uneven_ground(captured: Motion) -> None:
    sunk = replace(captured, trans=captured.trans - np.array([0.0, 0.0, 0.3], np.float32))
    warned = floor_warnings("made.mp4", BODY, [sunk], sunk.timestamps)
    assert bool(warned) != captured.uneven_ground
    assert under_floor(sunk, BODY).any() != captured.uneven_ground
