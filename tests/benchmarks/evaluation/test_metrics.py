# SPDX-License-Identifier: GPL-3.0-or-later
"""Each measure by hand on a few points, and against implementations that share nothing with it.

Scores of made captures: exact ones have no error, people are told apart, frames and people that
lack are counted.

The joints of protocols lie where anatomy has them, on the built-in body and in the published
orders.

Published rows belong to protocols, to measures that these take, and name their source.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scope.benchmarks.evaluation import joint_sets, metrics
from scope.benchmarks.evaluation import scores as module
from scope.benchmarks.evaluation.clips import Clip, Person, Truth
from scope.benchmarks.evaluation.protocols import MEASURES, PROTOCOLS
from scope.benchmarks.evaluation.subjects import PosedBody
from scope.solver.rotations import exp

from ...made_motion import made_motion
from .made_data import K

RNG = np.random.default_rng(0)


def by_quaternion(source, target, with_scale=True):
    """Horn's closed form (1987): the rotation is the eigenvector of a 4 × 4 matrix, which no
    reflection can be.
    """
    a = source - source.mean(axis=0)
    b = target - target.mean(axis=0)
    S = a.T @ b
    N = np.zeros((4, 4))
    N[0, 0] = np.trace(S)
    N[0, 1:] = N[1:, 0] = [S[1, 2] - S[2, 1], S[2, 0] - S[0, 2], S[0, 1] - S[1, 0]]
    N[1:, 1:] = S + S.T - np.trace(S) * np.eye(3)
    w, x, y, z = np.linalg.eigh(N)[1][:, -1]
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    scale = (
        sum(q @ R @ p for p, q in zip(a, b, strict=True)) / sum(p @ p for p in a)
        if with_scale
        else 1.0
    )
    return np.array([scale * R @ p for p in a]) + target.mean(axis=0)


@pytest.mark.parametrize("with_scale", [True, False])
@pytest.mark.parametrize("mirrored", [False, True])
def test_the_similarity_agrees_with_horns(with_scale, mirrored):
    for _ in range(5):
        target = RNG.normal(size=(14, 3))
        source = (
            target @ exp(RNG.normal(size=3)).T * 1.7
            + RNG.normal(size=3)
            + RNG.normal(scale=0.1, size=(14, 3))
        )
        source *= [-1, 1, 1] if mirrored else 1
        moved = metrics.aligned(source, metrics.similarity(source, target, with_scale))
        assert np.allclose(moved, by_quaternion(source, target, with_scale), atol=1e-9)


def test_pa_mpjpe_ignores_a_similarity_but_not_a_mirror_image():
    true = RNG.normal(size=(3, 14, 3))
    moved = 0.6 * true @ exp(np.array([0.4, -1.2, 2.0])).T + [1, 2, 3]
    assert metrics.pa_mpjpe(moved, true) == pytest.approx(np.zeros(3), abs=1e-9)
    assert (metrics.pa_mpjpe(true * [-1, 1, 1], true) > 100).all()


def test_acceleration_error_of_a_known_motion():
    t = np.arange(6) / 30
    still = np.zeros((6, 2, 3))
    falling = still.copy()
    falling[:, 0, 1] = -0.5 * 9.81 * t**2  # one joint of two
    assert metrics.acceleration_error(falling, still, 30.0) == pytest.approx(np.full(4, 9.81 / 2))
    drifting = still + np.linspace(0, 1, 6)[:, None, None]
    assert metrics.acceleration_error(drifting, still, 30.0) == pytest.approx(np.zeros(4), abs=1e-9)


def test_jitter_of_a_known_motion():
    t = np.arange(8) / 30
    motion = np.zeros((8, 1, 3))
    motion[:, 0, 2] = t**3  # a third derivative of 6 m/s³
    assert metrics.jitter(motion, 30.0) == pytest.approx(np.full(5, 0.6))


def test_root_translation_error_by_hand():
    true = np.zeros((5, 3))
    true[:, 0] = np.arange(5)  # travels 4 m
    turned = np.stack([np.zeros(5), np.arange(5.0), np.full(5, 7.0)], axis=1)
    assert metrics.root_translation_error(turned, true) == pytest.approx(np.zeros(5), abs=1e-9)
    # Twice as long: no scale is allowed, so the ends are 2 m off, the middle is not.
    assert metrics.root_translation_error(2 * turned, true) == pytest.approx([50, 25, 0, 25, 50])


def test_world_errors_are_of_segments_of_100_frames():
    true = RNG.normal(size=(250, 6, 3)) + np.arange(250)[:, None, None] * [0.01, 0, 0]
    moves = [0.5 * true[:100] + 3, 2 * true[100:200] @ exp(np.array([0, 1.0, 0])).T, true[200:] - 1]
    assert metrics.wa_mpjpe(np.concatenate(moves), true) == pytest.approx(np.zeros(250), abs=1e-8)
    assert metrics.w_mpjpe(np.concatenate(moves), true) == pytest.approx(np.zeros(250), abs=1e-8)
    # one similarity for all is one for each segment as well, two in a segment are not
    one = 0.5 * true + 3
    one[50:] += 1
    assert metrics.wa_mpjpe(one, true)[:100].min() > 1
    assert metrics.wa_mpjpe(one, true)[100:] == pytest.approx(np.zeros(150), abs=1e-8)


def test_foot_slide_counts_only_points_that_stand():
    true = np.zeros((3, 2, 3))
    true[:, 1, 0] = [0, 0.02, 0.029]  # moves, then slows to 9 mm
    captured = np.zeros((3, 2, 3))
    captured[:, 0, 1] = [0, 0.004, 0.004]
    captured[:, 1, 1] = [0, 0.5, 0.503]
    assert sorted(metrics.foot_slide(captured, true)) == pytest.approx([0.0, 3.0, 4.0])


COUNT = 12


def walking(body):
    """Someone who moves sideways in front of the camera."""
    rng = np.random.default_rng(0)
    poses = np.cumsum(rng.normal(scale=0.02, size=(COUNT, 3 * (body.K + 1))), axis=0)
    trans = np.arange(COUNT)[:, None] * [0.05, 0.0, 0.0]
    motion = made_motion(body, poses, trans, intrinsics=K)
    joints = PosedBody.of_motion(body, motion).joints(body.joint_names)
    return replace(motion, joints_cam=joints.astype(np.float32))


def test_an_exact_capture_has_no_error(body):
    motion = walking(body)
    in_camera = PosedBody.of_motion(body, motion)
    in_world = PosedBody.of_motion(body, motion, in_world=True)
    truth = Truth([Person("a", np.arange(COUNT), in_camera, in_world)])
    clip = Clip("clip", [Path("a.jpg")], 30.0, ("rich",), lambda: None, True)
    found = module.score_clip(clip, truth, body, [motion], PROTOCOLS["rich"])
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


@pytest.fixture
def at_rest(body):
    def place(*names):
        parts, offsets = joint_sets.on_body(body, names, np.zeros(body.P))
        return body.rest_joints()[parts] + offsets

    return place


def test_every_joint_of_every_protocol_is_on_the_body(at_rest):
    for protocol in PROTOCOLS.values():
        assert at_rest(*protocol.joints, *protocol.root).shape == (
            len(protocol.joints) + len(protocol.root),
            3,
        )
        assert set(protocol.pck_joints) <= set(protocol.joints)
        assert set(protocol.measures) <= set(MEASURES)


@pytest.mark.parametrize(
    "names", [joint_sets.LSP14, joint_sets.REGRESSED17, joint_sets.TEST_3DHP, joint_sets.H36M32]
)
def test_left_is_left(at_rest, names):
    for name, point in zip(names, at_rest(*names), strict=True):
        side = name.split("_")[0]
        assert np.sign(np.round(point[0], 2)) == {"left": 1, "right": -1}.get(side, 0), name


def test_the_orders_are_those_of_the_published_tables():
    """Numbers as SPIN's constants.py has them: LSP's joints by their rows in J_regressor_h36m."""
    rows = [6, 5, 4, 1, 2, 3, 16, 15, 14, 11, 12, 13, 8, 10]
    assert [joint_sets.REGRESSED17[row] for row in rows] == list(joint_sets.LSP14)
    by_data_set = [11, 6, 7, 8, 1, 2, 3, 12, 24, 14, 15, 17, 18, 19, 25, 26, 27]
    assert [joint_sets.H36M32[name] for name in joint_sets.REGRESSED17] == by_data_set
