# SPDX-License-Identifier: GPL-3.0-or-later
"""Teeth and tongue: rebuilt, and compared with the source's helpers and its text of targets."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scope.scope_addon.kinematics.face import EXPRESSIONS
from scope.solver.body_file import BUILT_IN
from scope.tools.build_body.geometry.mouth import build_mouth
from scope.tools.build_body.source import fetch_wheel

MIRROR = np.array([-1.0, 1.0, 1.0])

wheel = cache(fetch_wheel)  # which computes the checksum each time


@pytest.fixture(scope="module")
def mouth(grown):
    """The built arrays of teeth and tongue, and those of the committed file."""
    with np.load(BUILT_IN["scope"].with_name("mouth.npz")) as file:
        kept = {key: file[key] for key in file.files}
    return build_mouth(wheel(), grown), kept


def test_teeth_and_tongue_are_rebuilt(mouth):
    built, kept = mouth
    assert set(kept) == set(built)
    for key, value in built.items():
        if value.dtype.kind == "f":
            np.testing.assert_allclose(kept[key], value, atol=5e-5, err_msg=key)
        # displacements in whole steps: with another numpy, one lies on the other side of a half
        elif key == "moves":
            np.testing.assert_allclose(kept[key], value, atol=1, err_msg=key)
        else:
            np.testing.assert_array_equal(kept[key], value, err_msg=key)


def mouth_move(arrays, name):
    moves = np.zeros((len(arrays["v_template"]), 3))
    k = EXPRESSIONS.index(name)
    rows = slice(arrays["starts"][k], arrays["starts"][k + 1])
    moves[arrays["vertices"][rows]] = arrays["step_m"] * arrays["moves"][rows]
    return moves


@pytest.mark.parametrize("jaw", ["upper", "lower"])
def test_teeth_are_symmetric_and_face_outwards(mouth, jaw):
    _, kept = mouth
    V = kept["v_template"].astype(float)
    faces = kept["faces"]
    of_jaw = np.linalg.norm(mouth_move(kept, "jawOpen"), axis=1)[faces].min(axis=1) < 1e-9
    chosen = (of_jaw if jaw == "upper" else ~of_jaw) & (kept["face_material"] < 2)
    used = np.unique(faces[chosen])
    mirrored = V[used] * MIRROR
    assert max(np.linalg.norm(V[used] - point, axis=1).min() for point in mirrored) < 1e-4
    crown = chosen & (kept["face_material"] == list(kept["material_names"]).index("teeth"))
    a, b, c, d = (V[faces[crown, k]] for k in range(4))
    normal = np.cross(c - a, d - b)
    middle = (a + b + c + d) / 4
    outer = middle[:, 2] > np.median(middle[:, 2])  # the front teeth
    away = middle[outer] - [0.0, V[used, 1].mean(), V[used, 2].min()]
    lip = normal[outer] * [1, 0, 1]
    # the others are edges and inner sides
    assert ((lip * away * [1, 0, 1]).sum(axis=1) > 0).mean() > 0.6
