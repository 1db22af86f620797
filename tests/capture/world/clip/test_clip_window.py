# SPDX-License-Identifier: GPL-3.0-or-later
"""Planes of single points beside the one of the soles.

Places at which points rest, on points whose rests are known.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.world.clip_window import resting_places, with_planes
from scope.solver import Floor

UP = np.array([0.0, -1.0, 0.0])


SOLES = np.array([90, 91])


NORMALS = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.6, 0.8]])


@pytest.mark.parametrize("below", [None, [0.25, 1.0]])
def test_soles_keep_their_plane_and_weights_and_points_of_arms_are_free_above_theirs(below):
    floor = Floor(SOLES, UP, -1.5, [0.25, 1.0], below=below)
    joined = with_planes(floor, np.array([13, 15, 17]), NORMALS, np.array([0.1, -2.0, 3.0]))
    np.testing.assert_array_equal(joined.indices, [90, 91, 13, 15, 17])
    np.testing.assert_array_equal(joined.normal, [UP, UP, *NORMALS])
    np.testing.assert_array_equal(joined.offset, [-1.5, -1.5, 0.1, -2.0, 3.0])
    np.testing.assert_array_equal(joined.contact, [0.25, 1.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(joined.below[:2], [1.0, 1.0] if below is None else below)
    assert (joined.below[2:] > 0.0).all()


def test_without_points_the_floor_stays_and_without_a_floor_the_planes_stand_alone():
    floor = Floor(SOLES, UP, -1.5, [1.0, 1.0])
    none = np.zeros(0, int)
    assert with_planes(floor, none, np.zeros((0, 3)), np.zeros(0)) is floor
    assert with_planes(None, none, np.zeros((0, 3)), np.zeros(0)) is None
    alone = with_planes(None, np.array([13]), NORMALS[:1], np.array([0.1]))
    np.testing.assert_array_equal(alone.normal, NORMALS[:1])
    np.testing.assert_array_equal(alone.contact, [0.0])


T = 30


# metres; the point rests in frames 0 to 11 and 18 to 29
STEP = np.where(np.arange(T) < 15, 0.0, 0.4)


RESTING = np.where((np.arange(T) < 12) | (np.arange(T) >= 18), 0.9, 0.1)[:, None]


def _points(noise_m: float) -> np.ndarray:
    points = np.zeros((T, 1, 3))
    points[:, 0, 0] = STEP
    points[:, 0, 2] = 4.0 + noise_m * np.linspace(-1.0, 1.0, T)
    return points


def test_each_rest_has_one_place_where_the_point_is_on_average():
    points = _points(0.01)
    places, p = resting_places(points, RESTING)
    np.testing.assert_allclose(p, np.where(RESTING > 0.5, RESTING, 0.0))
    for rest in (slice(0, 12), slice(18, T)):
        mean = points[rest, 0].mean(axis=0)
        np.testing.assert_allclose(places[rest, 0], np.tile(mean, (12, 1)))


def test_a_point_that_strays_or_never_rests_has_no_place():
    assert not resting_places(_points(0.1), RESTING)[1].any()
    assert not resting_places(_points(0.0), np.zeros((T, 1)))[1].any()
