# SPDX-License-Identifier: GPL-3.0-or-later
"""Fingers of rigs, by names alone, and by shape alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scope.scope_addon.retarget.fingers import find_fingers
from scope.scope_addon.retarget.rest_pose import RestPose

HAND = {"hand_l": "left_wrist"}
FINGERS = ("thumb", "index", "middle", "ring", "pinky")
# Names of the left hand's bones, of each finger and its three phalanges from the knuckle on.
NAMES = {
    "Unity": (
        "Left{finger}{k}",
        ("Thumb", "Index", "Middle", "Ring", "Little"),
        ("Proximal", "Intermediate", "Distal"),
    ),
    "Character Creator": ("CC_Base_L_{finger}{k}", ("Thumb", "Index", "Mid", "Ring", "Pinky")),
    "Biped, from the thumb on": ("Bip01 L Finger{finger}{k}", "01234", ("", "1", "2")),
    "phalanges with the name of a finger": ("{finger}{k}_L", FINGERS, ("Base", "Mid", "Top")),
    "a rig with the name of a finger": ("Little_{finger}{k}_L", FINGERS, ("Base", "Mid", "Top")),
}


def hand(
    pattern: str, fingers: Sequence[str], phalanges: Sequence[str] = "123"
) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Return names, parents and rest heads of a wrist and its fingers, the thumb forward (-y), on
    an arm along +x.
    """
    names = ["hand_l"]
    parents = [-1]
    heads = [(0.6, 0.0, 1.4)]
    for f, finger in enumerate(fingers):
        for k in (1, 2, 3):
            parents.append(0 if k == 1 else len(names) - 1)
            names.append(pattern.format(finger=finger, k=phalanges[k - 1]))
            along = 0.03 * k if f == 0 else 0.06 + 0.03 * k
            heads.append(
                (0.6 + 0.5 * along, -0.03 - along, 1.39)
                if f == 0
                else (0.6 + along, 0.02 * (f - 2.5), 1.4)
            )
    return names, np.array(parents), np.array(heads)


def expected(names: list[str]) -> dict[str, str]:
    return {
        names[1 + 3 * f + k]: f"left_{finger}{k + 1}"
        for f, finger in enumerate(FINGERS)
        for k in range(3)
    }


@pytest.mark.parametrize("tool", NAMES)
def test_fingers_are_found_by_their_names(tool):
    names, parents, heads = hand(*NAMES[tool])
    heads[:] = 0.0  # so that nothing but the names can tell
    assert find_fingers(RestPose(names, parents, heads), HAND) == expected(names)


@pytest.mark.parametrize("above", [0, 1, 2, 3])
@pytest.mark.parametrize(
    ("rig", "helper"),
    [("", "{finger}_Spring"), ("", "{finger}helper"), ("Spring_", "{finger}_Jiggle1")],
)
def test_helpers_among_the_bones_of_a_finger_are_no_phalanges(rig, helper, above):
    """Each finger has a helper above the knuckle, between two phalanges or below the last one, and
    another one that ends there.
    """
    names = ["hand_l"]
    parents = [-1]
    wanted = {}
    for finger in FINGERS:
        phalanges = [f"{rig}{finger}{k}_L" for k in (1, 2, 3)]
        wanted |= {name: f"left_{finger}{k}" for k, name in enumerate(phalanges, 1)}
        helper_name = rig + helper.format(finger=finger)
        chain = [*phalanges[:above], helper_name, *phalanges[above:]]
        parents += [0, *range(len(names), len(names) + len(chain) - 1)]
        names += chain
        parents.append(names.index(helper_name))
        names.append(f"{helper_name}_b")
    rest = RestPose(names, np.array(parents), np.zeros((len(names), 3)))
    assert find_fingers(rest, HAND) == wanted


@pytest.mark.parametrize("turn", [0.0, 3.0])
def test_fingers_without_names_are_found_by_their_shape_in_any_order(turn):
    names, parents, heads = hand("b{finger}{k}", tuple("qwerz"))
    c = np.cos(turn)
    s = np.sin(turn)
    heads = heads @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    assert find_fingers(RestPose(names, parents, heads), HAND) == expected(names)
    order = [0, *(1 + 3 * f + k for f in (3, 0, 4, 2, 1) for k in range(3))]
    place = {old: new for new, old in enumerate(order)}
    shuffled = np.array([place.get(int(parents[old]), -1) for old in order])
    rest = RestPose([names[old] for old in order], shuffled, heads[order])
    assert find_fingers(rest, HAND) == expected(names)


def test_bones_in_the_palm_are_no_phalanges_of_fingers_without_names():
    names, parents, heads = hand("b{finger}_{k}", "abcde")
    for knuckle in (4, 7, 10, 13):
        parents[knuckle] = len(names)
        names = [*names, f"palm{knuckle}"]
    palms = heads[0] + 0.3 * (heads[[4, 7, 10, 13]] - heads[0])
    order = [0, *range(16, 20), *range(1, 16)]  # parents come before children
    place = np.argsort(order)
    whole = np.array([*parents, 0, 0, 0, 0])[order]
    rest = RestPose(
        [names[row] for row in order],
        np.where(whole < 0, -1, place[whole]),
        np.concatenate([heads, palms])[order],
    )
    assert find_fingers(rest, HAND) == expected(names)
