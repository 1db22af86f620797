# SPDX-License-Identifier: GPL-3.0-or-later
"""Blocks of frames give what one call for all frames gives."""

import numpy as np
import pytest
from scope.scope_addon.kinematics import frame_blocks


@pytest.mark.parametrize("frames", [0, 1, 4, 5, 6, 17])
def test_blocks_give_the_result_of_one_call(frames, monkeypatch):
    monkeypatch.setattr(frame_blocks, "BLOCK_FRAMES", 5)
    rng = np.random.default_rng(frames)
    a = rng.normal(size=(frames, 3))
    b = rng.normal(size=(frames, 2)).astype(np.float32)
    sizes = []

    def compute(x, y):
        sizes.append(len(x))
        return x.sum(axis=1), (2 * y).astype(np.float32)

    total, double = frame_blocks.by_blocks(compute, a, b)
    np.testing.assert_array_equal(total, a.sum(axis=1))
    np.testing.assert_array_equal(double, 2 * b)
    assert double.dtype == np.float32
    assert max(sizes) <= 5
    assert sum(sizes) == frames


def test_one_array_is_enough(monkeypatch):
    monkeypatch.setattr(frame_blocks, "BLOCK_FRAMES", 5)
    (squares,) = frame_blocks.by_blocks(lambda x: (x**2,), np.arange(12))
    np.testing.assert_array_equal(squares, np.arange(12) ** 2)
