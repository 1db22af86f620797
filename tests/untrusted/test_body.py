# SPDX-License-Identifier: GPL-3.0-or-later
"""Body files in Scope's own format: read as written, and refused with the array that cannot be
used.
"""

import numpy as np
import pytest
from scope.scope_addon.untrusted.body_file import load_body
from scope.solver.errors import ModelFileError
from scope.solver.names import BODY_JOINTS, BODY_PARENTS

N = len(BODY_JOINTS)
V = 8
F = 5
M = 4
P = 2


def small_body():
    """The arrays of a body of few vertices, with all that is optional."""
    rng = np.random.default_rng(0)
    return {
        "name": np.array("small"),
        "license": np.array("CC0"),
        "joint_names": np.array(BODY_JOINTS),
        "kintree_table": np.array([BODY_PARENTS, range(N)]),
        "v_template": rng.standard_normal((V, 3)),
        "shapedirs": rng.standard_normal((V, 3, P)),
        "J_template": rng.standard_normal((N, 3)).astype(np.float32),
        "J_shapedirs": rng.standard_normal((N, 3, P)),
        "skin_joints": rng.integers(0, N, (V, 4)),
        "skin_weights": np.full((V, 4), 0.25),
        "faces": rng.integers(0, V, (F, 4)),
        "uv": rng.random((6, 2)),
        "uv_faces": rng.integers(0, 6, (F, 4)),
        "face_material": rng.integers(0, 2, F).astype(np.uint8),
        "material_names": np.array(["skin", "hair"]),
        "material_colors": rng.random((2, 4)),
        "keypoint_names": np.array([f"set/{k}" for k in range(M)]),
        "keypoint_part": rng.integers(0, N, M),
        "keypoint_template": rng.standard_normal((M, 3)),
        "keypoint_shapedirs": rng.standard_normal((M, 3, P)),
    }


def saved(path, arrays):
    np.savez(path, **arrays)
    return path


def test_a_whole_file_is_read_and_so_is_one_without_what_is_optional(tmp_path):
    arrays = small_body()
    body = load_body(saved(tmp_path / "whole.npz", arrays))
    assert (body.name, body.K, body.P) == ("small", N - 1, P)
    for key in (
        "v_template",
        "J_template",
        "faces",
        "uv",
        "uv_faces",
        "face_material",
        "material_colors",
    ):
        np.testing.assert_array_equal(getattr(body, key), arrays[key])
    assert body.J_template.dtype == np.float64
    for key in (
        "name",
        "license",
        "uv",
        "uv_faces",
        "face_material",
        "material_names",
        "material_colors",
    ):
        del arrays[key]
    # as numpy writes a list of no names
    arrays |= {"keypoint_names": np.array([]), "keypoint_part": np.zeros(0, int)}
    arrays |= {"keypoint_template": np.zeros((0, 3)), "keypoint_shapedirs": np.zeros((0, 3, P))}
    bare = load_body(saved(tmp_path / "bare.npz", dict(arrays, faces=arrays["faces"][:, :3])))
    assert (bare.name, bare.keypoint_names, bare.uv) == ("bare", (), None)
    np.testing.assert_array_equal(bare.triangles(), arrays["faces"][:, :3])


def test_a_body_is_shown_by_its_name_and_sizes(tmp_path):
    body = load_body(saved(tmp_path / "small.npz", small_body()))
    assert repr(body) == f"Body('small', K={N - 1}, P={P}, V={V}, M={M})"
    assert repr([body]) == f"[{body}]"


BROKEN = {
    "a flat tree": ("kintree_table", np.arange(N), r"must have shape \(2, any\), but has \(22,\)"),
    "a fractional tree": (
        "kintree_table",
        np.zeros((2, N)),
        "must hold whole numbers, but holds float64",
    ),
    "flat J_shapedirs": (
        "J_shapedirs",
        np.zeros((N, 3)),
        r"must have shape \(any, 3, any\), but "
        r"has \(22, 3\)",
    ),
    "faces of five": (
        "faces",
        np.zeros((3, 5), int),
        "must be triangles or quads, but have 5 corners",
    ),
    "text for vertices": ("v_template", np.full((V, 3), "1"), "must hold numbers, but holds <U1"),
    "numbers for names": (
        "joint_names",
        np.arange(N, dtype=np.int64),
        "must hold text, but holds int64",
    ),
    "NaN keypoints": ("keypoint_shapedirs", np.full((M, 3, P), np.nan), "contains NaN or infinity"),
    "uv outside": ("uv_faces", np.full((F, 4), 6), r"points outside 0\.\.5"),
    "uv of other faces": (
        "uv_faces",
        np.zeros((F, 3), int),
        r"must have shape \(5, 4\), but has \(5, 3\)",
    ),
    "no such material": ("face_material", np.full(F, 2), r"points outside 0\.\.1"),
    "too many colours": (
        "material_colors",
        np.zeros((3, 4)),
        r"must have shape \(2, 4\), but has \(3, 4\)",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_what_cannot_be_used_is_refused_by_its_name(tmp_path, name):
    key, value, message = BROKEN[name]
    path = saved(tmp_path / "body.npz", {**small_body(), key: value})
    with pytest.raises(ModelFileError, match=f"{key} {message}") as caught:
        load_body(path)
    assert str(path) in str(caught.value)


def test_a_body_without_joints_is_refused(tmp_path):
    arrays = small_body()
    arrays |= {"joint_names": np.array([]), "kintree_table": np.zeros((2, 0), int)}
    arrays |= {"J_template": np.zeros((0, 3)), "J_shapedirs": np.zeros((0, 3, P))}
    with pytest.raises(ModelFileError, match="root first"):
        load_body(saved(tmp_path / "body.npz", arrays))


@pytest.mark.parametrize("factors", [(1, 0, 1), (1e-9, 1e-9, 1e-9), (1000, 1000, 1000)])
def test_a_body_that_is_flat_tiny_or_in_millimetres_is_refused(tmp_path, factors):
    arrays = small_body()
    arrays["v_template"] = arrays["v_template"] * np.array(factors)
    with pytest.raises(
        ModelFileError,
        match=r"body\.npz: v_template measures .* m, which no body "
        r"does; .* metre",
    ):
        load_body(saved(tmp_path / "body.npz", arrays))


def test_the_body_of_an_animal_is_refused(tmp_path):
    """Captures, imports and most formats use joints by their names."""
    arrays = small_body()
    arrays["joint_names"] = np.array([name.replace("knee", "hock") for name in BODY_JOINTS])
    with pytest.raises(ModelFileError, match=r"dog\.npz has no joints left_knee, right_knee: give"):
        load_body(saved(tmp_path / "dog.npz", arrays))


def test_a_motion_is_told_from_a_body(tmp_path):
    motion = {
        "poses": np.zeros((4, 72)),
        "trans": np.zeros((4, 3)),
        "betas": np.zeros(10),
        "gender": np.array("male"),
    }
    with pytest.raises(
        ModelFileError,
        match="walk.npz is a motion file, .* give one of scope, scope_h, scope_child, "
        "scope_child_h, or a body's",
    ):
        load_body(saved(tmp_path / "walk.npz", motion))


def test_the_joint_that_moves_a_vertex_most_has_its_largest_weight(tmp_path):
    arrays = small_body()
    arrays["skin_joints"] = np.tile([0, 1, 2, 0], (V, 1))
    arrays["skin_weights"] = np.tile([0.2, 0.1, 0.6, 0.1], (V, 1))
    arrays["skin_weights"][0] = [0.1, 0.7, 0.2, 0.0]
    np.savez(tmp_path / "small.npz", **arrays)
    assert load_body(tmp_path / "small.npz").strongest_joints.tolist() == [1] + [2] * (V - 1)
