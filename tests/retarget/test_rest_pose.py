# SPDX-License-Identifier: GPL-3.0-or-later
"""Where bones end: at their children, their skin, or their tails, whatever means something."""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.retarget.rest_pose import RestPose, rest_faults

# An elbow, and a hand with a thumb and two fingers, along +x.
NAMES = ["forearm", "hand", "thumb", "index", "middle"]
PARENTS = np.array([-1, 0, 1, 1, 1])
HEADS = np.array([[0, 0, 1], [0.3, 0, 1], [0.33, -0.05, 1], [0.4, -0.02, 1], [0.4, 0, 1]], float)
UP = HEADS + np.array([0.0, 0.0, 40.0])


def test_a_bone_without_children_ends_where_its_skin_does() -> None:
    skin = np.array([[0.3, 0.02, 1], [0.3, -0.02, 1], [0.5, 0.02, 1], [0.5, -0.02, 1]])
    rest = RestPose(NAMES[:2], PARENTS[:2], HEADS[:2], UP[:2], skin, np.array([1, 1, 1, 1]))
    np.testing.assert_allclose(rest.end(1), [0.5, 0, 1])


def test_a_foot_without_toes_ends_at_the_ball_of_its_skin() -> None:
    heads = np.array([[0.1, 0.0, 0.5], [0.1, 0.0, 0.1]])
    skin = np.array([[x, y, 0.02] for x in (0.06, 0.14) for y in (0.06, 0.0, -0.07, -0.2)])
    rest = RestPose(["shin", "foot"], PARENTS[:2], heads, heads, skin, np.ones(8, int))
    ball = rest.end(1, forward=np.array([0.0, -1.0, 0.0]))
    np.testing.assert_allclose(ball, [0.1, -0.14, 0.02], atol=1e-9)


def standing(**moved: tuple[float, float, float]) -> dict[str, np.ndarray]:
    """Return the heads of a person who looks along -y, some of them moved."""
    heads = {"head": (0.0, 0.0, 1.6)}
    for side, x in (("left", 0.1), ("right", -0.1)):
        heads |= {
            f"{side}_hip": (x, 0.0, 0.9), f"{side}_knee": (x, 0.0, 0.5),
            f"{side}_ankle": (x, 0.0, 0.1), f"{side}_foot": (x, -0.1, 0.02),
            f"{side}_shoulder": (2 * x, 0, 1.4), f"{side}_elbow": (4 * x, 0, 1.4),
            f"{side}_wrist": (6 * x, 0, 1.4),
        }  # fmt: skip
    return {part: np.array(at, float) for part, at in (heads | moved).items()}


def legs(**places: tuple[float, float]) -> dict[str, tuple[float, float, float]]:
    """Return parts of both legs at places (y, z)."""
    sides = (("left", 0.1), ("right", -0.1))
    return {f"{side}_{part}": (x, *at) for side, x in sides for part, at in places.items()}


@pytest.mark.parametrize(
    ("moved", "reasons"),
    [
        ({}, []),
        ({"left_knee": (0.1, 0.0, 0.85)}, ["segments", "sides"]),
        ({"left_wrist": (2.0, 0.0, 1.4)}, ["segments", "sides"]),
        ({"left_ankle": (0.1, 0.0, 1.0)}, ["upwards"]),
        ({"head": (0.0, 1.6, 0.9)}, ["lying"]),
        (legs(knee=(-0.4, 0.9), ankle=(-0.4, 0.5)), ["lying"]),  # sitting
        (legs(knee=(-0.2, 0.55), ankle=(0.05, 0.1)), []),  # as animals that walk on their toes
    ],
)
def test_parts_that_cannot_be_right_are_found(moved, reasons) -> None:
    found = rest_faults(standing(**moved))
    assert list(dict.fromkeys(fault.reason for fault in found)) == reasons
