# SPDX-License-Identifier: GPL-3.0-or-later
"""The trees of SMPL, SMPL+H and SMPL-X, against those that their papers and model files have."""

import numpy as np
import pytest
from scope.solver.smpl_family import recognise_skeleton

# kintree_table[0] of SMPL
BODY = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19]
# of SMPL+H; the right follows
LEFT_HAND = [20, 22, 23, 20, 25, 26, 20, 28, 29, 20, 31, 32, 20, 34, 35]
RIGHT_HAND = [21, 37, 38, 21, 40, 41, 21, 43, 44, 21, 46, 47, 21, 49, 50]
KINTREES = {
    "smpl": [*BODY, 20, 21],
    "smplh": [*BODY, *LEFT_HAND, *RIGHT_HAND],
    "smplx": [*BODY, 15, 15, 15, *(p + 3 if p > 21 else p for p in (*LEFT_HAND, *RIGHT_HAND))],
}


@pytest.mark.parametrize("name", KINTREES)
def test_a_published_tree_is_recognised(name: str) -> None:
    found = recognise_skeleton(np.array(KINTREES[name], np.int32))
    assert found is not None
    assert found.name == name
    assert len(found.joint_names) == len(set(found.joint_names)) == len(KINTREES[name])


@pytest.mark.parametrize("name", KINTREES)
def test_a_tree_that_differs_in_one_joint_is_not(name: str) -> None:
    for i in range(2, len(KINTREES[name])):
        other = list(KINTREES[name])
        other[i] = other[i] - 1 if other[i] > 0 else 1
        assert recognise_skeleton(np.array(other)) is None
