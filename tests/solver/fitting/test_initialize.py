# SPDX-License-Identifier: GPL-3.0-or-later
"""The first guess: exact where the measurements fix it, and in front of the camera where they do
not.
"""

import numpy as np
from scope.solver import Keypoints2D, Keypoints3D, Measurements, OrientationField, Priors, make_tree
from scope.solver.fitting.initialize import initial_states
from scope.solver.gauss_newton.terms import make_terms

from ..synthetic import INTRINSICS, forward, project, random_body, random_state

K = 6
P = 4
M = 21
BODY = random_body(np.random.default_rng(1), K, P, M)
TREE = make_tree(BODY)
R0, T0, OMEGA, BETA = random_state(np.random.default_rng(2), K, P)
_, _, POINTS = forward(BODY, R0, T0, OMEGA, BETA)
CONFIDENCE = np.random.default_rng(3).uniform(0.2, 1.0, M)


def guess(measurements):
    return initial_states(TREE, make_terms(TREE, measurements, Priors()), OMEGA, BETA)[0]


def test_points_in_space_give_the_root_where_joints_and_shape_are_known():
    found = guess(Measurements(keypoints3d=Keypoints3D(np.arange(M), POINTS, CONFIDENCE)))
    np.testing.assert_allclose(found.R_camera_root, R0, atol=1e-9, rtol=0)
    np.testing.assert_allclose(found.t_camera_root, T0, atol=1e-9, rtol=0)


def test_directions_alone_give_the_roots_rotation():
    starts = np.array(
        [j for j in range(M - 1) if BODY.keypoint_part[j] == BODY.keypoint_part[j + 1]]
    )
    lines = POINTS[starts + 1] - POINTS[starts]
    # Longer lines say more, but a guess from unit vectors is exact too: all levers are turned by
    # the same rotation.
    field = OrientationField(
        starts, starts + 1, lines / np.linalg.norm(lines, axis=1)[:, None], CONFIDENCE[starts]
    )
    found = guess(Measurements(orientation_field=field))
    assert len(starts) > K
    np.testing.assert_allclose(found.R_camera_root, R0, atol=1e-9, rtol=0)
    assert found.t_camera_root[2] > 1


def in_the_image(t):
    """Return pixels of the upright body that faces the camera, at t: what a guess without depths
    assumes.
    """
    return project(forward(BODY, np.diag([1.0, -1.0, -1.0]), np.array(t), OMEGA, BETA)[2])


def test_pixels_of_an_upright_person_give_the_position():
    t = [-1.0, 0.5, 9.0]
    found = guess(Measurements(INTRINSICS, Keypoints2D(np.arange(M), in_the_image(t), CONFIDENCE)))
    np.testing.assert_allclose(found.t_camera_root, t, atol=1e-6, rtol=0)


def test_pixels_that_fit_only_behind_the_camera_give_a_position_on_their_mean_ray():
    pixels = in_the_image([0.6, -0.4, 4.0])
    inside_out = 2 * pixels.mean(axis=0) - pixels  # each pixel opposite to where it should be
    found = guess(Measurements(INTRINSICS, Keypoints2D(np.arange(M), inside_out, np.ones(M))))
    assert found.t_camera_root[2] > 1
    np.testing.assert_allclose(
        project(found.t_camera_root[None])[0], pixels.mean(axis=0), atol=1e-6
    )


def test_the_last_bits_of_a_decomposition_do_not_matter(monkeypatch):
    """Versions of LAPACK differ in them, and a first fit amplifies them."""
    measured = Measurements(keypoints3d=Keypoints3D(np.arange(M), POINTS, CONFIDENCE))
    found = guess(measured)
    svd = np.linalg.svd

    def another(matrix):
        u, s, vt = svd(matrix)
        return u * (1 + 1e-15), s, vt * (1 - 2e-15)

    monkeypatch.setattr(np.linalg, "svd", another)
    again = guess(measured)
    np.testing.assert_array_equal(again.R_camera_root, found.R_camera_root)
    np.testing.assert_array_equal(again.t_camera_root, found.t_camera_root)
