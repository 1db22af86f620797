# SPDX-License-Identifier: GPL-3.0-or-later
"""Scores of made captures: exact ones have no error, people are told apart, frames and people that
lack are counted.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scope.benchmarks.evaluation import scores as module
from scope.benchmarks.evaluation.clips import Clip, Person, Truth
from scope.benchmarks.evaluation.joint_sets import SMPL24
from scope.benchmarks.evaluation.protocols import PROTOCOLS
from scope.benchmarks.evaluation.subjects import MeasuredJoints, PosedBody
from scope.solver.rotations import exp

from ...made_motion import made_motion
from .made_data import K

COUNT = 12


def walking(body, x=0.0, seed=0):
    """Someone who moves sideways, 4 m in front of the camera."""
    rng = np.random.default_rng(seed)
    poses = np.cumsum(rng.normal(scale=0.02, size=(COUNT, 3 * (body.K + 1))), axis=0)
    trans = np.stack([x + 0.05 * np.arange(COUNT), np.zeros(COUNT), np.zeros(COUNT)], axis=1)
    motion = made_motion(body, poses, trans)
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = exp(np.array([-np.pi / 2, 0, 0])).T @ np.eye(3)
    world_from_camera[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    world_from_camera[:3, 3] = [0, -4, 1]
    motion = replace(
        motion, world_from_camera=np.tile(world_from_camera, (COUNT, 1, 1)), intrinsics=K
    )
    joints = PosedBody.of_motion(body, motion).joints(body.joint_names)
    return replace(motion, joints_cam=joints.astype(np.float32))


def person(body, motion, name="a", rows=None):
    rows = np.arange(COUNT) if rows is None else rows
    world = PosedBody.of_motion(body, motion, in_world=True)
    return Person(name, rows, PosedBody.of_motion(body, motion).select(rows), world.select(rows))


def clip(alone=True, rate=30.0):
    return Clip("clip", [Path("a.jpg")], rate, ("rich",), lambda: None, alone)


def test_an_exact_capture_has_no_error(body):
    motion = walking(body)
    found = module.score_clip(
        clip(), Truth([person(body, motion)]), body, [motion], PROTOCOLS["rich"]
    )
    means = found.means()
    assert set(means) == {
        "mpjpe",
        "pa_mpjpe",
        "mpvpe",
        "acceleration",
        "wa_mpjpe",
        "w_mpjpe",
        "rte",
        "jitter",
        "foot_slide",
    }
    for key in ("mpjpe", "pa_mpjpe", "mpvpe", "acceleration", "wa_mpjpe", "w_mpjpe", "rte"):
        assert means[key] == pytest.approx(0, abs=1e-6), key
    assert means["jitter"] > 0.01  # of the captured motion alone
    assert (found.frames, found.seen, found.people, found.missed) == (COUNT, COUNT, 1, 0)


def test_errors_are_those_of_the_joints_that_differ(body):
    motion = walking(body)
    true = person(body, motion)
    joints = true.camera.joints(SMPL24)
    joints[:, SMPL24.index("left_wrist")] += [0.0, 0.024, 0.032]  # 40 mm
    measured = replace(true, camera=MeasuredJoints(SMPL24, joints))
    means = module.score_clip(clip(), Truth([measured]), body, [motion], PROTOCOLS["3dpw"]).means()
    assert means["mpjpe"] == pytest.approx(40 / 24, rel=1e-4)
    # squares are least, so that one large error becomes many small ones
    assert 0 < means["pa_mpjpe"] < 40 / 24 * 4
    assert means["pck_50"] == pytest.approx(100)
    assert "mpvpe" not in means  # there is no mesh of the truth


def test_a_step_between_frames_and_a_late_start_are_matched_by_number(body):
    motion = walking(body)
    rows = np.array([0, 5, 10])
    late = replace(
        motion,
        joint_sigma_m=None,
        joint_sigma_depth_m=None,
        **{
            key: getattr(motion, key)[3:]
            for key in ("poses", "trans", "poses_raw", "trans_raw", "frames", "valid")
        },
        **{
            key: getattr(motion, key)[3:]
            for key in ("timestamps", "joints_cam", "keypoints2d", "joint_confidence")
        },
        **{
            key: getattr(motion, key)[3:]
            for key in ("world_from_camera", "foot_contact", "residual_px")
        },
    )
    found = module.score_clip(
        clip(), Truth([person(body, motion, rows=rows)]), body, [late], PROTOCOLS["h36m-p1"]
    )
    assert found.means()["mpjpe"] == pytest.approx(0, abs=1e-4)
    assert (found.frames, found.seen) == (3, 2)


def test_people_are_told_apart_by_the_image(body):
    left = walking(body, -0.8, 1)
    right = walking(body, 0.8, 2)
    truth = Truth([person(body, left), person(body, right, "b")], K)
    assert module.assign(clip(alone=False), truth, [right, left]) == [left, right]
    assert module.assign(clip(alone=False), truth, [right]) == [None, right]
    found = module.score_clip(clip(alone=False), truth, body, [right], PROTOCOLS["bedlam"])
    assert (found.people, found.missed, found.frames, found.seen) == (2, 1, 2 * COUNT, COUNT)
    assert found.means()["mpjpe"] == pytest.approx(0, abs=1e-4)


def test_means_are_over_frames_not_clips():
    scores = module.Scores({"mpjpe": [np.array([1.0, 1.0, 1.0])]})
    other = module.Scores({"mpjpe": [np.array([5.0])]})
    scores.add(other)
    assert scores.means() == {"mpjpe": 2.0}
    scores.add(module.Scores({"mpjpe": [np.array([np.nan])]}))
    assert scores.means() == {"mpjpe": 2.0}
