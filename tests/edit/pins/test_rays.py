# SPDX-License-Identifier: GPL-3.0-or-later
"""Points that project to a pixel, as far away as another point is."""

import numpy as np
import pytest
from scope.scope_addon.edit.pins.rays import nearest_on_ray, pixel_of, point_at_depth

K = np.array([[900.0, 0, 320], [0, 900.0, 240], [0, 0, 1]])
POINT = np.array([0.2, 3.0, 0.9])


def looking(pitch, height=1.0):
    """A camera at the origin that looks along y, and down by some degrees."""
    c = np.cos(np.radians(pitch))
    s = np.sin(np.radians(pitch))
    T = np.eye(4)
    T[:3, :3] = np.stack([[1.0, 0, 0], [0, -s, -c], [0, c, -s]], axis=1)
    T[2, 3] = height
    return T, K


@pytest.mark.parametrize("pitch", [-30.0, 0.0, 40.0])
def test_what_is_below_in_the_image_is_below_at_the_same_distance_on_the_floor(pitch):
    camera = looking(pitch)
    lower = POINT - [0.1, 0.0, 0.25]
    np.testing.assert_allclose(
        point_at_depth(camera, pixel_of(camera, lower), POINT), lower, atol=1e-9
    )


def test_a_camera_that_looks_steeply_down_moves_a_point_across_its_axis():
    camera = looking(70.0, 4.0)
    place = point_at_depth(camera, pixel_of(camera, POINT) + [30.0, 40.0], POINT)
    np.testing.assert_allclose(
        pixel_of(camera, place), pixel_of(camera, POINT) + [30.0, 40.0], atol=1e-6
    )
    assert abs((place - POINT) @ camera[0][:3, 2]) < 1e-9


def test_a_ray_that_does_not_meet_the_plane_has_its_nearest_point():
    camera = looking(44.0)
    # more than 90 degrees from level
    below = np.array([320.0, 240.0 + 900.0 * np.tan(np.radians(50.0))])
    place = point_at_depth(camera, below, POINT)
    np.testing.assert_allclose(place, nearest_on_ray(camera, below, POINT))
    assert np.isfinite(place).all()


def test_the_nearest_point_on_a_ray_is_in_front_of_the_camera():
    camera = looking(0.0)
    np.testing.assert_allclose(
        nearest_on_ray(camera, np.array([320.0, 240.0]), POINT), [0.0, 3.0, 1.0], atol=1e-9
    )
    behind = nearest_on_ray(camera, np.array([320.0, 240.0]), -POINT)
    assert behind[1] > 0
