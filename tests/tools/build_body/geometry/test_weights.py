# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin weights are at most four, sum to one, and treat equals alike."""

from __future__ import annotations

import numpy as np
from scope.tools.build_body.geometry.weights import keep_strongest, pack


def test_the_four_strongest_are_kept_in_proportion() -> None:
    W = np.random.default_rng(1).dirichlet(np.ones(9), 200)
    kept = keep_strongest(W)
    np.testing.assert_allclose(kept.sum(axis=1), 1.0)
    for row, left in zip(W, kept, strict=True):
        used = np.flatnonzero(left)
        assert set(used) <= set(np.argsort(-row)[:4])
        np.testing.assert_allclose(left[used] / left[used[0]], row[used] / row[used[0]])


def test_of_equal_weights_none_is_preferred() -> None:
    """Otherwise the left side would keep another joint than the right."""
    row = np.array([[0.4, 0.2, 0.1, 0.1, 0.1, 0.1]])
    np.testing.assert_allclose(keep_strongest(row), [[2 / 3, 1 / 3, 0, 0, 0, 0]])


def test_packed_weights_give_the_same_rows() -> None:
    W = keep_strongest(np.random.default_rng(2).dirichlet(np.full(7, 0.3), 100))
    joints, weights = pack(W)
    assert joints.shape == weights.shape == (100, 4)
    assert (np.diff(weights, axis=1) <= 0).all()
    unpacked = np.zeros_like(W)
    np.add.at(unpacked, (np.arange(100)[:, None], joints), weights)
    np.testing.assert_allclose(unpacked, W)
    assert (joints[weights == 0] == 0).all()
