# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds of scenes hold their shares, and the first scenes hold them about as all do."""

from __future__ import annotations

from collections import Counter

import pytest
from scope.benchmarks.scenes.kinds import kind_of, split_of
from scope.benchmarks.scenes.scene import DEVELOPMENT, NEW_PERFORMERS, OUTDOORS, STATIC, TEST

RECORDINGS = 14


def kinds(numbers):
    return [kind_of(number, split_of(number), RECORDINGS) for number in numbers]


def test_two_of_three_scenes_are_for_testing():
    assert [number for number in range(7) if split_of(number) == TEST] == [1, 2, 4, 5]


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


def test_the_first_scenes_show_every_recording_once_and_hold_the_shares():
    first = kinds([number for number in range(60) if split_of(number) == TEST][:RECORDINGS])
    assert {kind.recording for kind in first} == set(range(RECORDINGS))
    assert 2 <= sum(kind.is_child for kind in first) <= 4
    assert sum(kind.wears_loose for kind in first) == 7


def test_properties_are_independent():
    pairs = Counter((kind.wears_loose, kind.surroundings) for kind in kinds(range(600)))
    assert len(pairs) == 4
    assert min(pairs.values()) > 110


def test_scenes_of_new_performers_show_each_as_often_as_any_other():
    found = [kind_of(number, NEW_PERFORMERS, 6) for number in range(24)]
    assert set(Counter(kind.recording for kind in found).values()) == {4}
    assert sum(kind.wears_loose for kind in found) == 12
