# SPDX-License-Identifier: GPL-3.0-or-later
"""Keypoints of users' bodies: known vertices on published meshes, geometry on any other, rigid and
linear in shape.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.untrusted.body_file import load_body, load_model
from scope.solver.body import Body

# Vertex numbers, as found in several public projects.
OF_SMPL = {
    "nose": 332, "left_eye": 2800, "right_eye": 6260, "left_ear": 583, "right_ear": 4071,
    "left_big_toe": 3216,
    "left_small_toe": 3226, "left_heel": 3387, "right_big_toe": 6617, "right_small_toe": 6624,
    "right_heel": 6787,
}  # fmt: skip
OF_SMPLX = {
    "nose": 9120, "left_eye": 9448, "right_eye": 9929, "left_ear": 6, "right_ear": 616,
    "left_big_toe": 5770,
    "left_small_toe": 5780, "left_heel": 8846, "right_big_toe": 8463, "right_small_toe": 8474,
    "right_heel": 8635,
}  # fmt: skip
PUBLISHED = {
    ("smpl", 6890): OF_SMPL,
    ("smplx", 10475): OF_SMPLX,
}
TIPS = {
    ("smpl", 6890): {"left_index_finger_tip": 2319, "right_thumb_tip": 6191},
    ("smplx", 10475): {"left_thumb_tip": 5361, "right_pinky_tip": 8022},
}


@pytest.mark.parametrize(("family", "vertices"), PUBLISHED)
def test_published_meshes_use_their_known_vertices(tmp_path, tables_of, family, vertices):
    np.savez(tmp_path / "body.npz", **tables_of(family, vertices=vertices, betas=3))
    body = load_model(tmp_path / "body.npz")
    places = {f"coco/{name}": v for name, v in PUBLISHED[family, vertices].items()}
    places |= {f"hand/{name}": v for name, v in TIPS[family, vertices].items()}
    for name, vertex in places.items():
        i = body.keypoint_names.index(name)
        np.testing.assert_allclose(body.keypoint_template[i], body.v_template[vertex], atol=1e-12)
        np.testing.assert_allclose(body.keypoint_shapedirs[i], body.shapedirs[vertex], atol=1e-12)


def as_smpl_file(body: Body) -> dict[str, np.ndarray]:
    """The default body as an SMPL-like file: a regressor that gives its joints exactly, for every
    shape.
    """
    V = len(body.v_template)
    n = body.K + 1
    basis = np.column_stack([body.v_template, body.shapedirs.reshape(V, -1), np.ones(V)])
    wanted = np.column_stack([body.J_template, body.J_shapedirs.reshape(n, -1), np.ones(n)])
    weights = np.zeros((V, n))
    np.add.at(weights, (np.arange(V)[:, None], body.skin_joints), body.skin_weights)
    return {
        "v_template": body.v_template,
        "shapedirs": body.shapedirs,
        "J_regressor": wanted @ np.linalg.pinv(basis),
        "weights": weights,
        "kintree_table": np.array([body.parents, np.arange(n)]),
        "f": body.triangles(),
    }


@pytest.fixture(scope="module", params=["scope", "scope_h"])
def pair(request, tmp_path_factory) -> tuple[Body, Body]:
    """The default body with its own keypoints, and the same mesh loaded as a user's file of unknown
    topology.
    """
    own = load_body(request.param)
    path = tmp_path_factory.mktemp("body") / "body.npz"
    np.savez(path, **as_smpl_file(own))
    return own, load_model(path)


def test_an_unknown_mesh_gets_keypoints_near_the_true_ones(pair):
    own, loaded = pair
    assert loaded.keypoint_names == own.keypoint_names
    np.testing.assert_array_equal(loaded.keypoint_part, own.keypoint_part)
    distance = np.linalg.norm(loaded.keypoint_template - own.keypoint_template, axis=1)
    for name, d in zip(own.keypoint_names, distance, strict=True):
        assert d < (0.025 if "hand/" in name or "index" in name or "pinky" in name else 0.02), name


def test_the_heel_is_on_the_sole_even_if_the_ankle_protrudes_further_back(tmp_path):
    own = load_body("scope")
    tables = as_smpl_file(own)
    np.savez(tmp_path / "plain.npz", **tables)
    v = tables["v_template"].copy()
    v[v[:, 1] > v[:, 1].min() + 0.06] -= [0.0, 0.0, 0.1]  # everything above the feet, backwards
    np.savez(tmp_path / "leaning.npz", **{**tables, "v_template": v})
    plain = load_model(tmp_path / "plain.npz")
    leaning = load_model(tmp_path / "leaning.npz")
    for name in ("coco/left_heel", "coco/right_heel"):
        i = own.keypoint_names.index(name)
        np.testing.assert_allclose(
            leaning.keypoint_template[i], plain.keypoint_template[i], atol=1e-12
        )


def test_keypoints_follow_the_shape_as_the_true_ones_do(pair):
    own, loaded = pair
    joints = [i for i, n in enumerate(own.keypoint_names) if n.split("/")[1] in own.joint_names]
    np.testing.assert_allclose(
        loaded.keypoint_shapedirs[joints], own.keypoint_shapedirs[joints], atol=1e-9
    )
    for axis in range(3):
        betas = np.zeros(own.P)
        betas[axis] = 2.0
        moved = (loaded.keypoint_shapedirs - own.keypoint_shapedirs) @ betas
        assert np.linalg.norm(moved, axis=1).max() < 0.02


@pytest.mark.parametrize(("family", "vertices"), [("smpl", 72), ("smplx", 400)])
def test_coarse_random_meshes_still_get_every_keypoint(tmp_path, tables_of, family, vertices):
    np.savez(tmp_path / "body.npz", **tables_of(family, vertices=vertices))
    body = load_model(tmp_path / "body.npz")
    assert len(body.keypoint_set("blazepose")) == 33
    assert len(body.keypoint_set("coco")) == 23
    assert len(body.keypoint_set("hand")) == 42
    assert np.isfinite(body.keypoint_template).all()
    place = dict(zip(body.keypoint_names, body.keypoint_template, strict=True))
    for name in ("ear", "big_toe", "heel"):
        assert place[f"coco/left_{name}"][0] > place[f"coco/right_{name}"][0]
