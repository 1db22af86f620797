# SPDX-License-Identifier: GPL-3.0-or-later
"""SMPL, SMPL+H, SMPL-X and STAR .npz files against an independent SMPL formula."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scope.scope_addon.untrusted.body_file import is_user_model, load_model
from scope.solver.errors import ModelFileError


def random_rotations(count: int, seed: int = 1) -> np.ndarray:
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(count, 3, 3)))
    q *= np.sign(np.einsum("nii->ni", r))[:, None, :]
    q[np.linalg.det(q) < 0, :, 0] *= -1
    return q


def save(path: Path, tables: dict[str, np.ndarray], **more: ArrayLike) -> Path:
    arrays: dict[str, ArrayLike] = {**tables, **more}
    np.savez(path, **arrays)
    return path


@pytest.mark.parametrize(
    ("family", "stored", "kept"),
    [
        ("smpl", 10, 10),
        ("smpl", 300, 16),
        ("smplx", 400, 16),  # shape and expression
        ("smplx", 20, 10),  # the older division
        ("star", 300, 16),
        ("tree", 5, 5),
    ],
)
def test_kinematics_and_skinning_follow_the_smpl_formula(
    tmp_path, tables_of, formula, family, stored, kept
):
    tables = tables_of(family, betas=stored)
    body = load_model(save(tmp_path / "tree.npz", tables))
    assert body.name == family
    assert body.P == kept
    rng = np.random.default_rng(2)
    betas = rng.normal(size=kept)
    trans = rng.normal(size=3)
    rotations = random_rotations(body.K + 1)
    R, t = body.forward_kinematics(rotations, trans, betas)
    vertices, joints = formula(tables, betas, rotations, trans)
    np.testing.assert_allclose(t, joints, atol=1e-12)
    np.testing.assert_allclose(body.skin(R, t, betas), vertices, atol=1e-12)
    np.testing.assert_array_equal(body.triangles(), tables["f"])


@pytest.mark.parametrize(
    ("family", "count", "some"),
    [
        ("smpl", 24, {0: "pelvis", 15: "head", 22: "left_hand", 23: "right_hand"}),
        (
            "smplh",
            52,
            {22: "left_index1", 28: "left_pinky1", 36: "left_thumb3", 37: "right_index1"},
        ),
        ("smplx", 55, {22: "jaw", 23: "left_eye_smplhf", 25: "left_index1", 54: "right_thumb3"}),
        ("tree", 9, {0: "joint_00", 8: "joint_08"}),
    ],
)
def test_joints_have_their_official_names(tmp_path, tables_of, family, count, some):
    body = load_model(save(tmp_path / "body.npz", tables_of(family)))
    assert len(body.joint_names) == count
    assert {i: body.joint_names[i] for i in some} == some
    assert body.parents[0] == -1


def test_any_tree_keeps_the_names_in_the_file(tmp_path, tables_of):
    names = np.array([f"bone{i}" for i in range(9)])
    body = load_model(save(tmp_path / "dog.npz", tables_of("tree"), joint_names=names))
    assert body.joint_names == tuple(names)
    assert body.name == "dog"
    assert body.keypoint_names == ()


def test_more_than_four_weights_are_reduced_to_the_largest(tmp_path, tables_of):
    tables = tables_of("smpl")
    weights = np.random.default_rng(0).dirichlet(np.ones(24), size=300)
    body = load_model(save(tmp_path / "body.npz", {**tables, "weights": weights}))
    np.testing.assert_allclose(body.skin_weights.sum(axis=1), 1.0, atol=1e-12)
    for v in (0, 17, 299):
        largest = np.sort(weights[v])[:-5:-1]
        np.testing.assert_allclose(body.skin_weights[v], largest / largest.sum())
        np.testing.assert_allclose(weights[v, body.skin_joints[v]], largest)


def test_only_the_users_kinds_of_file_are_taken_for_user_models(tmp_path, tables_of):
    assert is_user_model(save(tmp_path / "body.npz", tables_of("smpl")))
    assert is_user_model(tmp_path / "model.pkl")
    np.savez(tmp_path / "motion.npz", poses=np.zeros(3))
    assert not is_user_model(tmp_path / "motion.npz")
    (tmp_path / "text.npz").write_text("no")
    assert not is_user_model(tmp_path / "text.npz")


def without(key):
    return lambda t: t.pop(key)


def put(key, value):
    return lambda t: t.update({key: value(t[key]) if callable(value) else value})


def poke(key, index, value):
    def change(t):
        t[key] = t[key].astype(np.int64) if t[key].dtype == np.uint32 else t[key].copy()
        t[key][index] = value

    return change


BROKEN = {
    "no weights": (without("weights"), "lacks weights"),
    "fewer weights": (put("weights", lambda a: a[:-1]), r"weights must have shape \(300, 24\)"),
    "quads": (put("f", np.zeros((4, 4), np.uint32)), "f must have shape"),
    "no tree": (
        put("kintree_table", np.int64(3)),
        r"kintree_table must have shape \(2, any\), but "
        r"has \(\)",
    ),
    "empty": (
        put("v_template", np.zeros((0, 3))),
        "0 vertices and 24 joints do not match any supported body",
    ),
    "no joints": (
        put("kintree_table", np.zeros((2, 0), int)),
        "300 vertices and 0 joints do not match any supported body",
    ),
    "flat shapedirs": (put("shapedirs", np.zeros((900, 10))), "shapedirs must have shape"),
    "fractional tree": (
        put("kintree_table", lambda a: a.astype(float)),
        "kintree_table must hold whole numbers",
    ),
    "NaN vertex": (poke("v_template", (3, 1), np.nan), "v_template contains NaN"),
    "infinite shape": (poke("shapedirs", (3, 1, 0), np.inf), "shapedirs contains NaN or infinity"),
    "a loop": (poke("kintree_table", (0, 4), 7), "after its parent"),
    "a joint twice": (poke("kintree_table", (1, 4), 3), "twice"),
    "face outside": (poke("f", (0, 0), 300), "f points outside"),
    "no joint for a vertex": (poke("weights", 5, 0.0), "without a joint"),
    "Python objects": (put("J_regressor", np.array({"a": 1}, dtype=object)), "Object arrays"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_contradictory_files_are_refused_with_the_reason(tmp_path, tables_of, name):
    change, message = BROKEN[name]
    tables = tables_of("smpl")
    change(tables)
    path = save(tmp_path / "body.npz", tables)
    with pytest.raises(ModelFileError, match=message) as caught:
        load_model(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("factors", [(0, 1, 1), (1e-3, 1e-3, 1e-3), (1000, 1000, 1000)])
def test_flat_tiny_and_huge_bodies_are_refused(tmp_path, tables_of, factors):
    tables = tables_of("smpl")
    tables["v_template"] = tables["v_template"] * np.array(factors)
    with pytest.raises(
        ModelFileError,
        match=r"body\.npz: v_template measures .* m, which no body "
        r"does; .* metre",
    ):
        load_model(save(tmp_path / "body.npz", tables))


def rewrite(path: Path, key: str, content: bytes, compression: int = zipfile.ZIP_STORED) -> None:
    with zipfile.ZipFile(path) as file:
        members = {name: file.read(name) for name in file.namelist()}
    members[f"{key}.npy"] = content
    with zipfile.ZipFile(path, "w", compression) as file:
        for name, data in members.items():
            file.writestr(name, data)


def header(shape: tuple[int, ...], descr: str = "<f8") -> bytes:
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        file, {"descr": descr, "fortran_order": False, "shape": shape}
    )
    return file.getvalue()


@pytest.mark.parametrize(
    "content",
    [
        header((2**40, 3)),
        header((300, 3)) + b"short",
        header((300, 3), "|V8") + bytes(7200),
        b"\x93NUMPY\x09\x00junk",
        b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 70000,
        b"junk",
    ],
)
def test_lying_arrays_are_refused_before_memory_is_taken(tmp_path, tables_of, content):
    path = save(tmp_path / "body.npz", tables_of("smpl"))
    rewrite(path, "v_template", content)
    with pytest.raises(ModelFileError):
        load_model(path)


def test_missing_files_and_folders_are_refused(tmp_path):
    for path in (tmp_path / "none.npz", tmp_path, tmp_path / "none.pkl"):
        with pytest.raises(ModelFileError, match="does not exist"):
            load_model(path)
