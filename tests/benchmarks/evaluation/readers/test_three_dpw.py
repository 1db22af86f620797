# SPDX-License-Identifier: GPL-3.0-or-later
"""3DPW's layout: pickles of Python 2, people in lists, a camera that moves."""

import pickle

import numpy as np
import pytest
from scope.benchmarks.evaluation.files import DatasetError
from scope.benchmarks.evaluation.joint_sets import LSP14, REGRESSED17
from scope.benchmarks.evaluation.models import Models
from scope.benchmarks.evaluation.readers.three_dpw import clips
from scope.solver.rotations import exp

from ....untrusted.conftest import make_tables, smpl_formula
from ..made_data import rigid, table_3dpw, write_3dpw, write_models, write_regressor

COUNT = 5


@pytest.fixture
def table():
    rng = np.random.default_rng(0)
    joints = [rng.normal(size=(COUNT, 24, 3)) + [0, 0, 5] for _ in range(2)]
    table = table_3dpw("downtown_arguing_00", joints, rigid(COUNT))
    table["campose_valid"][1][2:4] = False
    return table


def test_with_smpl_and_a_regressor_joints_are_those_of_the_mesh(tmp_path, table):
    write_3dpw(tmp_path, table)
    matrix = write_regressor(tmp_path / "J.npy")
    models = Models(write_models(tmp_path / "smpl", "SMPL_MALE", "SMPL_FEMALE"), tmp_path / "J.npy")
    (clip,) = clips(tmp_path, models)
    assert clip.protocols == ("3dpw-mesh",)
    female = clip.truth().people[1]
    tables = make_tables("smpl", seed=1)
    frame = 4
    rotations = exp(table["poses"][1][frame].reshape(24, 3))
    vertices, _ = smpl_formula(tables, table["betas"][1], rotations, table["trans"][1][frame])
    T = table["cam_poses"][frame]
    expected = (matrix @ (vertices @ T[:3, :3].T + T[:3, 3]))[
        [REGRESSED17.index(name) for name in LSP14]
    ]
    assert np.allclose(female.camera.joints(LSP14)[2], expected, atol=1e-6)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        (
            "jointPositions",
            [np.zeros((COUNT, 71))],
            r"jointPositions must have shape \(5, 72\), "
            r"but has \(5, 71\)",
        ),
        ("jointPositions", [np.full((COUNT, 72), np.nan)], "jointPositions contains NaN"),
        ("jointPositions", [np.full((COUNT, 72), 1e6)], r"1e\+06 m from the origin"),
        ("jointPositions", [np.array([{}] * COUNT)], "an array of Python objects"),
        (
            "cam_poses",
            np.zeros((9, 4, 4)),
            "is about 9 frames, but its folder in imageFiles holds 5",
        ),
    ],
)
def test_damage_is_one_sentence(tmp_path, table, key, value, said):
    path = write_3dpw(tmp_path, table)
    table[key] = value
    path.write_bytes(pickle.dumps(table, 2))
    (clip,) = clips(tmp_path, Models())
    with pytest.raises(DatasetError, match=said) as found:
        clip.truth()
    assert str(path) in str(found.value)


def test_a_pickle_that_asks_for_functions_runs_nothing(tmp_path, table):
    class Attack:
        def __reduce__(self):
            return (exec, (f"open({str(tmp_path / 'ran')!r}, 'w')",))

    path = write_3dpw(tmp_path, table)
    path.write_bytes(pickle.dumps(table | {"betas": Attack()}, 2))
    with pytest.raises(DatasetError, match="exec, which such a file has no use for"):
        clips(tmp_path, Models())[0].truth()
    assert not (tmp_path / "ran").exists()
