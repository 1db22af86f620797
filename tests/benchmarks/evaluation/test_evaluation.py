# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole command on a data set made from the sample clip: figures, interruptions, wrong
folders.
"""

import json

import numpy as np
import pytest
from scope.benchmarks.evaluation import run
from scope.benchmarks.evaluation.__main__ import main
from scope.scope_addon.cli import SAMPLE

from .made_data import rigid, table_3dpw, write_3dhp, write_3dpw

COUNT = 8


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """The first frames of the sample clip as a sequence of 3DPW, whose second person is not
    there.
    """
    root = tmp_path_factory.mktemp("3DPW")
    with np.load(SAMPLE.with_name("sample_truth.npz")) as file:
        joints = file["joints_cam"][:COUNT].astype(float)
    T = rigid(COUNT)
    inverse = np.linalg.inv(T)
    world = np.einsum("tij,tkj->tki", inverse[:, :3, :3], joints) + inverse[:, None, :3, 3]
    nobody = world + [30.0, 0, 0]
    write_3dpw(root, table_3dpw("downtown_walking_00", [world, nobody], T), pictures=True)
    return root


def test_a_data_set_is_captured_compared_and_kept(dataset, tmp_path, capsys, monkeypatch, networks):
    command = [
        "3dpw",
        str(dataset),
        "--quality",
        "fast",
        "--results",
        str(tmp_path / "results"),
        "--given-camera",
    ]
    assert main([*command, "--json", str(tmp_path / "figures.json")]) == 0
    out = capsys.readouterr().out
    assert "3DPW, test split: the 24 joints of SMPL's skeleton" in out
    assert (
        "8 of 16 frames were captured; 1 of 2 people were not found; joints: those of the body "
        "'scope'" in out
    )
    found = json.loads((tmp_path / "figures.json").read_text("utf-8"))
    figures = found["protocols"]["3dpw"]["figures"]
    assert 10 < figures["pa_mpjpe"] < figures["mpjpe"] < 150
    assert 50 < figures["pck_50"] <= 100
    assert 50 < figures["auc_200"] < 100
    assert found["options"]["camera"] is True

    def never(*_):
        raise AssertionError("captured again")

    monkeypatch.setattr(run, "capture", never)
    assert main([*command, "--json", str(tmp_path / "again.json")]) == 0
    assert json.loads((tmp_path / "again.json").read_text("utf-8")) == found
    with pytest.raises(AssertionError, match="captured again"):
        main([*command, "--again"])
    # its record is gone, and nothing half done is kept
    with pytest.raises(AssertionError, match="captured again"):
        main(command)


def test_an_interrupted_run_goes_on(tmp_path, capsys, monkeypatch):
    joints = np.random.default_rng(0).normal(scale=500, size=(3, 17, 3)) + [0, 0, 4000]
    write_3dhp(tmp_path / "data", joints, np.ones(3))
    seen = []

    def until_the_third(path, body, options):
        seen.append(len(list(path.iterdir())))
        if len(seen) == 3:
            raise KeyboardInterrupt
        raise run.NoPersonError("nobody is in these pictures")

    monkeypatch.setattr(run, "capture", until_the_third)
    command = ["3dhp", str(tmp_path / "data"), "--results", str(tmp_path / "results")]
    assert main(command) == 130
    assert "run the same command again to go on" in capsys.readouterr().err
    assert main(command) == 0
    assert seen == [3] * 7  # each of the six clips once, and the interrupted one again
    out = capsys.readouterr().out
    assert "0 of 18 frames were captured; 6 of 6 people were not found" in out
    assert "| OriNet | 84.3 | 47.5 | 84.5 |" in out
    assert main([*command, "--quality", "fast", "--clips", "TS4"]) == 0
    assert len(seen) == 8  # other options are another capture


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["3dpw", "{0}/nowhere"], 2, "nowhere is not a folder"),
        (["3dpw", "{0}"], 1, "sequenceFiles/test/*.pkl matches no file"),
        (["emdb", "{0}"], 1, "P*/*/*_data.pkl matches no file"),
        (["rich", "{0}"], 1, "images/test does not exist"),
        (["bedlam", "{0}"], 1, "all_npz_12_validation/*.npz matches no file"),
        (["h36m", "{0}"], 1, "S9/Videos does not exist"),
        (["3dhp", "{0}"], 1, "TS1 does not exist"),
        (["3dpw", "{0}", "--smpl", "{0}/none"], 1, "none is not a folder"),
        (["3dpw", "{0}", "--regressor", "{0}/none.npy"], 1, "none.npy does not exist"),
        (["3dpw", "{0}", "--body", "{0}/none.npz"], 1, "none.npz' was not found"),
    ],
)
def test_wrong_arguments_are_one_sentence(tmp_path, capsys, arguments, status, said):
    assert main([argument.format(tmp_path) for argument in arguments]) == status
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert said in captured.err
