# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs of True."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scope.scope_addon.kinematics.runs import runs


def test_runs_of_every_short_mask_are_those_that_grouping_finds():
    for mask in itertools.product([False, True], repeat=7):
        expected = []
        row = 0
        for value, group in itertools.groupby(mask):
            length = len(list(group))
            expected += [(row, row + length)] if value else []
            row += length
        assert runs(np.array(mask)) == expected


@pytest.mark.parametrize("value", [False, True])
def test_an_empty_mask_has_none_and_a_full_one_is_one(value):
    assert runs(np.zeros(0, bool)) == []
    assert runs(np.full(3, value)) == ([(0, 3)] if value else [])
