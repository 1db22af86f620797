# SPDX-License-Identifier: GPL-3.0-or-later
"""Editing synthetic motions with known ground truth: defects are repaired, the rest is unchanged."""

import numpy as np
import pytest
from scope.scope_addon.edit import floor, loop, reduce, root_motion, spans
from scope.scope_addon.edit.clip import Clip, interpolate_rotations, resample, sample
from scope.scope_addon.errors import UsageError
from scope.solver import load_body
from scope.solver.rotations import exp, log, matrix_from_quaternion, quaternion_from_matrix

from .walking import ARMS_DOWN, RATE, walk

BODY = load_body("scope")
NAMES = list(BODY.joint_names)
BETAS = np.zeros(BODY.P)


def angle(a, b):
    return np.linalg.norm(log(np.swapaxes(a, -1, -2) @ b), axis=-1)


def test_sampling_reproduces_the_keys_and_interpolates_along_the_arc():
    clip = walk(1.0)
    same = sample(clip, clip.times)
    np.testing.assert_allclose(same.rotations, clip.rotations, atol=1e-12)
    a, b = exp([0, 0, 0.2]), exp([0, 0, 1.0])
    np.testing.assert_allclose(interpolate_rotations(a, b, 0.25), exp([0, 0, 0.4]), atol=1e-12)
    beyond = sample(clip, np.array([-5.0, 99.0]))
    np.testing.assert_allclose(beyond.root, clip.root[[0, -1]])


def test_baking_to_another_rate_keeps_the_motion_and_removes_frequencies_above_the_rate():
    clip = walk(4.0, rate=60.0)
    baked = resample(clip, 24.0)
    np.testing.assert_allclose(np.diff(baked.times), 1 / 24)
    truth = walk(4.0, rate=24.0)
    assert angle(baked.rotations, truth.rotations[: len(baked)]).max() < np.radians(1.5)
    oscillating = walk(4.0, rate=60.0)
    oscillating.rotations[:, 3] = exp(0.3 * np.cos(2 * np.pi * 29.0 * oscillating.times)[:, None] * [1.0, 0, 0])
    assert angle(resample(oscillating, 24.0).rotations[2:-2, 3], np.eye(3)).max() < 0.06  # of 0.3
    with pytest.raises(UsageError, match="above zero"):
        resample(clip, 0.0)


def test_a_broken_span_is_interpolated_from_its_neighbours():
    clip = walk(2.0)
    broken = Clip(clip.times, clip.rotations.copy(), clip.root.copy())
    bad = slice(20, 26)
    broken.rotations[bad] = exp(np.random.default_rng(0).standard_normal((6, len(NAMES), 3)))
    broken.root[bad] += 1.0
    repaired = spans.interpolate(broken, 20 / RATE, 25 / RATE)
    assert angle(repaired.rotations, clip.rotations).max() < np.radians(6.0)  # of a swing of 23 degrees
    assert np.abs(repaired.root - clip.root).max() < 0.03
    outside = np.r_[0:20, 26 : len(clip)]
    np.testing.assert_array_equal(repaired.rotations[outside], broken.rotations[outside])
    with pytest.raises(UsageError, match="reaches the motion's end"):
        spans.interpolate(clip, 0.0, 0.5)
    with pytest.raises(UsageError, match="no keys"):
        spans.interpolate(clip, 50.0, 60.0)


@pytest.mark.parametrize("limbs", ["arms", "legs", "both"])
def test_swapping_moves_each_limb_to_the_place_of_the_other(limbs):
    clip = walk(1.0)
    rng = np.random.default_rng(1)
    clip.rotations[:, 1:] = clip.rotations[:, 1:] @ exp(0.2 * rng.standard_normal((len(NAMES) - 1, 3)))
    out = spans.swap_sides(clip, BODY, 0.2, 0.5, limbs)
    span = (clip.times > 0.199) & (clip.times < 0.501)
    before, after = clip.joints(BODY, BETAS), out.joints(BODY, BETAS)
    for kind, chain in (("legs", ("hip", "knee", "ankle", "foot")), ("arms", ("shoulder", "elbow", "wrist"))):
        for a, b in zip(chain, chain[1:], strict=False):
            for side, other in (("left", "right"), ("right", "left")):

                def bone(joints, which, a=a, b=b):
                    d = joints[:, NAMES.index(f"{which}_{b}")] - joints[:, NAMES.index(f"{which}_{a}")]
                    return d / np.linalg.norm(d, axis=1, keepdims=True)

                source = other if limbs in (kind, "both") else side
                cosine = (bone(after, side) * bone(before, source)).sum(1)[span]
                assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 12.0, (a, b, side)
    np.testing.assert_array_equal(out.rotations[~span], clip.rotations[~span])
    again = spans.swap_sides(out, BODY, 0.2, 0.5, limbs)
    np.testing.assert_allclose(again.rotations, clip.rotations, atol=1e-12)


def test_a_swapped_elbow_still_bends_forwards():
    clip = walk(0.5)
    clip.rotations[:, NAMES.index("right_elbow")] = exp([0.0, 1.0, 0.0])  # bends forward: see joint_limits.HINGES
    out = spans.swap_sides(clip, BODY, 0.0, 0.5, "arms")
    assert log(out.rotations[0, NAMES.index("left_elbow")])[1] == pytest.approx(-1.0)


def test_feet_are_moved_to_the_floor():
    stand = walk(2.0, speed=0.0)
    stand.rotations[:, 1:] = exp(np.array([ARMS_DOWN.get(n, [0, 0, 0]) for n in NAMES[1:]]))
    stand.root[:, 2] = 0.95
    stand.root[:, 2] -= stand.soles(BODY, BETAS)[0, :, 2].min()
    floating = Clip(stand.times, stand.rotations, stand.root + [0, 0, 0.17])
    np.testing.assert_allclose(floor.refloor(floating, BODY, BETAS).root, stand.root, atol=1e-3)
    sunk = Clip(stand.times, stand.rotations, stand.root.copy())
    sunk.root[25:32, 2] -= 0.08
    repaired = floor.refloor(sunk, BODY, BETAS)
    assert repaired.soles(BODY, BETAS)[..., 2].min() > -1e-6
    assert np.abs(np.diff(repaired.root[:, 2], 2)).max() < 0.08


def test_a_sloping_world_is_levelled():
    clip = walk(6.0, speed=0.2)  # slow enough for feet on the floor to count as standing
    clip.root[:, 0] = 0.4 * np.sin(0.5 * clip.times)
    clip.root[:, 2] -= clip.soles(BODY, BETAS)[..., 2].min(axis=1)
    tilt = exp([0.1, 0.05, 0.0])
    tilted = Clip(clip.times, clip.rotations.copy(), clip.root @ tilt.T)
    tilted.rotations[:, 0] = tilt @ tilted.rotations[:, 0]
    level = floor.refloor(tilted, BODY, BETAS, level=True)
    up = level.rotations[:, 0] @ np.swapaxes(clip.rotations[:, 0], 1, 2)
    assert np.degrees(np.arccos(np.clip(up[:, 2, 2], -1, 1))).max() < 1.5
    spot = walk(2.0, speed=0.0)  # the slope is unobservable from one spot: no rotation
    np.testing.assert_array_equal(floor.refloor(spot, BODY, BETAS, level=True).rotations, spot.rotations)


def test_the_trajectory_and_the_relative_motion_recompose_the_motion():
    clip = walk(3.0)
    turn = np.linspace(0, 7.0, len(clip))  # more than a whole turn
    clip.rotations[:, 0] = exp(turn[:, None] * [0, 0, 1.0]) @ clip.rotations[:, 0]
    positions, angles = root_motion.floor_trajectory(clip)
    assert np.abs(angles[30:-30] - turn[30:-30]).max() < 0.02
    np.testing.assert_array_equal(positions[:, 2], 0.0)
    local = root_motion.relative_to_trajectory(clip, positions, angles)
    assert np.abs(local.root[:, :2]).max() < 1e-12
    assert np.abs(np.diff(angles)).max() < 0.1
    facing = local.rotations[30:-30, 0] @ [0.0, 0.0, 1.0]
    np.testing.assert_allclose(facing, np.broadcast_to([0.0, -1.0, 0.0], facing.shape), atol=0.03)
    again = root_motion.with_trajectory(local, positions, angles)
    np.testing.assert_allclose(again.rotations, clip.rotations, atol=1e-12)
    np.testing.assert_allclose(again.root, clip.root, atol=1e-12)
    assert not root_motion.floor_trajectory(clip, heading=False)[1].any()


def test_the_cycle_of_a_walk_is_found_and_closed():
    clip = walk(5.0, period=1.1)
    rng = np.random.default_rng(2)
    noisy = Clip(clip.times, clip.rotations @ exp(0.02 * rng.standard_normal((len(clip), len(NAMES), 3))), clip.root)
    found = loop.best_cycle(noisy, BODY, BETAS, 0.3, 4.7)
    length = clip.times[found.last] - clip.times[found.first]
    assert abs(length / 1.1 - round(length / 1.1)) < 0.05
    assert found.error_m < 0.03
    closed = loop.close_cycle(noisy, found)
    np.testing.assert_allclose(closed.rotations[-1], closed.rotations[0], atol=1e-9)
    assert closed.root[-1, 2] == pytest.approx(closed.root[0, 2])
    travelled = closed.root[-1, 1] - closed.root[0, 1]
    assert travelled == pytest.approx(-1.2 * length, abs=0.02)  # the root trajectory is kept
    assert closed.times[0] == 0.0
    with pytest.raises(UsageError, match="does not fit"):
        loop.best_cycle(clip, BODY, BETAS, 0.0, 0.2)


def test_a_cycle_that_turns_a_corner_closes_up_to_its_heading():
    clip = walk(3.0)
    turn = 0.5 * clip.times
    clip.rotations[:, 0] = exp(turn[:, None] * [0, 0, 1.0]) @ clip.rotations[:, 0]
    closed = loop.close_cycle(clip, loop.Cycle(10, 70, 0.0))
    relative = closed.rotations[-1, 0] @ closed.rotations[0, 0].T
    np.testing.assert_allclose(relative, exp([0, 0, 0.5 * 2.0]), atol=0.02)


@pytest.mark.parametrize("degrees", [0.2, 1.0, 4.0])
def test_reduced_keys_stay_within_the_bound(degrees):
    clip = walk(4.0)
    q = quaternion_from_matrix(clip.rotations[:, NAMES.index("left_hip")])
    q *= np.where((q[:, :1] < 0), -1, 1)
    keep = reduce.select_quaternion_keys(clip.times, q, np.radians(degrees))
    assert len(keep) < len(q)
    # Blender's interpolation: every component linear, then normalized
    rebuilt = np.stack([np.interp(clip.times, clip.times[keep], q[keep, k]) for k in range(4)], axis=1)
    rebuilt /= np.linalg.norm(rebuilt, axis=1, keepdims=True)
    off = angle(matrix_from_quaternion(rebuilt), matrix_from_quaternion(q))
    assert off.max() <= np.radians(degrees) * (1 + 1e-6)
    still = np.tile([1.0, 0, 0, 0], (50, 1))
    assert len(reduce.select_quaternion_keys(np.arange(50.0), still, 0.01)) == 2
    keep = reduce.select_position_keys(clip.times, clip.root, 0.005)
    rebuilt = np.stack([np.interp(clip.times, clip.times[keep], clip.root[keep, k]) for k in range(3)], axis=1)
    assert np.linalg.norm(rebuilt - clip.root, axis=1).max() <= 0.005
    with pytest.raises(UsageError, match="above zero"):
        reduce.select_position_keys(clip.times, clip.root, 0.0)
