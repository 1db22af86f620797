# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole command on made data sets whose errors were chosen, and whose figures follow by hand.

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
from scope.solver.rotations import exp

from ...made_motion import made_motion
from .made_data import K, rigid, table_3dpw, write_3dhp, write_3dpw

COUNT = 5


@pytest.fixture
def walker(body):
    """A captured motion, and its joints (T, 24, 3) in the camera in metres."""
    poses = np.random.default_rng(3).normal(scale=0.15, size=(COUNT, 3 * (body.K + 1)))
    motion = made_motion(body, poses, np.zeros((COUNT, 3)), intrinsics=K)
    R, t = body.forward_kinematics(
        exp(poses.reshape(COUNT, -1, 3)), np.zeros((COUNT, 3)), np.zeros(body.P)
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


def test_3dpw_by_the_rules_of_its_challenge(walker, tmp_path, monkeypatch):
    motion, joints, _ = walker
    true = joints.copy()
    # one of the twelve limb joints that PCK and AUC are of
    true[0, SMPL24.index("left_wrist"), 0] += 0.0496
    true[0, SMPL24.index("right_knee"), 1] += 0.0504
    true[0, SMPL24.index("head"), 1] += 0.3  # none of the twelve
    true[1, SMPL24.index("pelvis"), 2] += 0.1204  # to which the 23 others are relative
    true[3:] += np.random.default_rng(0).normal(size=(2, 24, 3))  # frames that do not count
    T = rigid(COUNT)
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
