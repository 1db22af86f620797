# SPDX-License-Identifier: GPL-3.0-or-later
"""Errors of captures of scenes with known differences from the truth, and their intervals."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scope.benchmarks.scenes import accuracy
from scope.benchmarks.scenes.people import LIMB_JOINTS
from scope.benchmarks.scenes.statistics import mean_over_people, mean_over_performers

T = 6


FOCAL = 500.0


K = np.array([[FOCAL, 0, 320], [0, FOCAL, 240], [0, 0, 1.0]])


@pytest.fixture
def truth(body):
    """Two people who stand at rest, 4 m away and 2 m apart; the second is partly hidden."""
    at = [body.joint_names.index(name) for name in LIMB_JOINTS]
    rest = body.rest_joints(np.zeros(body.P))[at] * [1, -1, -1]
    limbs = np.stack([np.tile(rest + [x, 0.0, 4.0], (T, 1, 1)) for x in (-1.0, 1.0)])
    hidden = np.zeros((2, T, 12), bool)
    hidden[1, :3, :2] = True
    return {
        "limbs": limbs,
        "limbs_cam": limbs,
        "view_deg": np.full((2, T), 20.0),
        "hidden": hidden,
        "stature_m": np.array([1.7, 1.4]),
        "mass_index": np.array([20.0, 24.0]),
        "loose_m": np.zeros(2),
        "intrinsics": K,
        "size": np.array([640, 480]),
        "fps": np.array(30.0),
        "camera": np.array("static"),
        "surroundings": np.array("indoors"),
        "takes": np.array(["fencer_0", "climber_a_3"]),
    }


def motion(body, limbs_cam, valid=None):
    joints = np.zeros((T, body.K + 1, 3))
    joints[:, [body.joint_names.index(name) for name in LIMB_JOINTS]] = limbs_cam
    rows = np.ones(T, bool) if valid is None else valid
    alone = {
        "poses_raw": np.zeros((T, 3 * (body.K + 1))),
        "trans_raw": np.tile([0.0, 0.0, 4.0], (T, 1)),
    }
    camera = {
        "world_from_camera": np.tile(np.eye(4), (T, 1, 1)),
        "intrinsics": K,
        "mocap_framerate": 30.0,
    }
    return SimpleNamespace(
        joints_cam=joints,
        valid=rows,
        frames=np.arange(T),
        betas=np.zeros(body.P),
        **alone,
        **camera,
    )


def evaluate(body, truth, motions, monkeypatch):
    monkeypatch.setattr(accuracy, "capture", lambda *_: SimpleNamespace(motions=motions))
    return accuracy.evaluate_scene(body, accuracy.FOLDER / "test_01.mp4", truth)


def test_errors_are_those_put_in(body, truth, monkeypatch):
    wrong = truth["limbs_cam"][0].copy()
    wrong[:, LIMB_JOINTS.index("left_wrist"), 2] += 0.12  # one of twelve joints
    valid = np.arange(T) > 0
    people = [motion(body, truth["limbs_cam"][1] + [0.0, 0.0, 0.3]), motion(body, wrong, valid)]
    first, second = evaluate(body, truth, people, monkeypatch)
    assert np.isnan(first.mpjpe_root[0])
    np.testing.assert_allclose(first.mpjpe_root[1:], 10.0, atol=1e-6)
    assert (first.pa_mpjpe[1:] < 120.0 / np.sqrt(12)).all()  # alignment lowers the root mean square
    np.testing.assert_allclose(second.mpjpe_root, 0.0, atol=1e-6)  # relative to the hips
    assert second.size == pytest.approx(body.stature(np.zeros(body.P)) / 1.4)


def test_the_interval_covers_the_true_mean_as_often_as_it_says():
    rng = np.random.default_rng(1)
    inside = 0
    for _ in range(100):
        found = mean_over_people(rng.exponential(10.0, 40))
        inside += found.low <= 10.0 <= found.high
    assert 86 <= inside <= 100


def test_people_of_one_performer_count_together():
    values = np.repeat([10.0, 20.0, 60.0], 50)
    performers = np.repeat(["a", "b", "c"], 50)
    found = mean_over_performers(values, performers)
    assert (found.mean, found.people) == (30.0, 150)
    assert (found.low, found.high) == (10.0, 60.0)  # one performer in 27 draws is drawn alone
    over_people = mean_over_people(values)
    assert over_people.high - over_people.low < 8.0
    assert np.isnan(mean_over_performers([1.0, 2.0, np.nan], ["a", "a", "b"]).low)
