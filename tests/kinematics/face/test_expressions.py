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


@pytest.fixture(scope="module", params=["scope", "scope_h"])
def body(request):
    return load_body(request.param)


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


def covered(point: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether one of the triangles (n, 3, 3) lies in front of the point, seen along z."""
    a, b, c = (triangles[:, k, :2] - point[:2] for k in range(3))
    areas = np.stack(
        [b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0], c[:, 0] * a[:, 1] - c[:, 1] * a[:, 0]], axis=1
    )
    areas = np.concatenate([areas, (a[:, :1] * b[:, 1:] - a[:, 1:] * b[:, :1])], axis=1)
    inside = (areas > 0).all(axis=1) | (areas < 0).all(axis=1)
    depth = (areas * triangles[:, :, 2]).sum(axis=1)[inside] / areas.sum(axis=1)[inside]
    return bool((depth > point[2]).any())


@pytest.mark.parametrize("side", [1, -1])
def test_a_blink_covers_the_pupil_of_every_shape(body, side):
    blink = by_name(body)["eyeBlinkLeft" if side > 0 else "eyeBlinkRight"]
    of_eyes = np.char.startswith(np.array(body.material_names), "eye_")[body.face_material]
    skin = np.concatenate([body.faces[~of_eyes][:, [0, 1, 2]], body.faces[~of_eyes][:, [0, 2, 3]]])
    pupils = np.unique(body.faces[body.face_material == body.material_names.index("eye_pupil")])
    pupil_of_side = pupils[body.v_template[pupils, 0] * side > 0]
    for beta in (np.zeros(body.P), *np.random.default_rng(0).normal(size=(5, body.P))):
        rest = body.rest_vertices(beta)
        pupil = rest[pupil_of_side].mean(axis=0)
        assert not covered(pupil, rest[skin])
        closed = rest.copy()
        closed[blink.vertices] += blink.offsets
        assert covered(pupil, closed[skin])


def test_the_inside_of_the_mouth_shows_when_it_opens(body):
    """From in front, a closed mouth shows none of it, an open one some."""
    jaw = by_name(body)["jawOpen"]
    others = np.setdiff1d(np.arange(len(body.faces)), mouth_faces_of(body))
    skin = np.concatenate([body.faces[others][:, [0, 1, 2]], body.faces[others][:, [0, 2, 3]]])
    rest = body.v_template.astype(float)
    opened = rest.copy()
    opened[jaw.vertices] += jaw.offsets
    visible = []
    for vertices in (rest, opened):
        centers = vertices[body.faces[mouth_faces_of(body)]].mean(axis=1)
        triangles = vertices[skin]
        below = (triangles.max(axis=1) < centers.min(axis=0))[:, :2].any(axis=1)
        above = (triangles.min(axis=1) > centers.max(axis=0))[:, :2].any(axis=1)
        near = triangles[~below & ~above]  # the others cover none of them, and take long
        visible.append(sum(not covered(center, near) for center in centers))
    assert visible[0] == 0
    assert visible[1] >= 10


def test_a_users_body_has_none(body):
    assert expressions_of(replace(body, file="mine.npz")) == ()
    assert expressions_of(replace(body, name="smpl")) == ()
    assert expressions_of(replace(body, v_template=body.v_template[:100])) == ()
    assert not len(mouth_faces_of(replace(body, name="smpl")))
