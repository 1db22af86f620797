# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies in the format of the built-in ones, by name or as files of the user."""

import shutil
from dataclasses import fields

import numpy as np
import pytest
from scope.solver.errors import ModelFileError
from scope.solver.loaders import body_file
from scope.solver.loaders.body_file import BUILT_IN, load_body


def test_a_body_knows_its_file_unless_it_is_built_in(tmp_path):
    """A motion names the file, so that its body is found again on this machine."""
    path = tmp_path / "mine.npz"
    shutil.copy(BUILT_IN["scope"], path)
    own = load_body(path)
    built_in = load_body("scope")
    assert (own.file, built_in.file) == (str(path.resolve()), "")
    np.testing.assert_array_equal(own.v_template, built_in.v_template)


def arrays_of(body):
    return {
        field.name: value
        for field in fields(body)
        if isinstance(value := getattr(body, field.name), np.ndarray)
    }


@pytest.mark.parametrize("which", ["scope", "scope_h"])
def test_a_built_in_body_is_kept_in_memory_as_its_file_has_it(tmp_path, which):
    """The order of an array in memory changes the last bits of what is calculated from it, and the
    time it takes.
    """
    path = tmp_path / "mine.npz"
    shutil.copy(BUILT_IN[which], path)
    own = load_body(path)
    for _ in range(2):  # read, and from memory
        found = load_body(which)
        for name, value in arrays_of(own).items():
            again = getattr(found, name)
            assert again.flags.f_contiguous == value.flags.f_contiguous, name
            assert again.strides == value.strides, name
            assert again.tobytes("K") == value.tobytes("K"), name
        shape = np.random.default_rng(0).normal(size=own.P)
        assert np.array_equal(found.rest_vertices(shape), own.rest_vertices(shape))


@pytest.mark.parametrize("which", BUILT_IN)
def test_a_change_of_a_bodys_arrays_leaves_the_next_one_alone(which):
    right = {name: value.copy() for name, value in arrays_of(load_body(which)).items()}
    for value in arrays_of(load_body(which)).values():
        value[...] = 0
    for name, value in arrays_of(load_body(which)).items():
        assert np.array_equal(value, right[name]), name


def test_a_missing_or_damaged_file_of_growth_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(body_file, "GROWTH", tmp_path / "growth.npz")
    with pytest.raises(
        ModelFileError,
        match=r"file of children's growth .*growth\.npz cannot .*; "
        r"reinstall Scope",
    ):
        load_body("scope_child")
    (tmp_path / "growth.npz").write_bytes(b"PK damaged")
    with pytest.raises(
        ModelFileError,
        match=r"growth\.npz is not a readable file of children's "
        r"growth",
    ):
        load_body("scope_child")


def test_a_body_without_joints_is_refused(tmp_path):
    with np.load(BUILT_IN["scope"]) as file:
        arrays = {key: file[key] for key in file.files}
    vertices = len(arrays["v_template"])
    arrays |= {
        "kintree_table": np.zeros((2, 0), np.int32),
        "joint_names": np.zeros(0, "U1"),
        "J_template": np.zeros((0, 3), np.float32),
        "J_shapedirs": np.zeros((0, 3, arrays["J_shapedirs"].shape[2]), np.float32),
        "skin_joints": np.zeros((vertices, 4), np.uint8),
    }
    np.savez(tmp_path / "none.npz", **arrays)
    with pytest.raises(
        ModelFileError,
        match=r"none\.npz: kintree_table must list each joint after "
        r"its parent",
    ):
        load_body(tmp_path / "none.npz")
