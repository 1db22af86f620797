# SPDX-License-Identifier: GPL-3.0-or-later
"""A rig's rest pose in the body's T-pose: heading, arms of an A-pose, and feet that point
outwards.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.kinematics.axes import R_WORLD_MODEL
from scope.scope_addon.retarget.skeleton import Skeleton
from scope.scope_addon.retarget.transfer import heading_alignment, rest_alignment
from scope.solver.body_file import load_body
from scope.solver.rotations import exp

from ..edit.walking import BETAS, BODY, NAMES
from .made_skeletons import MAPPED, VERTICAL, body_rig

REST = BODY.rest_joints(BETAS) @ R_WORLD_MODEL.T
INDEX = {name: i for i, name in enumerate(NAMES)}
ROW = {name: b for b, name in enumerate(MAPPED)}


def aligned(rig: Skeleton) -> tuple[np.ndarray, np.ndarray]:
    F = heading_alignment(rig, ROW)
    return rest_alignment(rig, MAPPED, ROW, REST, INDEX, F), F


@pytest.mark.parametrize("heading", [0.0, 0.4, -2.5])
def test_the_heading_is_taken_from_the_hips(heading: float) -> None:
    F = heading_alignment(body_rig(heading=heading), ROW)
    left = F @ exp(heading * VERTICAL) @ (REST[INDEX["left_hip"]] - REST[INDEX["right_hip"]])
    assert left[1] == pytest.approx(0.0, abs=1e-9)
    assert left[0] > 0
    np.testing.assert_allclose(F @ VERTICAL, VERTICAL, atol=1e-12)


@pytest.mark.parametrize("arms_down", [-0.3, 0.0, 0.8, 1.4])
def test_arms_of_any_rest_pose_are_turned_to_the_t_pose(arms_down: float) -> None:
    rig = body_rig(scale=1.4, heading=0.7, arms_down=arms_down)
    A, F = aligned(rig)
    for side in ("left", "right"):
        for part, end in (("shoulder", "elbow"), ("elbow", "wrist")):
            a = f"{side}_{part}"
            b = f"{side}_{end}"
            found = A[ROW[a]] @ F @ (rig.heads[ROW[b]] - rig.heads[ROW[a]])
            np.testing.assert_allclose(found, 1.4 * (REST[INDEX[b]] - REST[INDEX[a]]), atol=1e-9)


@pytest.mark.parametrize("turn", [0.0, 0.6, -1.2])
def test_hands_of_any_rest_pose_are_turned_until_the_palms_are_the_bodys(turn: float) -> None:
    """A rig whose hands and fingers are turned about the forearms at rest."""
    body = load_body("scope_h")
    rest = body.rest_joints(np.zeros(body.P)) @ R_WORLD_MODEL.T
    names = list(body.joint_names)
    heads = rest.copy()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        wrist = rest[names.index(f"{side}_wrist")]
        of_hand = [
            i for i, name in enumerate(names) if name.startswith(f"{side}_") and name[-1] in "123"
        ]
        heads[of_hand] = wrist + (heads[of_hand] - wrist) @ exp(np.array([sign * turn, 0.0, 0.0])).T
    parents = np.asarray(body.parents)
    tails = heads + [0.0, 0.0, 0.02]
    rig = Skeleton(
        names, parents, parents, heads, tails, np.tile(np.eye(3), (len(names), 1, 1)), floor=0.0
    )
    row = {name: i for i, name in enumerate(names)}
    A = rest_alignment(rig, names, row, rest, row, np.eye(3))
    for side in ("left", "right"):
        wrist, first, last = (row[f"{side}_{part}"] for part in ("wrist", "index1", "pinky1"))
        for knuckle in (first, last):
            found = A[wrist] @ (heads[knuckle] - heads[wrist])
            np.testing.assert_allclose(found, rest[knuckle] - rest[wrist], atol=1e-9)
