# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies in the format of the built-in ones, by name or as files of the user."""

import shutil

import numpy as np
import pytest
from scope.solver.errors import ModelFileError
from scope.solver.loaders.body_file import BUILT_IN, load_body


def test_a_body_knows_its_file_unless_it_is_built_in(tmp_path):
    """A motion names the file, so that its body is found again on this machine."""
    path = tmp_path / "mine.npz"
    shutil.copy(BUILT_IN["scope"], path)
    own, built_in = load_body(path), load_body("scope")
    assert (own.file, built_in.file) == (str(path.resolve()), "")
    np.testing.assert_array_equal(own.v_template, built_in.v_template)


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
    with pytest.raises(ModelFileError, match=r"none\.npz: kintree_table must list each joint after its parent"):
        load_body(tmp_path / "none.npz")
