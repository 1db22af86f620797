# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged files of the built-in bodies' faces are refused in a sentence."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.kinematics import face
from scope.scope_addon.kinematics.face import expressions_of, mouth_faces_of, with_teeth_and_tongue
from scope.solver.errors import ModelFileError

M = 914  # vertices of teeth and tongue


def changed(array: np.ndarray, value: float, at: int = -1) -> np.ndarray:
    out = array.copy()
    out[at] = value
    return out


# Each is refused by the name of the array in which it is wrong.
OF_BOTH = {
    "starts too short": lambda d: {"starts": d["starts"][:-1]},
    "starts not at 0": lambda d: {"starts": changed(d["starts"], 1, 0)},
    "starts beyond the end": lambda d: {"starts": changed(d["starts"], d["starts"][-1] + 1)},
    "starts back": lambda d: {"starts": changed(d["starts"], -5, 3)},
    "starts of text": lambda d: {"starts": d["starts"].astype(str)},
    "vertices shorter than moves": lambda d: {"vertices": d["vertices"][:-1]},
    "vertices not whole": lambda d: {"vertices": d["vertices"] + 0.5},
    "moves of two axes": lambda d: {"moves": d["moves"][:, :2]},
    "step_m of two": lambda d: {"step_m": np.ones(2)},
    "step_m not a number": lambda d: {"step_m": np.array(np.nan)},
}
OF_MOUTH = OF_BOTH | {
    "vertices outside": lambda d: {"vertices": changed(d["vertices"], M)},
    "v_template of two axes": lambda d: {"v_template": d["v_template"][:, :2]},
    "v_template infinite": lambda d: {"v_template": changed(d["v_template"], np.inf)},
    "shapedirs without coefficients": lambda d: {"shapedirs": d["shapedirs"][:, :, 0]},
    "shapedirs of fewer vertices": lambda d: {"shapedirs": d["shapedirs"][1:]},
    "faces of triangles": lambda d: {"faces": d["faces"][:, :3]},
    "faces outside": lambda d: {"faces": changed(d["faces"], M)},
    "faces negative": lambda d: {"faces": changed(d["faces"], -1)},
    "uv of three": lambda d: {"uv": np.ones((M, 3))},
    "uv of fewer vertices": lambda d: {"uv": d["uv"][1:]},
    "face_material of fewer faces": lambda d: {"face_material": d["face_material"][1:]},
    "face_material outside": lambda d: {"face_material": changed(d["face_material"], 3)},
    "material_colors of fewer materials": lambda d: {"material_colors": d["material_colors"][1:]},
}
OF_EXPRESSIONS = OF_BOTH | {
    "vertices outside": lambda d: {
        "vertices": changed(d["vertices"].astype(int), int(d["vertex_count"]))
    },
    "names in another order": lambda d: {"names": d["names"][::-1]},
    "names too few": lambda d: {"names": d["names"][1:]},
    "vertex_count of two": lambda d: {"vertex_count": np.array([1, 2])},
    "mouth_faces outside": lambda d: {"mouth_faces": changed(d["mouth_faces"], 100_000)},
    "mouth_faces negative": lambda d: {"mouth_faces": changed(d["mouth_faces"], -1)},
}


def damaged(constant, tmp_path, monkeypatch, change):
    """Have the constant of the module name a changed copy of the file."""
    path = getattr(face, constant)
    with np.load(path) as file:
        data = dict(file)
    np.savez(tmp_path / path.name, **data | change(data))
    monkeypatch.setattr(face, constant, tmp_path / path.name)


@pytest.fixture(autouse=True)
def _read_again():
    def forget():
        for read in (face.read_mouth, face._read, face._with_mouth):
            read.cache_clear()

    forget()
    yield
    forget()


@pytest.mark.parametrize("name", OF_MOUTH)
def test_damaged_teeth_and_tongue_are_refused(name, body, tmp_path, monkeypatch):
    damaged("MOUTH_FILE", tmp_path, monkeypatch, OF_MOUTH[name])
    with pytest.raises(ModelFileError, match=rf"mouth\.npz.*{name.split()[0]}"):
        with_teeth_and_tongue(body)


@pytest.mark.parametrize("name", OF_EXPRESSIONS)
def test_damaged_expressions_are_refused(name, body, tmp_path, monkeypatch):
    damaged("FILE", tmp_path, monkeypatch, OF_EXPRESSIONS[name])
    with pytest.raises(ModelFileError, match=rf"expressions\.npz.*{name.split()[0]}"):
        mouth_faces_of(body)


def test_a_file_that_lacks_an_array_is_refused(body, tmp_path, monkeypatch):
    for constant, use in (("MOUTH_FILE", with_teeth_and_tongue), ("FILE", expressions_of)):
        path = getattr(face, constant)
        with np.load(path) as file:
            data = dict(file)
        np.savez(
            tmp_path / path.name, **{key: value for key, value in data.items() if key != "moves"}
        )
        monkeypatch.setattr(face, constant, tmp_path / path.name)
        with pytest.raises(ModelFileError, match="lacks moves"):
            use(body)
