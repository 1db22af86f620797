# SPDX-License-Identifier: GPL-3.0-or-later
"""SMPL .pkl files as scipy, chumpy, Python 2 and Python 3 write them, read without any of these."""

from __future__ import annotations

import copyreg
import pickle
import sys

import numpy as np
import pytest
from scope.scope_addon.untrusted.body_file import load_model
from scope.solver.errors import ModelFileError

PROTOCOLS = (0, 2, pickle.HIGHEST_PROTOCOL)


def with_state(cls: type, **state: object) -> object:
    made: object = object.__new__(cls)
    made.__dict__.update(state)
    return made


def compressed(cls: type, dense: np.ndarray, by_column: bool, **names: object) -> object:
    """The attributes of a CSC or CSR matrix, counted out entry by entry."""
    data = []
    indices = []
    indptr = [0]
    for line in dense.T if by_column else dense:
        for i, value in enumerate(line):
            if value:
                data.append(value)
                indices.append(i)
        indptr.append(len(data))
    arrays = {
        "data": np.array(data),
        "indices": np.array(indices, np.int32),
        "indptr": np.array(indptr, np.int32),
    }
    return with_state(cls, _shape=dense.shape, maxprint=50, **arrays, **names)


def assert_same_model(path, tables):
    body = load_model(path)
    np.testing.assert_allclose(body.v_template, tables["v_template"])
    np.testing.assert_allclose(body.shapedirs, tables["shapedirs"])
    np.testing.assert_allclose(
        body.J_template, tables["J_regressor"] @ tables["v_template"], atol=1e-14
    )
    dense = np.zeros_like(tables["weights"])
    np.put_along_axis(dense, body.skin_joints, body.skin_weights, axis=1)
    heavy = body.skin_weights > 0
    rows = np.repeat(np.arange(len(dense)), 4).reshape(-1, 4)
    np.testing.assert_allclose(
        tables["weights"][rows[heavy], body.skin_joints[heavy]], body.skin_weights[heavy]
    )
    np.testing.assert_array_equal(body.faces, tables["f"])
    return body


@pytest.mark.parametrize("protocol", PROTOCOLS)
def test_plain_arrays_of_python_3(tmp_path, tables_of, protocol):
    tables = tables_of("smpl")
    extra = {
        "bs_style": "lbs",
        "bs_type": "lrotmin",
        "scale": np.float64(1.5),
        "count": 3,
        "pi": 3.14,
        "big": 10**12,
    }
    extra |= {
        "neg": -7,
        "none": None,
        "yes": True,
        "list": [1, (2,), (), (1, 2), (1, 2, 3), (1, 2, 3, 4)],
    }
    extra |= {
        "text": "žluť\n",
        "raw": b"\x00\xff\n",
        "set": {1, 2},
        "frozen": frozenset((1,)),
        "empty": b"",
    }
    extra |= {"bytes": bytearray(b"ab")}
    (tmp_path / "body.pkl").write_bytes(pickle.dumps({**tables, **extra}, protocol))
    assert_same_model(tmp_path / "body.pkl", tables)


LAYOUTS = [
    *((protocol, "csc", False) for protocol in PROTOCOLS),
    *((2, form, private) for form, private in (("csr", True), ("coo", False), ("new coo", True))),
]


@pytest.mark.parametrize(("protocol", "form", "private"), LAYOUTS)
def test_the_official_layout(tmp_path, monkeypatch, tables_of, stand_ins, protocol, form, private):
    tables = tables_of("smpl")
    ch = stand_ins("chumpy.ch.Ch")
    kind = form[-3:]
    sparse = stand_ins(f"scipy.sparse.{'_' if private else ''}{kind}.{kind}_matrix")
    dense = tables["J_regressor"]
    if kind == "coo":
        rows, columns = (index.astype(np.int32) for index in np.nonzero(dense))
        place = {"coords": (rows, columns)} if form == "new coo" else {"row": rows, "col": columns}
        matrix = with_state(sparse, _shape=dense.shape, data=dense[rows, columns], **place)
    else:
        matrix = compressed(sparse, dense, kind == "csc", format=kind)
    shapedirs = with_state(
        ch,
        x=tables["shapedirs"],
        _dirty_vars={"x"},
        _itr=None,
        _depends_on_deps={"r": {"deps": {"x"}, "value": None}},
    )
    written = {
        **tables,
        "shapedirs": shapedirs,
        "J_regressor": matrix,
        "weights_prior": matrix,
        "J": np.zeros((24, 3)),
    }
    (tmp_path / "body.pkl").write_bytes(pickle.dumps(written, protocol))
    for name in [n for n in sys.modules if n.split(".")[0] in ("chumpy", "scipy")]:
        monkeypatch.setitem(sys.modules, name, None)  # importing one of them now would fail
    assert_same_model(tmp_path / "body.pkl", tables)


@pytest.mark.parametrize("protocol", [0, 2])
def test_python_2_pickles(tmp_path, tables_of, stand_ins, python2, protocol):
    tables = tables_of("smpl")
    shapedirs = with_state(stand_ins("chumpy.ch.Ch"), x=tables["shapedirs"])
    matrix = compressed(
        stand_ins("scipy.sparse.csc.csc_matrix"), tables["J_regressor"], by_column=True
    )
    data = python2(
        {**tables, "shapedirs": shapedirs, "J_regressor": matrix, "gender": "female"}, protocol
    )
    # written by this test: it is a pickle that Python reads too
    again = pickle.loads(data, encoding="latin1")
    np.testing.assert_array_equal(again["weights"], tables["weights"])
    (tmp_path / "body.pkl").write_bytes(data)
    assert_same_model(tmp_path / "body.pkl", tables)


def test_a_chumpy_slice_is_the_slice(tmp_path, tables_of, stand_ins):
    tables = tables_of("smpl", betas=20)
    ch = stand_ins("chumpy.ch.Ch")
    select = stand_ins("chumpy.reordering.Select")
    kept = np.arange(tables["shapedirs"].size).reshape(tables["shapedirs"].shape)[:, :, :7]
    sliced = with_state(
        select,
        a=with_state(ch, x=tables["shapedirs"]),
        idxs=kept.ravel(),
        preferred_shape=kept.shape,
    )
    (tmp_path / "body.pkl").write_bytes(pickle.dumps({**tables, "shapedirs": sliced}, 2))
    np.testing.assert_array_equal(
        load_model(tmp_path / "body.pkl").shapedirs, tables["shapedirs"][:, :, :7]
    )


def test_repeated_sparse_entries_add_up(tmp_path, tables_of, stand_ins):
    tables = tables_of("smpl")
    rows, columns = np.nonzero(tables["J_regressor"])
    coo = with_state(
        stand_ins("scipy.sparse.coo.coo_matrix"),
        _shape=(np.int64(24), 300),
        data=np.tile(tables["J_regressor"][rows, columns] / 2, 2),
        row=np.tile(rows, 2),
        col=np.tile(columns, 2),
    )
    (tmp_path / "body.pkl").write_bytes(pickle.dumps({**tables, "J_regressor": coo}, 2))
    assert_same_model(tmp_path / "body.pkl", tables)


@pytest.mark.parametrize("outside", [-1, 24])
def test_a_sparse_entry_outside_the_matrix_is_refused(tmp_path, tables_of, stand_ins, outside):
    coo = with_state(
        stand_ins("scipy.sparse.coo.coo_matrix"),
        _shape=(24, 300),
        data=np.ones(2),
        row=np.array([0, outside]),
        col=np.zeros(2, int),
    )
    (tmp_path / "body.pkl").write_bytes(pickle.dumps({**tables_of("smpl"), "J_regressor": coo}, 2))
    with pytest.raises(ModelFileError, match=r"indices outside 0\.\.23\b"):
        load_model(tmp_path / "body.pkl")


@pytest.mark.parametrize("family", ["smplx", "star"])
def test_other_families_as_pickles(tmp_path, tables_of, family):
    tables = tables_of(family)
    (tmp_path / "body.pkl").write_bytes(
        pickle.dumps({k: np.asfortranarray(v) for k, v in tables.items()}, 2)
    )
    assert assert_same_model(tmp_path / "body.pkl", tables).name == family


def test_numpy_2_names_are_read(tmp_path, tables_of):
    tables = tables_of("smpl")
    data = pickle.dumps(tables, 2).replace(b"cnumpy.core.", b"cnumpy._core.")
    assert b"numpy._core.multiarray" in data
    (tmp_path / "body.pkl").write_bytes(data)
    assert_same_model(tmp_path / "body.pkl", tables)


def test_the_extension_registry_is_not_consulted(tmp_path):
    copyreg.add_extension("os", "getcwd", 240)
    try:
        (tmp_path / "body.pkl").write_bytes(b"\x80\x02\x82\xf0)R.")
        with pytest.raises(ModelFileError, match="instruction"):
            load_model(tmp_path / "body.pkl")
    finally:
        copyreg.remove_extension("os", "getcwd", 240)
