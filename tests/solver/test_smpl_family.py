# SPDX-License-Identifier: GPL-3.0-or-later
"""The trees of SMPL, SMPL+H and SMPL-X, against those that their papers and model files have."""

import numpy as np
import pytest
from scope.solver.smpl_family import LANDMARK_VERTICES, SKELETONS, recognise_skeleton

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


def test_left_and_right_have_the_same_joints() -> None:
    for skeleton in SKELETONS.values():
        sides = [
            {n.split("_", 1)[1] for n in skeleton.joint_names if n.startswith(s)}
            for s in ("left_", "right_")
        ]
        assert sides[0] == sides[1]
        for i, name in enumerate(skeleton.joint_names):
            parent = skeleton.joint_names[skeleton.parents[i]]
            if name.startswith("left_") and parent.startswith(("left_", "right_")):
                assert parent.startswith("left_")


@pytest.mark.parametrize("count", [6890, 10475])
def test_landmarks_are_vertices_of_the_template_and_each_has_its_mirror(count: int) -> None:
    found = LANDMARK_VERTICES[count]
    assert all(0 <= vertex < count for vertex in found.values())
    assert len(set(found.values())) == len(found)
    for name in found:
        if name.startswith("left_"):
            assert name.replace("left_", "right_") in found
