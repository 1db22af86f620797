# SPDX-License-Identifier: GPL-3.0-or-later
"""Each measure by hand on a few points, and against implementations that share nothing with it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scope.benchmarks.evaluation import metrics
from scope.solver.rotations import exp

RNG = np.random.default_rng(0)
CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


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


def test_joint_errors_by_hand():
    captured = CORNERS + np.array([[0.003, 0.004, 0], [0, 0, 0.1], [0, 0, 0], [0, 0.15, 0]])
    errors = metrics.joint_errors(captured[None], CORNERS[None])
    assert errors[0] == pytest.approx([5.0, 100.0, 0.0, 150.0])
    assert metrics.mpjpe(captured[None], CORNERS[None]) == pytest.approx([63.75])


def test_pa_mpjpe_ignores_a_similarity_but_not_a_mirror_image():
    true = RNG.normal(size=(3, 14, 3))
    moved = 0.6 * true @ exp(np.array([0.4, -1.2, 2.0])).T + [1, 2, 3]
    assert metrics.pa_mpjpe(moved, true) == pytest.approx(np.zeros(3), abs=1e-9)
    assert (metrics.pa_mpjpe(true * [-1, 1, 1], true) > 100).all()


def test_pck_and_auc_by_hand():
    errors = np.array([[0.0, 149.9, 150.0, 75.0], [1000, 1000, 1000, 1000]])
    assert metrics.pck(errors) == pytest.approx([75.0, 0.0])  # 150 is not below 150
    # Of the 31 thresholds, 0 is above 30, 149.9 above the last one's 1, 150 above none, 75 above
    # those from 80 on: 15.
    assert metrics.auc(errors) == pytest.approx([100 * (30 + 1 + 0 + 15) / (4 * 31), 0.0])


def test_the_challenges_pck_and_auc_by_hand():
    errors = np.array([[50.0, 50.1, 198.5, 199.5], [0.0, 0.0, 0.0, 0.0]])
    assert metrics.challenge_pck(errors) == pytest.approx([25.0, 100.0])
    # Half a step, and whole ones from there to 199 mm: of 50 mm from 49 on, of 50.1 from 50, of
    # 198.5 from 198.
    assert metrics.challenge_auc(errors) == pytest.approx(
        [100 * (149.5 + 148.5 + 0.5 + 0) / (4 * 199), 100.0]
    )


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


def test_world_errors_frame_by_frame_with_horns_alignment():
    captured, true = RNG.normal(size=(2, 130, 5, 3))
    for start, end in ((0, 100), (100, 130)):
        moved = by_quaternion(captured[start:end].reshape(-1, 3), true[start:end].reshape(-1, 3))
        expected = [
            1000 * sum(math.dist(p, q) for p, q in zip(a, b, strict=True)) / 5
            for a, b in zip(moved.reshape(-1, 5, 3), true[start:end], strict=True)
        ]
        assert metrics.wa_mpjpe(captured, true)[start:end] == pytest.approx(expected)


def test_foot_slide_counts_only_points_that_stand():
    true = np.zeros((3, 2, 3))
    true[:, 1, 0] = [0, 0.02, 0.029]  # moves, then slows to 9 mm
    captured = np.zeros((3, 2, 3))
    captured[:, 0, 1] = [0, 0.004, 0.004]
    captured[:, 1, 1] = [0, 0.5, 0.503]
    assert sorted(metrics.foot_slide(captured, true)) == pytest.approx([0.0, 3.0, 4.0])


def test_a_clip_of_one_frame_has_no_measures_of_motion():
    one = CORNERS[None]
    assert (
        metrics.acceleration_error(one, one, 30.0).shape == metrics.jitter(one, 30.0).shape == (0,)
    )
    assert metrics.w_mpjpe(one, one) == pytest.approx([0.0], abs=1e-9)
