# SPDX-License-Identifier: GPL-3.0-or-later
"""People of rendered scenes: size, clothes and mass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scope.benchmarks.scenes.people import DENSITY, Person
from scope.scope_addon.capture.overlay.rasterizer import vertex_normals


@pytest.fixture(scope="module")
def person(body):
    rotations = np.tile(np.eye(3), (2, body.K + 1, 1, 1))
    return Person("stands", rotations, np.zeros((2, 3)), np.zeros(body.P), 1.0, 1.0, 0.02, 0.0, 3)


def test_all_of_a_person_scales(body, person):
    small = replace(person, scale=0.7)
    np.testing.assert_allclose(small.joints(body), 0.7 * person.joints(body))
    np.testing.assert_allclose(small.skin(body, 0), 0.7 * person.skin(body, 0))
    assert small.mass_index(body) == pytest.approx(0.7 * person.mass_index(body))


def test_a_childs_head_is_larger_about_its_joint(body, person):
    large = replace(person, head_scale=1.2)
    top = body.v_template[:, 1].argmax()
    joint = body.joint_names.index("head")
    above = [p.skin(body, 0)[top] - p.joints(body)[0, joint] for p in (person, large)]
    np.testing.assert_allclose(above[1], 1.2 * above[0], rtol=1e-3)
    np.testing.assert_array_equal(person.limbs(body), large.limbs(body))


def test_clothes_stand_off_outwards_and_bare_skin_does_not(body, person):
    bare = person.skin(body, 0)
    dressed = person.dressed(body, 0, person.offsets(body))
    off = np.linalg.norm(dressed - bare, axis=1)
    assert 0.015 < off.max() <= 0.02 + 1e-9
    corners = body.faces[body.face_material == body.material_names.index("skin")]
    assert off[np.unique(corners)].max() == 0.0
    outwards = np.einsum("vi,vi->v", dressed - bare, vertex_normals(bare, body.triangles()))
    assert outwards.min() >= 0.0


def test_the_default_body_weighs_what_people_weigh(body, person):
    index = person.mass_index(body)
    assert 18 < index < 25
    # by the divergence theorem, with other coordinates: V = sum of z dA
    a, b, c = np.moveaxis(body.v_template[body.triangles()], 1, 0)
    volume = ((a + b + c)[:, 2] / 3 * np.cross(b - a, c - a)[:, 2] / 2).sum()
    assert index == pytest.approx(
        DENSITY * abs(volume) / body.stature(np.zeros(body.P)) ** 2, rel=0.01
    )
