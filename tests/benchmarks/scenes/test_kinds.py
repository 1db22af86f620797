# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds of scenes hold their shares, and the first scenes hold them about as all do."""

from __future__ import annotations

import pytest
from scope.benchmarks.scenes.kinds import kind_of, split_of
from scope.benchmarks.scenes.scene import DEVELOPMENT, OUTDOORS, STATIC, TEST

RECORDINGS = 14


def kinds(numbers):
    return [kind_of(number, split_of(number), RECORDINGS) for number in numbers]


@pytest.mark.parametrize("split", [TEST, DEVELOPMENT])
def test_shares_hold_in_each_split(split):
    found = kinds(number for number in range(60) if split_of(number) == split)
    count = len(found)
    assert sum(kind.is_child for kind in found) == count // 5
    assert sum(kind.has_block for kind in found) == count // 4
    assert sum(kind.has_company for kind in found) == 3 * count // 10
    assert sum(kind.wears_loose for kind in found) == count // 2
    assert sum(kind.surroundings == OUTDOORS for kind in found) == count // 2
    assert sum(kind.camera == STATIC for kind in found) == 3 * count // 5
