# SPDX-License-Identifier: GPL-3.0-or-later
"""Averaging over mesh edges keeps what it should, and acts nowhere else."""

from __future__ import annotations

import numpy as np
from scope.tools.build_body.geometry.diffusion import bump, diffuse, perineum
from scope.tools.build_body.geometry.mesh import edges

from .quad_meshes import grid

VERTICES, QUADS = grid(9, 9)
LINKS = edges(QUADS)


def test_one_round_is_the_mean_of_the_neighbours() -> None:
    values = np.random.default_rng(1).normal(size=(81, 2))
    strength = np.zeros(81)
    strength[40] = 0.25
    found = diffuse(LINKS, values, strength, 1)
    np.testing.assert_allclose(
        found[40], 0.75 * values[40] + 0.25 * values[[31, 39, 41, 49]].mean(axis=0)
    )
    np.testing.assert_array_equal(np.delete(found, 40, axis=0), np.delete(values, 40, axis=0))


def test_weights_stay_a_partition() -> None:
    rng = np.random.default_rng(2)
    found = diffuse(LINKS, rng.dirichlet(np.ones(5), 81), rng.uniform(0, 1, 81), 30)
    np.testing.assert_allclose(found.sum(axis=1), 1.0)
    assert found.min() >= 0


def test_what_is_mirrored_stays_so() -> None:
    rng = np.random.default_rng(3)
    values = rng.normal(size=(9, 9))
    strength = rng.uniform(0, 1, (9, 9))
    values = values + values[:, ::-1]
    strength = strength + strength[:, ::-1]
    found = diffuse(LINKS, values.reshape(81, 1), strength.ravel() / 2, 20).reshape(9, 9)
    np.testing.assert_allclose(found, found[:, ::-1], atol=1e-14)


def test_a_bump_is_one_at_its_centre_and_zero_from_its_radius_on() -> None:
    found = bump(VERTICES, VERTICES[40], 2.0).reshape(9, 9)
    assert found[4, 4] == 1.0
    distance = np.linalg.norm(VERTICES - VERTICES[40], axis=1).reshape(9, 9)
    np.testing.assert_array_equal(found > 0, distance < 2.0)
    assert (np.diff(found[4, 4:]) <= 0).all()


def test_the_lowest_point_of_the_midline_is_found_though_others_are_lower() -> None:
    vertices = np.array([[0.0, 1, 0], [0, -2, 0.5], [0, 3, 0], [1, -9, 0], [-1, -9, 0]])
    np.testing.assert_array_equal(perineum(np.array([0, 1, 2, 4, 3]), vertices), [0, -2, 0.5])
