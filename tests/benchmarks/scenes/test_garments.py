# SPDX-License-Identifier: GPL-3.0-or-later
"""Garments hang around the body, where they are said to; girths and mass are a body's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.benchmarks.scenes.garments import COAT_OPEN_DEG, coat, girths_m, mass_kg, skirt
from scope.benchmarks.scenes.people import Person
from scope.solver import Body
from scope.solver.rotations import exp


def test_a_skirt_encloses_hips_and_thighs_and_flares(body: Body) -> None:
    betas = np.zeros(body.P)
    points = skirt(body, betas, (0.02, 0.1)).points
    skin = body.rest_vertices(betas)
    joints = body.rest_joints(betas)
    names = body.joint_names
    assert points[:, 1].min() == pytest.approx(joints[names.index("left_knee"), 1], abs=0.02)
    assert points[:, 1].max() == pytest.approx(joints[names.index("spine1"), 1], abs=1e-9)
    levels = np.unique(points[:, 1].round(9))
    widths = [np.ptp(points[np.isclose(points[:, 1], level), 0]) for level in levels]
    assert widths[0] > widths[-1] + 0.16  # lowest first: twice 8 cm, and the hips
    for level in levels:
        ring = points[np.isclose(points[:, 1], level)]
        legs = skin[(np.abs(skin[:, 1] - level) < 0.01) & (np.abs(skin[:, 0]) < 0.25)]
        assert np.abs(legs[:, 0]).max() < np.abs(ring[:, 0]).max()


def test_a_coat_is_open_in_front(body: Body) -> None:
    betas = np.zeros(body.P)
    points = coat(body, betas).points
    joints = body.rest_joints(betas)
    names = body.joint_names
    assert points[:, 1].max() == pytest.approx(joints[names.index("left_collar"), 1])
    for level in np.unique(points[:, 1].round(9)):
        ring = points[np.isclose(points[:, 1], level)]
        middle = ring[:, 0].mean()
        radius = np.ptp(ring[:, 0]) / 2
        front = ring[ring[:, 2] > np.quantile(ring[:, 2], 0.97)]
        assert np.abs(front[:, 0] - middle).min() >= 0.95 * radius * np.sin(
            np.radians(COAT_OPEN_DEG)
        )


def test_a_garment_moves_with_the_pelvis(body: Body) -> None:
    betas = np.zeros(body.P)
    R = exp(np.array([0.1, 0.7, -0.2]))
    t = np.array([0.3, -0.1, 3.0])
    garment = skirt(body, betas)
    placed = garment.placed(body, betas, R, t)
    np.testing.assert_allclose(
        (placed - t) @ R + body.rest_joints(betas)[0], garment.points, atol=1e-12
    )


def test_girths_and_mass_grow_with_the_body(body: Body) -> None:
    """A body larger by a tenth has girths larger by a tenth and 1.1³ times the mass; mass as of a
    rendered person.
    """
    betas = np.zeros(body.P)
    waist, hips = girths_m(body, betas)
    assert 0.65 < waist < 0.95
    assert waist < hips < 1.15
    template = 1.1 * body.v_template
    joints = 1.1 * body.J_template
    larger = replace(body, v_template=template, J_template=joints)
    assert girths_m(larger, betas) == pytest.approx((1.1 * waist, 1.1 * hips), rel=0.02)
    assert mass_kg(larger, betas) == pytest.approx(1.331 * mass_kg(body, betas))
    still = np.tile(np.eye(3), (1, body.K + 1, 1, 1))
    person = Person("stands", still, np.zeros((1, 3)), betas, 1.0, 1.0, 0.0, 0.0, 0)
    assert mass_kg(body, betas) == pytest.approx(person.mass_index(body) * body.stature(betas) ** 2)
