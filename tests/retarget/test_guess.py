# SPDX-License-Identifier: GPL-3.0-or-later
"""Bone maps guessed by the names of common rigs, by shape where names say nothing, and by both."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.retarget.guess import by_geometry, by_name, guess
from scope.scope_addon.retarget.rest_pose import RestPose

from .naming_schemes import PARENTS, PLACES, SCHEMES, SIDED, names_of


def bones_of(scheme: str, size: float = 1.0, drop: float = 0.0) -> tuple[RestPose, dict[str, str]]:
    """Return the bones of a rig and the part of each; arms lowered by `drop` radians."""
    bone_of = names_of(scheme)
    heads = []
    parents = []
    order = list(bone_of)
    for part in order:
        side, _, kind = part.partition("_")
        x, y, z = PLACES[kind or part]
        if kind in ("elbow", "wrist"):
            sx, _, sz = PLACES["shoulder"]
            x, z = (
                sx + (x - sx) * np.cos(drop) + (z - sz) * np.sin(drop),
                sz - (x - sx) * np.sin(drop),
            )
        heads.append((-x if side == "right" else x, y, z))
        parent = PARENTS.get(kind or part, "")
        parents.append(
            order.index(f"{side}_{parent}" if parent in SIDED else parent) if parent else -1
        )
    rest = RestPose([bone_of[part] for part in order], np.array(parents), size * np.array(heads))
    return rest, {bone: part for part, bone in bone_of.items()}


@pytest.mark.parametrize("scheme", sorted(SCHEMES))
@pytest.mark.parametrize(("size", "drop"), [(1.0, 0.0), (1.0, 0.8), (100.0, 0.4)])
def test_every_part_is_found(scheme: str, size: float, drop: float) -> None:
    bones, part_of = bones_of(scheme, size, drop)
    found = guess(bones)
    assert found.parts == part_of
    found.check()


@pytest.mark.parametrize("scheme", sorted(set(SCHEMES) - {"nameless"}))
def test_names_alone_are_enough(scheme: str) -> None:
    bones, part_of = bones_of(scheme)
    assert by_name(RestPose(bones.names, bones.parents, np.zeros_like(bones.heads))) == part_of


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("drop", [0.0, 0.8])
def test_shape_alone_is_enough(drop: float, order: int) -> None:
    """Whatever the names, and whichever leg comes first."""
    bones, part_of = bones_of("unreal", drop=drop)
    renamed = [f"q{order * i}" for i in range(len(bones.names))]
    expected = {renamed[bones.names.index(bone)]: part for bone, part in part_of.items()}
    assert by_geometry(RestPose(renamed, bones.parents, bones.heads)) == expected


def test_what_is_no_person_has_no_map() -> None:
    chain = RestPose(
        ["a", "b", "c"], np.array([-1, 0, 1]), np.array([[0, 0, z] for z in (0.0, 1.0, 2.0)])
    )
    assert guess(chain).parts == {}


def test_an_arm_of_a_single_bone_has_no_joints_but_a_shoulder():
    """And the legs are found all the same."""
    heads = {
        "q0": (0.0, 0.0, 1.0),
        **{"q1": (0.1, 0.0, 1.0), "q2": (0.1, 0.0, 0.5), "q3": (0.1, 0.0, 0.0)},
        **{"q4": (-0.1, 0.0, 1.0), "q5": (-0.1, 0.0, 0.5), "q6": (-0.1, 0.0, 0.0)},
        **{"q7": (0.6, 0.0, 1.5), "q8": (-0.6, 0.0, 1.5)},
    }
    parents = np.array([-1, 0, 1, 2, 0, 4, 5, 0, 0])
    found = by_geometry(RestPose(list(heads), parents, np.array(list(heads.values()))))
    assert found["q7"] == "left_shoulder"
    assert found["q8"] == "right_shoulder"
    assert found["q2"] == "left_knee"
