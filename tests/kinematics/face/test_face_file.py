# SPDX-License-Identifier: GPL-3.0-or-later
"""Damaged files of the built-in bodies' faces are refused in a sentence."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.kinematics import face
from scope.scope_addon.kinematics.face import mouth_faces_of, with_teeth_and_tongue
from scope.solver.errors import ModelFileError

M = 914  # vertices of teeth and tongue


def changed(array: np.ndarray, value: float, at: int = -1) -> np.ndarray:
    out = array.copy()
    out[at] = value
    return out


# Each is refused by the name of the array in which it is wrong; None: the file lacks it.
OF_MOUTH = {
    "starts back": lambda d: {"starts": changed(d["starts"], -5, 3)},
    "starts of text": lambda d: {"starts": d["starts"].astype(str)},
    "vertices shorter than moves": lambda d: {"vertices": d["vertices"][:-1]},
    "vertices outside": lambda d: {"vertices": changed(d["vertices"], M)},
    "moves lacking": lambda _: {"moves": None},
    "step_m not a number": lambda _: {"step_m": np.array(np.nan)},
    "v_template infinite": lambda d: {"v_template": changed(d["v_template"], np.inf)},
    "faces outside": lambda d: {"faces": changed(d["faces"], M)},
    "uv of fewer vertices": lambda d: {"uv": d["uv"][1:]},
    "face_material outside": lambda d: {"face_material": changed(d["face_material"], 3)},
}
OF_EXPRESSIONS = {
    "starts beyond the end": lambda d: {"starts": changed(d["starts"], d["starts"][-1] + 1)},
    "moves lacking": lambda _: {"moves": None},
    "names in another order": lambda d: {"names": d["names"][::-1]},
    "mouth_faces outside": lambda d: {"mouth_faces": changed(d["mouth_faces"], 100_000)},
}


def damaged(constant, tmp_path, monkeypatch, change):
    """Have the constant of the module name a changed copy of the file."""
    path = getattr(face, constant)
    with np.load(path) as file:
        data = dict(file)
    data |= change(data)
    there = {name: array for name, array in data.items() if array is not None}
    np.savez(tmp_path / path.name, **there)
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
