# SPDX-License-Identifier: GPL-3.0-or-later
"""Teeth and tongue: after the body's own vertices, behind closed lips whatever the shape, and moved
by the jaw.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.kinematics.face import body_with_mouth, expressions_of, mouth_faces_of
from scope.solver.body_file import load_body

from .test_expressions import by_name, foremost, triangles_of


@pytest.fixture(scope="module", params=["scope", "scope_child_h"])
def plain(request):
    return load_body(request.param)


@pytest.fixture(scope="module")
def body(plain):
    return body_with_mouth(plain)


def vertices_of(body, *materials) -> np.ndarray:
    slots = [body.material_names.index(name) for name in materials]
    return np.unique(body.faces[np.isin(body.face_material, slots)])


def moved(body, beta, **weights) -> np.ndarray:
    """(V, 3) the body at rest with a shape and expressions."""
    out = body.rest_vertices(beta).copy()
    for name, weight in weights.items():
        expression = by_name(body)[name]
        out[expression.vertices] += weight * expression.offsets
    return out


def test_the_body_keeps_its_vertices_faces_and_expressions(plain, body):
    V = len(plain.v_template)
    F = len(plain.faces)
    U = len(plain.uv)
    assert len(body.v_template) > V
    for name, count in (
        ("v_template", V),
        ("shapedirs", V),
        ("skin_joints", V),
        ("skin_weights", V),
        ("uv", U),
    ):
        np.testing.assert_array_equal(getattr(body, name)[:count], getattr(plain, name))
    for name in ("faces", "uv_faces", "face_material"):
        np.testing.assert_array_equal(getattr(body, name)[:F], getattr(plain, name))
    assert body.material_names == (*plain.material_names, "teeth", "gums", "tongue")
    assert body.faces[F:].min() == V
    np.testing.assert_array_equal(np.unique(body.faces[F:]), np.arange(V, len(body.v_template)))
    assert body.uv_faces[F:].min() == U
    for small, large in zip(expressions_of(plain), expressions_of(body), strict=True):
        own = large.vertices < V
        np.testing.assert_array_equal(large.vertices[own], small.vertices)
        np.testing.assert_array_equal(large.offsets[own], small.offsets)
    np.testing.assert_array_equal(mouth_faces_of(body), mouth_faces_of(plain))


def test_the_jaw_takes_the_lower_teeth_and_the_tongue(plain, body):
    rest = body.v_template
    teeth = vertices_of(body, "teeth")
    tongue = vertices_of(body, "tongue")
    opened = moved(body, None, jawOpen=1.0) - rest
    lower = np.abs(opened[teeth]).max(axis=1) > 1e-9
    assert lower.mean() == pytest.approx(0.5, abs=0.01)
    front = teeth[rest[teeth, 2] > rest[teeth, 2].max() - 0.02]
    assert opened[np.intersect1d(front, teeth[lower]), 1].max() < -0.015
    assert rest[teeth[lower], 1].mean() < rest[teeth[~lower], 1].mean() - 0.005
    assert opened[tongue, 1].min() < -0.015
    for name, side in (("jawLeft", 1), ("jawRight", -1)):  # the person's left is +x
        aside = moved(body, None, **{name: 1.0})[teeth[lower], 0] - rest[teeth[lower], 0]
        np.testing.assert_allclose(aside, side * 0.008, atol=3e-3)
    shown = moved(body, None, jawOpen=0.6, tongueOut=1.0)
    assert shown[tongue, 2].max() > shown[teeth[lower], 2].max() + 0.005


CLOSED: dict[str, dict[str, float]] = {
    "at rest": {},
    "smile": {"mouthSmileLeft": 1.0, "mouthSmileRight": 1.0},
    "pucker": {"mouthPucker": 1.0},
    "lips over an open jaw": {"jawOpen": 1.0, "mouthClose": 1.0},
    "rolled lips": {"mouthRollLower": 1.0, "mouthRollUpper": 1.0},
    "jaw to the left": {"jawLeft": 1.0},
}


@pytest.mark.parametrize("weights", CLOSED.values(), ids=list(CLOSED))
def test_no_tooth_sticks_through_the_lips_of_any_shape(body, weights):
    """Seen from in front, lips that are closed hide them, but for some in the gap between."""
    shape = np.random.default_rng(2).normal(size=body.P)
    shape[10:] = -1.0  # growth, of children
    vertices = moved(body, shape, **weights)
    of_mouth = [body.material_names.index(name) for name in ("teeth", "gums", "tongue")]
    is_skin = ~np.isin(body.face_material, of_mouth)
    is_skin[mouth_faces_of(body)] = False
    inside = vertices[vertices_of(body, "teeth", "gums", "tongue")[::3]]
    skin = vertices[triangles_of(body.faces[is_skin])]
    assert (foremost(inside, skin) < inside[:, 2]).mean() < 0.02
