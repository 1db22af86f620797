# SPDX-License-Identifier: GPL-3.0-or-later
"""Bone maps guessed by the names of common rigs, by shape where names say nothing, and by both."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.kinematics.mirrored_limbs import other_side
from scope.scope_addon.retarget.guess import by_geometry, by_name, guess
from scope.scope_addon.retarget.rest_pose import RestPose
from scope.solver.rotations import exp

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


def test_legs_alone_are_mapped_by_geometry() -> None:
    """With nothing in the middle but a root on the floor."""
    leg = np.array([[0.15, 0.0, 0.9], [0.15, -0.02, 0.5], [0.15, 0.0, 0.1]])
    heads = np.concatenate([np.zeros((1, 3)), leg, leg * [-1.0, 1.0, 1.0]])
    rest = RestPose(list("rabcdef"), np.array([-1, 0, 1, 2, 0, 4, 5]), heads)
    parts = [
        "pelvis",
        *(f"{side}_{p}" for side in ("left", "right") for p in ("hip", "knee", "ankle")),
    ]
    assert by_geometry(rest) == dict(zip(rest.names, parts, strict=True))


@pytest.mark.parametrize("tilt", [0.0, -0.35, 0.35])
@pytest.mark.parametrize("drop", [0.0, 0.8])
def test_a_rig_has_the_same_map_whichever_way_it_is_turned(drop: float, tilt: float) -> None:
    """Standing, or leaning back or forward."""
    bones, part_of = bones_of("nameless", drop=drop)
    leaning = bones.heads @ exp(np.array([tilt, 0.0, 0.0])).T
    for angle in np.radians([*range(0, 360, 15), 42, 48, 133, 137]):
        turned = leaning @ exp(np.array([0.0, 0.0, angle])).T
        found = guess(RestPose(bones.names, bones.parents, turned))
        assert found.parts == part_of, np.degrees(angle)


@pytest.mark.parametrize("scheme", ["mixamo", "unreal", "smpl"])
def test_the_bone_that_carries_hips_and_spine_is_the_pelvis(scheme: str) -> None:
    """Legs hang from the root and follow the hips by constraints; only a root on the floor carries
    hips and spine in another rig, so there, the hips remain.
    """
    bones, part_of = bones_of(scheme)
    bone_of = {part: bone for bone, part in part_of.items()}
    hips, spine, *thighs = (
        bones.names.index(bone_of[part]) for part in ("pelvis", "spine1", "left_hip", "right_hip")
    )
    heads = np.concatenate([[[0.0, 0.0, 0.0], bones.heads[hips]], bones.heads])
    for carrying, pelvis in ((1, "COG"), (0, bone_of["pelvis"])):
        parents = np.where(bones.parents < 0, -1, bones.parents + 2)
        parents[thighs] = 0
        parents[[hips, spine]] = carrying
        found = guess(RestPose(["root", "COG", *bones.names], np.array([-1, 0, *parents]), heads))
        expected = {bone: part for bone, part in part_of.items() if part != "pelvis"}
        assert found.parts == expected | {pelvis: "pelvis"}


def test_a_tail_does_not_tell_the_sides() -> None:
    """Though it is longer than the arms."""
    bones, part_of = bones_of("nameless", drop=0.8)
    places = [(0.0, 0.1 + 0.25 * k, 0.9 - 0.01 * k) for k in range(8)]
    rows = len(bones.names) + np.arange(len(places))
    rest = RestPose(
        [*bones.names, *(f"tail{row}" for row in rows)],
        np.array([*bones.parents, bones.names.index(names_of("nameless")["pelvis"]), *rows[:-1]]),
        np.array([*bones.heads, *places]),
    )
    assert guess(rest).parts == part_of


def with_wings(bones: RestPose, rise: float, reach: float) -> RestPose:
    """Return bones with wings on the chest of a person without names."""
    chest = bones.names.index(names_of("nameless")["spine3"])
    names = [*bones.names]
    parents = [*bones.parents]
    heads = [*bones.heads]
    for side in (1.0, -1.0):
        for k, share in enumerate(np.linspace(0.1, 1.0, 5)):
            parents.append(len(names) - 1 if k else chest)
            names.append(f"wing{len(names)}")
            heads.append(np.array([side * reach * share, 0.1 + 0.2 * share, 1.4 + rise * share]))
    return RestPose(names, np.array(parents), np.array(heads))


@pytest.mark.parametrize("drop", [0.0, 0.8])
@pytest.mark.parametrize("turn", [0.0, 2.0])
@pytest.mark.parametrize(("rise", "reach"), [(0.3, 0.9), (-0.6, 0.4)])
def test_wings_are_no_arms(drop: float, turn: float, rise: float, reach: float) -> None:
    """Spread or folded, on the back of a person that is turned."""
    bones, part_of = bones_of("nameless", drop=drop)
    winged = with_wings(bones, rise, reach)
    R_turned_rest = np.asarray(exp(np.array([0.0, 0.0, turn])), float)
    turned = winged.heads @ R_turned_rest.T
    assert guess(RestPose(winged.names, winged.parents, turned)).parts == part_of


def test_without_toes_shins_do_not_tell_arms_from_folded_wings() -> None:
    """They lead a little backwards; arms reach farther."""
    bones, part_of = bones_of("nameless", drop=0.8)
    kept = [k for k, bone in enumerate(bones.names) if not part_of[bone].endswith("_foot")]
    row_of = {-1: -1} | {bone: row for row, bone in enumerate(kept)}
    toeless = RestPose(
        [bones.names[bone] for bone in kept],
        np.array([row_of[int(bones.parents[bone])] for bone in kept]),
        bones.heads[kept],
    )
    found = guess(with_wings(toeless, -0.6, 0.4)).parts
    assert found == {bone: part for bone, part in part_of.items() if not part.endswith("_foot")}


def test_a_coat_down_to_the_feet_is_no_legs() -> None:
    """It hangs from the neck: with it for legs, the chest would carry a whole person."""
    bones, part_of = bones_of("nameless", drop=0.8)
    neck = bones.names.index(names_of("nameless")["neck"])
    names = [*bones.names]
    parents = [*bones.parents]
    heads = [*bones.heads]
    for x in (-0.2, -0.1, 0.0, 0.1, 0.2):
        for k in range(8):
            parents.append(len(names) - 1 if k else neck)
            names.append(f"coat{len(names)}")
            heads.append(bones.heads[neck] + [x, 0.15 + 0.05 * k, -0.18 * k])
    assert guess(RestPose(names, np.array(parents), np.array(heads))).parts == part_of


@pytest.mark.parametrize("angle", np.radians([0, 80, 135, 180, 300]))
def test_names_tell_the_sides_of_a_rig_without_toes(angle: float) -> None:
    """Names that tell nothing but the side."""
    bones, part_of = bones_of("nameless")
    kept = [row for row, bone in enumerate(bones.names) if not part_of[bone].endswith("_foot")]
    sides = {"left": "_L", "right": "_R"}
    names = [f"q{row}{sides.get(part_of[bones.names[row]].partition('_')[0], '')}" for row in kept]
    parents = [kept.index(parent) if parent >= 0 else -1 for parent in bones.parents[kept]]
    heads = bones.heads[kept] @ exp(np.array([0.0, 0.0, angle])).T
    found = guess(RestPose(names, np.array(parents), heads))
    assert found.parts == {
        name: part_of[bones.names[row]] for name, row in zip(names, kept, strict=True)
    }


def test_a_mirrored_rig_has_feet_and_hands_whose_names_tell_only_the_side() -> None:
    """What the other names call left is on the right there."""
    bones, part_of = bones_of("unreal")
    telling = {}
    for row, (bone, part) in enumerate(part_of.items()):
        side, _, kind = part.partition("_")
        unknown = kind in ("ankle", "foot", "wrist", "collar")
        telling[bone] = f"q{row}_{side[0]}" if unknown else bone
    names = [telling[bone] for bone in bones.names]
    mirrored = RestPose(names, bones.parents, bones.heads * [-1.0, 1.0, 1.0])
    found = guess(mirrored, is_mirrored=True).parts
    assert found == {telling[bone]: other_side(part) for bone, part in part_of.items()}


@pytest.mark.parametrize("unknown", [("left_ankle", "left_foot"), ("spine1",)])
def test_bones_whose_names_say_nothing_are_found_beside_others(unknown: tuple[str, ...]) -> None:
    """A hoof follows an ankle that the shape alone shows, and a belly lies below a chest."""
    bones, part_of = bones_of("unreal")
    names = [
        f"q{row}" if part_of[bone] in unknown else bone for row, bone in enumerate(bones.names)
    ]
    found = guess(RestPose(names, bones.parents, bones.heads)).parts
    assert found == {name: part_of[bone] for name, bone in zip(names, bones.names, strict=True)}


def doubled(bones: RestPose, first: str, second: str) -> RestPose:
    """Return a rig that has all bones twice: below a root that is where the pelvis is, and alone.

    :param first: what the names of the former begin with.
    :param second: what the names of the latter begin with.
    """
    count = len(bones.names)
    below_root = np.where(bones.parents < 0, 0, bones.parents + 1)
    alone = np.where(bones.parents < 0, -1, bones.parents + 1 + count)
    return RestPose(
        ["Global", *(prefix + name for prefix in (first, second) for name in bones.names)],
        np.array([-1, *below_root, *alone]),
        np.array([bones.heads[0], *bones.heads, *bones.heads]),
    )


TWICE = [("FK_", "DEF_"), ("DEF-", "FK-"), ("rig:FK ", "rig:DEF "), ("x.", "y.")]


@pytest.mark.parametrize("scheme", ["nameless", "unreal"])
@pytest.mark.parametrize(("first", "second"), TWICE)
def test_all_bones_of_a_rig_that_has_them_twice_are_of_one_person(
    scheme: str, first: str, second: str
) -> None:
    bones, part_of = bones_of(scheme, drop=0.8)
    found = guess(doubled(bones, first, second)).parts
    persons = [{prefix + bone: part_of[bone] for bone in part_of} for prefix in (first, second)]
    assert found == persons["FK" in second]


@pytest.mark.parametrize("scheme", ["nameless", "unreal"])
@pytest.mark.parametrize(("first", "second"), TWICE)
def test_bones_that_constraints_turn_are_left_out_where_there_are_others(
    scheme: str, first: str, second: str
) -> None:
    bones, part_of = bones_of(scheme, drop=0.8)
    rest = doubled(bones, first, second)
    for held, free in ((first, second), (second, first)):
        found = guess(rest, held={held + bone for bone in part_of})
        assert found.parts == {free + bone: part for bone, part in part_of.items()}


@pytest.mark.parametrize("limb", ["elbow", "knee", ""])
@pytest.mark.parametrize("scheme", ["nameless", "unreal"])
def test_bones_that_constraints_turn_are_taken_where_there_are_no_others(
    scheme: str, limb: str
) -> None:
    """Bones of IK, or all of them."""
    bones, part_of = bones_of(scheme)
    held = {bone for bone, part in part_of.items() if part.endswith(limb)}
    assert guess(bones, held=held).parts == part_of


@pytest.mark.parametrize("parts", [("spine1",), ("spine2", "spine3"), ("neck",), ("hip",)])
@pytest.mark.parametrize("scheme", ["nameless", "unreal"])
def test_bones_that_constraints_turn_are_taken_where_those_beside_them_are_of_no_use(
    scheme: str, parts: tuple[str, ...]
) -> None:
    """Their targets, say, which hang from the pelvis."""
    bones, part_of = bones_of(scheme, drop=0.8)
    held = [bone for bone, part in part_of.items() if part.endswith(parts)]
    pelvis = bones.names.index(names_of(scheme)["pelvis"])
    rest = RestPose(
        [*bones.names, *(f"target{k}" for k in range(len(held)))],
        np.array([*bones.parents, *[pelvis] * len(held)]),
        np.array([*bones.heads, *(bones.heads[bones.names.index(bone)] for bone in held)]),
    )
    assert guess(rest, held=held).parts == part_of
