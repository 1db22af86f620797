# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera that is held in the hand in front of somebody who comes nearer, whose feet seem to
slide.
"""

from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import Camera, pinhole
from scope.scope_addon.capture.camera.line_segments import Lines
from scope.scope_addon.capture.solve import with_camera_path
from scope.scope_addon.capture.world.assemble import Shot
from scope.scope_addon.capture.world.camera_path import CameraPath
from scope.scope_addon.capture.world.travel_scale import FEET
from scope.solver import load_body
from scope.solver.rotations import exp

T = 120
TIMES = np.arange(T) / 30.0
SLIDING_M_S = 0.6
UP = np.array([0.0, -1.0, 0.0])


def held_in_the_hand(at_rest):
    shaking = 0.01 * np.stack([np.sin(7 * TIMES), np.cos(9 * TIMES), 0 * TIMES], axis=1)
    return Shot(
        load_body("scope"),
        Camera(pinhole(1280, 720, 1100.0), np.zeros(5), "given"),
        CameraPath.rotating(exp(shaking)),
        Lines.none(),
        Fraction(30),
        (1280, 720),
        "made",
        at_rest=np.asarray(at_rest, float).reshape(-1, 3),
    )


@pytest.fixture
def walker(monkeypatch):
    """Somebody all of whose feet slide towards the camera, where up is known."""
    soles = np.tile([0.0, 1.4, 6.0], (T, 4, 1))
    soles[..., 2] -= SLIDING_M_S * TIMES[:, None]
    placed = SimpleNamespace(soles=soles, valid=np.ones(T, bool), times=TIMES)
    known = SimpleNamespace(up=UP)
    monkeypatch.setattr("scope.scope_addon.capture.solve.world_of", lambda *_: known)
    return SimpleNamespace(fitted_places=lambda _: placed)


def directions(below_deg):
    """Fourteen directions so many degrees below the horizon."""
    heading = np.radians(np.linspace(-25, 25, 14))
    below = np.full(14, np.radians(below_deg))
    ahead = np.cos(below)
    return np.stack([ahead * np.sin(heading), np.sin(below), ahead * np.cos(heading)], axis=1)


def test_it_stays_where_the_floor_near_it_is_at_rest(walker):
    shot = with_camera_path(held_in_the_hand(directions(20.0)), walker)
    np.testing.assert_array_equal(shot.path.center, 0.0)
    assert shot.travel_source is None


@pytest.mark.parametrize("at_rest", [[], directions(5.0), directions(20.0)[:3]])
def test_where_only_what_may_be_far_away_is_at_rest_the_feet_tell_and_it_is_said(walker, at_rest):
    shot = with_camera_path(held_in_the_hand(at_rest), walker)
    travelled_m = SLIDING_M_S * TIMES[-1]
    np.testing.assert_allclose(shot.path.center[-1], [0.0, 0.0, travelled_m], atol=0.1)
    assert shot.travel_source == FEET
