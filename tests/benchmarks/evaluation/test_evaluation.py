# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole command on a data set made from the sample clip: figures, interruptions, wrong
folders.

The whole command on made data sets whose errors were chosen, and whose figures follow by hand.
What was captured is a made motion; the truth is the same joints, of which some are moved by a
chosen distance.
"""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scope.benchmarks.evaluation import run
from scope.benchmarks.evaluation.__main__ import main
from scope.benchmarks.evaluation.joint_sets import SMPL24, TEST_3DHP
from scope.scope_addon.cli import SAMPLE
from scope.solver.rotations import exp

from ...made_motion import made_motion
from .made_data import K, rigid, table_3dpw, write_3dhp, write_3dpw

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


FRAMES_BY_HAND = 5


@pytest.fixture
def walker(body):
    """A captured motion, and its joints (T, 24, 3) in the camera in metres."""
    poses = np.random.default_rng(3).normal(scale=0.15, size=(FRAMES_BY_HAND, 3 * (body.K + 1)))
    motion = made_motion(body, poses, np.zeros((FRAMES_BY_HAND, 3)), intrinsics=K)
    R, t = body.forward_kinematics(
        exp(poses.reshape(FRAMES_BY_HAND, -1, 3)), np.zeros((FRAMES_BY_HAND, 3)), np.zeros(body.P)
    )
    T = np.linalg.inv(motion.world_from_camera[0])
    joints = t @ T[:3, :3].T + T[:3, 3]
    rest = body.rest_vertices(np.zeros(body.P))
    top = rest[rest[:, 1].argmax()] - body.rest_joints(np.zeros(body.P))[SMPL24.index("head")]
    head_top = (R @ top + t)[:, SMPL24.index("head")] @ T[:3, :3].T + T[:3, 3]
    return replace(motion, joints_cam=joints.astype(np.float32)), joints, head_top


def figures(monkeypatch, tmp_path, motion, dataset):
    monkeypatch.setattr(run, "capture", lambda *_: SimpleNamespace(motions=[motion]))
    out = tmp_path / "figures.json"
    command = [
        dataset,
        str(tmp_path / "data"),
        "--results",
        str(tmp_path / "results"),
        "--json",
        str(out),
    ]
    assert main(command) == 0
    return json.loads(out.read_text("utf-8"))["protocols"][dataset]


def test_mpi_inf_3dhp(walker, tmp_path, monkeypatch):
    motion, joints, head_top = walker
    at = {name: SMPL24.index(name) for name in SMPL24} | {"spine": SMPL24.index("spine2")}
    true = np.stack(
        [head_top if name == "head_top" else joints[:, at[name]] for name in TEST_3DHP], axis=1
    )
    valid = np.array([1, 0, 1, 0, 1])
    true[[1, 3]] += np.random.default_rng(0).normal(size=(2, 17, 3))  # frames that do not count
    true[0, TEST_3DHP.index("right_wrist"), 0] += 0.149
    true[0, TEST_3DHP.index("left_wrist"), 2] -= 0.151
    true[2, TEST_3DHP.index("pelvis")] += [0, 0.061, 0]  # to which the 16 others are relative
    true[4] += [1.0, 2.0, 3.0]
    true[4, TEST_3DHP.index("spine"), 1] += 0.034  # not one of the 14 of PCK and AUC
    write_3dhp(tmp_path / "data", true * 1000 / 0.9, valid)
    found = figures(monkeypatch, tmp_path, motion, "3dhp")
    assert (found["frames"], found["frames_seen"], found["missed"]) == (18, 18, 0)
    means = found["figures"]
    assert means["mpjpe"] == pytest.approx(
        ((149 + 151) / 17 + 16 * 61 / 17 + 34 / 17) / 3, abs=1e-3
    )
    assert means["pck"] == pytest.approx(100 * (13 / 14 + 1 + 1) / 3)
    # Of the 31 thresholds from 0 to 150 mm, exact joints are below 30, 149 mm below one, 61 mm
    # below 18.
    assert means["auc"] == pytest.approx(
        100 * ((12 * 30 + 1 + 0) / (14 * 31) + 18 / 31 + 30 / 31) / 3
    )
    # Aligned, the pelvis alone is off in the second frame, and no joint of any by 150 mm.
    assert means["pa_pck"] == pytest.approx(100)
    assert means["auc"] < means["pa_auc"] < 100


def test_3dpw_by_the_rules_of_its_challenge(walker, tmp_path, monkeypatch):
    motion, joints, _ = walker
    true = joints.copy()
    # one of the twelve limb joints that PCK and AUC are of
    true[0, SMPL24.index("left_wrist"), 0] += 0.0496
    true[0, SMPL24.index("right_knee"), 1] += 0.0504
    true[0, SMPL24.index("head"), 1] += 0.3  # none of the twelve
    true[1, SMPL24.index("pelvis"), 2] += 0.1204  # to which the 23 others are relative
    true[3:] += np.random.default_rng(0).normal(size=(2, 24, 3))  # frames that do not count
    T = rigid(FRAMES_BY_HAND)
    world = np.einsum("tji,tkj->tki", T[:, :3, :3], true - T[:, None, :3, 3])
    table = table_3dpw("downtown_walking_00", [world], T)
    table["campose_valid"][0][3] = False
    table["poses2d"][0][4] = 0.0  # the challenge leaves out frames in which no 2D pose was found
    write_3dpw(tmp_path / "data", table)
    found = figures(monkeypatch, tmp_path, motion, "3dpw")
    assert (found["frames"], found["frames_seen"], found["missed"]) == (3, 3, 0)
    means = found["figures"]
    assert means["mpjpe"] == pytest.approx(
        ((49.6 + 50.4 + 300) / 24 + 23 * 120.4 / 24 + 0) / 3, abs=1e-2
    )
    assert means["pck_50"] == pytest.approx(100 * (11 / 12 + 0 + 1) / 3)

    def area(error):
        """Of PCK of one joint over the thresholds 0, 1, …, 199 mm, by trapezoids, over their
        range.
        """
        share = [float(error <= threshold) for threshold in range(200)]
        return sum((a + b) / 2 for a, b in zip(share, share[1:], strict=False)) / 199

    exact = area(0.001)  # single precision leaves micrometres
    by_hand = [(10 * exact + area(49.6) + area(50.4)) / 12, area(120.4), exact]
    assert means["auc_200"] == pytest.approx(100 * np.mean(by_hand))
