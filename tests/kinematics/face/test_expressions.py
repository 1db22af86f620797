# SPDX-License-Identifier: GPL-3.0-or-later
"""The expressions of the built-in bodies: on the right side, closing what they should, whatever the
shape.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.kinematics.face import (
    EXPRESSIONS,
    Expression,
    expressions_of,
    mouth_faces_of,
)
from scope.solver.body_file import load_body

MIRROR = np.array([-1.0, 1.0, 1.0])


@pytest.fixture(scope="module")
def body():
    return load_body("scope")


def by_name(body) -> dict[str, Expression]:
    return {expression.name: expression for expression in expressions_of(body)}


def test_there_are_52_in_order_and_only_the_tongue_moves_nothing(body):
    expressions = expressions_of(body)
    assert tuple(e.name for e in expressions) == EXPRESSIONS
    assert [e.name for e in expressions if not len(e.vertices)] == ["tongueOut"]
    for each in expressions:
        assert np.abs(each.offsets).max(initial=0) < 0.05
        # above the neck's joint
        assert (body.v_template[each.vertices, 1] > body.J_template[12, 1] - 0.05).all()


def test_left_is_the_persons_left_and_the_mirror_image_of_right(body):
    found = by_name(body)
    for name in ("eyeBlink", "eyeLookOut", "mouthSmile", "browDown", "noseSneer"):
        left, right = (found[f"{name}{side}"] for side in ("Left", "Right"))
        moved = np.linalg.norm(left.offsets, axis=1)
        assert moved @ body.v_template[left.vertices, 0] > 0
        assert moved.sum() == pytest.approx(np.linalg.norm(right.offsets, axis=1).sum(), rel=0.02)
        places = [body.v_template[e.vertices].mean(axis=0) for e in (left, right)]
        np.testing.assert_allclose(places[0], places[1] * MIRROR, atol=2e-3)


def triangles_of(faces: np.ndarray) -> np.ndarray:
    """Return the corners (2n, 3) of quads (n, 4)."""
    return np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])


def foremost(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the largest z of triangles (n, 3, 3) at each point's x and y; -inf where there is
    none.
    """
    points = points + [1e-6, 0.0, 0.0]  # off the edges in the middle
    apart = (triangles.max(axis=1) < points.min(axis=0)) | (
        triangles.min(axis=1) > points.max(axis=0)
    )
    triangles = triangles[~apart[:, :2].any(axis=1)]
    left, below = triangles.min(axis=1)[:, :2].T
    right, above = triangles.max(axis=1)[:, :2].T
    out = np.full(len(points), -np.inf)
    for i, (x, y) in enumerate(points[:, :2]):
        here = triangles[(left <= x) & (x <= right) & (below <= y) & (y <= above)]
        a, b, c = np.moveaxis(here[:, :, :2] - [x, y], 1, 0)
        pairs = (b, c), (c, a), (a, b)
        areas = np.stack([p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0] for p, q in pairs], axis=1)
        inside = (areas > 0).all(axis=1) | (areas < 0).all(axis=1)
        z = (areas * here[:, :, 2]).sum(axis=1)[inside] / areas.sum(axis=1)[inside]
        out[i] = z.max(initial=-np.inf)
    return out


@pytest.mark.parametrize("side", [1, -1])
def test_a_blink_covers_the_pupil_of_every_shape(body, side):
    blink = by_name(body)["eyeBlinkLeft" if side > 0 else "eyeBlinkRight"]
    of_eyes = np.char.startswith(np.array(body.material_names), "eye_")[body.face_material]
    skin = triangles_of(body.faces[~of_eyes])
    pupils = np.unique(body.faces[body.face_material == body.material_names.index("eye_pupil")])
    pupil_of_side = pupils[body.v_template[pupils, 0] * side > 0]
    for beta in np.random.default_rng(0).normal(size=(3, body.P)):
        rest = body.rest_vertices(beta)
        pupil = rest[pupil_of_side].mean(axis=0, keepdims=True)
        assert foremost(pupil, rest[skin]) < pupil[:, 2]
        closed = rest.copy()
        closed[blink.vertices] += blink.offsets
        assert foremost(pupil, closed[skin]) > pupil[:, 2]


def test_the_inside_of_the_mouth_shows_when_it_opens(body):
    """From in front, a closed mouth shows none of it, an open one some."""
    jaw = by_name(body)["jawOpen"]
    others = np.setdiff1d(np.arange(len(body.faces)), mouth_faces_of(body))
    skin = triangles_of(body.faces[others])
    rest = body.v_template.astype(float)
    opened = rest.copy()
    opened[jaw.vertices] += jaw.offsets
    visible = []
    for vertices in (rest, opened):
        centers = vertices[body.faces[mouth_faces_of(body)]].mean(axis=1)
        visible.append((foremost(centers, vertices[skin]) <= centers[:, 2]).sum())
    assert visible[0] == 0
    assert visible[1] >= 10


def test_a_users_body_has_none(body):
    assert expressions_of(replace(body, file="mine.npz")) == ()
    assert expressions_of(replace(body, name="smpl")) == ()
    assert expressions_of(replace(body, v_template=body.v_template[:100])) == ()
    assert not len(mouth_faces_of(replace(body, name="smpl")))
