# SPDX-License-Identifier: GPL-3.0-or-later
"""Bodies in the format of the built-in ones, by name or as files of the user."""

import shutil
import warnings
import zipfile
from dataclasses import fields

import numpy as np
import pytest
from scope.solver import body_file
from scope.solver.body_file import BUILT_IN, load_body, read_arrays
from scope.solver.errors import InvalidValueError, ModelFileError, ScopeWarning

from ..untrusted.conftest import make_tables


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
    assert own.file == str(path.resolve())
    for _ in range(2):  # read, and from memory
        found = load_body(which)
        assert found.file == ""
        for name, value in arrays_of(own).items():
            again = getattr(found, name)
            assert again.flags.f_contiguous == value.flags.f_contiguous, name
            assert again.strides == value.strides, name
            assert again.tobytes("K") == value.tobytes("K"), name
        shape = np.random.default_rng(0).normal(size=own.P)
        assert np.array_equal(found.rest_vertices(shape), own.rest_vertices(shape))


@pytest.mark.parametrize("which", ["scope", "scope_child"])
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


def test_what_is_unexpected_of_a_users_model_is_told(tmp_path):
    """Dropped shape coefficients, weights that are scaled, and a gender read off a name."""
    tables = make_tables("smpl", betas=20)
    np.savez(tmp_path / "SMPL_FEMALE.npz", **{**tables, "weights": 2.0 * tables["weights"]})
    with pytest.warns(ScopeWarning) as told:
        body = load_body(tmp_path / "SMPL_FEMALE.npz")
    assert (body.P, body.gender) == (16, "female")
    np.testing.assert_allclose(body.skin_weights.sum(axis=1), 1.0)
    messages = " ".join(str(each.message) for each in told)
    assert "of 20 shape coefficients, the first 16 are kept" in messages
    assert "sum to 2 instead of 1" in messages
    assert "taken as female" in messages


def test_a_model_without_surprises_is_loaded_without_a_word(tmp_path, recwarn):
    np.savez(tmp_path / "SMPL_FEMALE.npz", **make_tables("smpl", betas=20), gender="female")
    assert load_body(tmp_path / "SMPL_FEMALE.npz", betas=20).P == 20
    assert not recwarn.list


def test_a_model_whose_arrays_contradict_each_other_is_refused(tmp_path):
    path = tmp_path / "model.npz"
    tables = make_tables("smpl", betas=2)
    for name in ("J_regressor", "weights"):
        np.savez(path, **{**tables, name: tables[name].T})
        with pytest.raises(ModelFileError, match=rf"model\.npz: {name} must have shape .* has"):
            load_body(path)
    np.savez(path, **tables)
    for betas in (-1, 1.5):
        with pytest.raises(InvalidValueError, match="betas must be a whole number"):
            load_body(path, betas)


def spoiled(array):
    return np.where(np.arange(array.size).reshape(array.shape) == 0, np.nan, array)


def turned(array):
    """Points (n, 3), or their derivatives (n, 3, P), with z up instead of y."""
    return np.stack([array[:, 0], -array[:, 2], array[:, 1]], axis=1)


LENGTHS = ("v_template", "J_template", "keypoint_template", "shapedirs", "J_shapedirs")
DAMAGES = {
    "NaN": (("v_template", "shapedirs", "weights", "J_template"), spoiled, "contains NaN"),
    "z up": (LENGTHS, turned, r"head lies above the feet along .* turn the model so that y is up"),
    "a mirror": (LENGTHS, lambda a: -a, "lies .* along .* turn the model"),
    "centimetres": (LENGTHS, lambda a: 100.0 * a, "v_template measures .* m, .* the metre"),
    "another shape": (("shapedirs", "J_shapedirs"), lambda a: a[:-1], "shapedirs must have shape"),
    "no axes": (("v_template", "kintree_table"), lambda _: np.array(1), "must have shape"),
    "text": (("weights", "skin_weights", "f", "faces"), lambda a: a.astype(str), "must hold"),
    "outside": (("f", "faces"), lambda a: a + 10**6, "points outside"),
}


@pytest.mark.parametrize(("keys", "change", "message"), DAMAGES.values(), ids=DAMAGES)
@pytest.mark.parametrize("layout", ["smpl", "own"])
def test_what_no_body_can_be_is_refused_with_the_files_name(
    tmp_path, layout, keys, change, message
):
    own = BUILT_IN["scope"]
    tables = make_tables("smpl") if layout == "smpl" else read_arrays(own, "body file")
    path = tmp_path / "person.npz"
    np.savez(path, **tables | {key: change(tables[key]) for key in keys if key in tables})
    with pytest.raises(ModelFileError, match=rf"person\.npz: .*{message}"):
        load_body(path)


def test_a_pickle_is_not_opened_but_the_way_to_read_it_is_told(tmp_path):
    (tmp_path / "model.pkl").write_bytes(b"cos\nsystem\n(S'true'\ntR.")
    with pytest.raises(ModelFileError, match=r"scope_addon\.untrusted\.body_file\.load_body"):
        load_body(tmp_path / "model.pkl")


def test_a_damaged_file_is_refused_in_a_sentence_wherever_the_damage_is(tmp_path):
    """One byte after the other is changed, of compressed data, of headers and of the directory."""
    path = tmp_path / "body.npz"
    np.savez_compressed(path, a=np.arange(50.0), b=np.array(["text"]))
    whole = path.read_bytes()
    refused = []
    for k in range(len(whole)):
        path.write_bytes(whole[:k] + bytes([whole[k] ^ 0x2A]) + whole[k + 1 :])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                read_arrays(path, "body file")
            except ModelFileError as error:
                refused.append(str(error))
    assert len(refused) > len(whole) // 4
    assert all("is not a readable body file" in message for message in refused)


def test_a_header_that_ends_within_brackets_is_refused_in_a_sentence(tmp_path):
    path = tmp_path / "body.npz"
    np.savez(path, a=np.arange(3))
    with zipfile.ZipFile(path) as file:
        array = file.read("a.npy").replace(b"(3,)", b"(3, ")
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("a.npy", array)
    with pytest.raises(ModelFileError, match="is not a readable body file"):
        read_arrays(path, "body file")
