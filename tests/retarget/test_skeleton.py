# SPDX-License-Identifier: GPL-3.0-or-later
"""Channels and heads of a rig's bones, against a chain of 4 x 4 matrices as Blender multiplies
them.
"""

from __future__ import annotations

import numpy as np
from scope.scope_addon.retarget.rest_pose import Skeleton, basis, head_positions
from scope.solver.rotations import exp

FRAMES = 7


def rigid(R: np.ndarray, t: np.ndarray) -> np.ndarray:
    out = np.eye(4)
    out[:3, :3] = R
    out[:3, 3] = t
    return out


def random_rig(rng: np.random.Generator, bones: int = 6) -> Skeleton:
    parents = np.array([-1, *(rng.integers(0, b) for b in range(1, bones))])
    heads = rng.normal(size=(bones, 3))
    rotations = exp(rng.normal(size=(bones, 3)))
    return Skeleton([f"b{i}" for i in range(bones)], parents, parents, heads, heads + 1, rotations)


def test_channels_and_heads_give_the_world_rotations_when_blender_multiplies_them() -> None:
    """Pose matrix of a bone = that of its parent x (parent's rest)^-1 x own rest x channel."""
    rng = np.random.default_rng(0)
    rig = random_rig(rng)
    wanted = exp(rng.normal(size=(FRAMES, len(rig.names), 3)))
    channels = basis(rig, wanted)
    heads = head_positions(rig, wanted)
    for t in range(FRAMES):
        posed: list[np.ndarray] = []
        for b, parent in enumerate(rig.parents.tolist()):
            rest = rigid(rig.rotations[b], rig.heads[b])
            before = np.eye(4)
            if parent >= 0:
                before = posed[parent] @ np.linalg.inv(
                    rigid(rig.rotations[parent], rig.heads[parent])
                )
            posed.append(before @ rest @ rigid(channels[t, b], np.zeros(3)))
            np.testing.assert_allclose(posed[b], rigid(wanted[t, b], heads[t, b]), atol=1e-12)


def test_a_bone_that_inherits_no_rotation_still_moves_with_what_carries_it() -> None:
    rng = np.random.default_rng(9)
    rig = random_rig(rng, 3)
    parents = rig.parents.copy()
    parents[2] = -1
    free = Skeleton(rig.names, parents, rig.carriers, rig.heads, rig.ends, rig.rotations)
    wanted = exp(rng.normal(size=(FRAMES, 3, 3)))
    np.testing.assert_allclose(head_positions(free, wanted), head_positions(rig, wanted))
    np.testing.assert_allclose(
        free.rotations[2] @ basis(free, wanted)[:, 2], wanted[:, 2], atol=1e-12
    )
