# SPDX-License-Identifier: GPL-3.0-or-later
"""A face that was turned, scaled and moved comes back as it was."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.capture.tracking.face.expression_fit import aligned, view_terms
from scope.solver.rotations import exp

Y_UP = np.array([1.0, -1.0, -1.0])
RNG = np.random.default_rng(0)
FACE = RNG.standard_normal((40, 3))
SHARES = RNG.dirichlet(np.ones(40))


@pytest.mark.parametrize("turn", [(0, 0, 0), (0.3, -0.7, 0.1), (-0.2, 0.5, 1.5)])
def test_a_transformed_face_comes_back(turn):
    R_camera_face = exp(np.array(turn, float))
    pixels = (80.0 * FACE @ R_camera_face.T) * Y_UP + [320, 200, 15]
    faces = aligned(pixels[None], FACE, SHARES)
    np.testing.assert_allclose(faces.points[0], FACE, atol=1e-9)
    np.testing.assert_allclose(faces.turns[0], turn, atol=1e-9)


def test_a_reflected_face_is_not_reflected_back():
    pixels = FACE * [-1, 1, 1] * Y_UP
    faces = aligned(pixels[None], FACE, SHARES)
    assert np.abs(faces.points[0] - FACE).max() > 0.5


def test_landmarks_that_coincide_give_finite_numbers():
    faces = aligned(np.full((2, 40, 3), 7.0), FACE, SHARES)
    assert np.isfinite(faces.points).all()


def test_the_terms_of_steep_views_do_not_grow():
    assert np.abs(view_terms(np.array([[0.0, 3.0, 0.0]]))).max() < 1
