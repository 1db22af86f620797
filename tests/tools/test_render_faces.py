# SPDX-License-Identifier: GPL-3.0-or-later
"""What rendered faces wear and how they are turned, by what can be measured on the meshes."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.kinematics.face.expressions import expressions_of
from scope.tools.render_faces.beard import bearded, grow_beard
from scope.tools.render_faces.glasses import STYLES, glasses
from scope.tools.render_faces.sequences import in_motion, talk_and_grimaces, turned_away
from scope.tools.render_faces.sets import SETS
from scope.tools.render_faces.truth import to_camera, with_expression
from scope.tools.render_faces.worn import WORN, put_on


def clip():
    return talk_and_grimaces(np.random.default_rng(3), 2, 3.0)


@pytest.mark.parametrize("name", STYLES)
def test_glasses_are_before_the_eyes_and_touch_no_skin(body, name):
    face = body.v_template
    parts = glasses(STYLES[name], body, face)
    pupils = np.unique(
        body.faces[body.face_material == list(body.material_names).index("eye_pupil")]
    )
    lenses = parts["lenses"].vertices.reshape(2, -1, 3)
    for side, lens in zip((1, -1), lenses, strict=True):
        pupil = face[pupils[side * face[pupils, 0] > 0]].mean(axis=0)
        assert (lens[:, :2].min(0) < pupil[:2]).all()
        assert (pupil[:2] < lens[:, :2].max(0)).all()
        assert 0.008 < lens[:, 2].min() - pupil[2] < 0.035
        within = ((face[:, :2] > lens[:, :2].min(0)) & (face[:, :2] < lens[:, :2].max(0))).all(
            axis=1
        )
        assert face[within, 2].max() < lens[:, 2].max()
    ends = parts["frame"].vertices
    assert ends[:, 2].min() == pytest.approx(0.03, abs=0.005)  # at the ears


def test_a_beard_is_around_the_mouth_and_moves_with_the_jaw(body):
    beard = grow_beard(body, np.random.default_rng(0))
    at_rest = beard.vertices(body.v_template).reshape(-1, 3, 3)
    roots = at_rest[:, :2].mean(axis=1)
    nearest = [np.linalg.norm(body.v_template - root, axis=1).min() for root in roots[::90]]
    assert max(nearest) < 0.01
    assert (np.linalg.norm(at_rest[:, 2] - roots, axis=1) < 0.02).all()
    jaw = next(k for k, e in enumerate(expressions_of(body)) if e.name == "jawOpen")
    weights = np.eye(52)[jaw]
    opened = beard.vertices(with_expression(body, weights).v_template).reshape(-1, 3, 3)
    chin = (roots[:, 1] < 0.601) & (roots[:, 2] > 0.1)
    assert chin.sum() > 500
    assert (at_rest - opened)[chin, 0, 1].mean() > 0.01
    assert bearded(body)[body.v_template[:, 1] > 0.696].max() == 0  # at the height of the eyes


def test_heads_are_turned_away_by_45_to_60_degrees():
    forward = turned_away(clip()).R_camera_head[:, :, 2]
    yaw = np.degrees(np.arctan2(forward[:, 0], -forward[:, 2]))
    assert abs(yaw).min() > 44
    assert abs(yaw).max() < 61
    assert (yaw > 0).any()
    assert (yaw < 0).any()


def test_a_head_in_motion_moves_and_does_what_it_did():
    still = clip()
    moving = in_motion(clip())
    np.testing.assert_array_equal(still.weights, moving.weights)
    nose = np.array([[0.0, 0.64, 0.15]])
    track = np.array([to_camera(moving, t, nose)[0] for t in range(90)])
    speed = np.linalg.norm(np.diff(track, axis=0), axis=1) * 30
    assert 0.25 < speed.max() < 1.0


def test_what_sets_wear_has_a_material(body):
    for name, faces in SETS.items():
        worn = put_on(faces.worn, body, body.v_template, np.random.default_rng(0))
        assert set(worn.faces) <= set(WORN), name
        for key, points in worn.vertices(body.v_template).items():
            assert max(max(face) for face in worn.faces[key]) == len(points) - 1
