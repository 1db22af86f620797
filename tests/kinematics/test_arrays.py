# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks of frames give what one call for all frames gives. Large arrays alone are rounded.

Runs of True.

The path with the least cost, against all possible paths.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
import pytest
from scope.scope_addon.kinematics import frame_blocks
from scope.scope_addon.kinematics.frame_blocks import by_blocks, to_single_precision
from scope.scope_addon.kinematics.sequences import least_cost_path, runs


@pytest.mark.parametrize("frames", [0, 5, 17])
def test_blocks_give_the_result_of_one_call(frames, monkeypatch):
    monkeypatch.setattr(frame_blocks, "BLOCK_FRAMES", 5)
    rng = np.random.default_rng(frames)
    a = rng.normal(size=(frames, 3))
    b = rng.normal(size=(frames, 2)).astype(np.float32)
    sizes = []

    def compute(x, y):
        sizes.append(len(x))
        return x.sum(axis=1), (2 * y).astype(np.float32)

    total, double = by_blocks(compute, a, b)
    np.testing.assert_array_equal(total, a.sum(axis=1))
    np.testing.assert_array_equal(double, 2 * b)
    assert double.dtype == np.float32
    assert max(sizes) <= 5
    assert sum(sizes) == frames


@dataclass(frozen=True)
class Record:
    large: np.ndarray
    quaternion: np.ndarray
    point: np.ndarray
    times: np.ndarray
    frames: np.ndarray
    name: str


def test_only_large_arrays_are_rounded() -> None:
    rng = np.random.default_rng(0)
    large, quaternion, point = (rng.normal(0, 5, (50, *shape)) for shape in ((33, 3), (4,), (3,)))
    record = Record(
        large, quaternion, point, np.arange(50) / 30, np.arange(400).reshape(50, 8), "a"
    )
    small = to_single_precision(record)
    assert small.large.dtype == np.float32
    np.testing.assert_allclose(small.large, record.large, atol=1e-6)
    assert small.quaternion.dtype == np.float32
    assert small.point is record.point
    assert small.times is record.times
    assert small.frames is record.frames
    assert to_single_precision(small) is small


def test_runs_of_every_short_mask_are_those_that_grouping_finds():
    for mask in itertools.product([False, True], repeat=7):
        expected = []
        row = 0
        for value, group in itertools.groupby(mask):
            length = len(list(group))
            expected += [(row, row + length)] if value else []
            row += length
        assert runs(np.array(mask)) == expected


@pytest.mark.parametrize(("count", "states", "barred"), [(1, 3, 0.0), (5, 3, 0.0), (5, 3, 0.4)])
def test_no_other_path_costs_less(count: int, states: int, barred: float) -> None:
    rng = np.random.default_rng(count)
    for _ in range(5):
        costs = rng.normal(size=(count, states))
        switching = rng.normal(size=(count - 1, states, states))
        switching[rng.random(switching.shape) < barred] = np.inf
        switching[:, 0, 0] = 1.0  # there is always a way

        def cost(path, costs=costs, switching=switching) -> float:
            there = sum(costs[t, x] for t, x in enumerate(path))
            return there + sum(switching[t, a, b] for t, (a, b) in enumerate(pairwise(path)))

        expected = min(product(range(states), repeat=count), key=cost)
        assert tuple(least_cost_path(costs, switching)) == expected


def test_no_frames() -> None:
    assert least_cost_path(np.zeros((0, 3)), np.zeros((0, 3, 3))).shape == (0,)
