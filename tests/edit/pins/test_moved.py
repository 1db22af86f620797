# SPDX-License-Identifier: GPL-3.0-or-later
"""A motion that is moved in the world, with its camera: every joint and the image stay where they
belong.
"""

from __future__ import annotations

import numpy as np
import pytest
from scope.scope_addon.edit.clip import clip_from_motion
from scope.scope_addon.edit.pins.moved import moved_clip, moved_motion
from scope.solver.rotations import exp

from ..walking import BETAS, BODY, motion_of, walk

MOTION = motion_of(walk(1.0), noise=0.02)


def transform(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    T = np.eye(4)
    T[:3, :3] = exp(rng.normal(size=3))
    T[:3, 3] = rng.normal(size=3)
    return T


@pytest.mark.parametrize("raw", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_joints_move_with_the_world_and_the_image_stays(seed: int, raw: bool) -> None:
    T = transform(seed)
    moved = moved_motion(MOTION, BODY, T)
    before, after = (
        clip_from_motion(BODY, m, raw=raw).joints(BODY, BETAS) for m in (MOTION, moved)
    )
    np.testing.assert_allclose(after, before @ T[:3, :3].T + T[:3, 3], atol=2e-6)
    seen = [
        np.einsum(
            "tji,tkj->tki",
            m.world_from_camera[:, :3, :3],
            joints - m.world_from_camera[:, None, :3, 3],
        )
        for m, joints in ((MOTION, before), (moved, after))
    ]
    np.testing.assert_allclose(seen[1], seen[0], atol=5e-6)


def test_a_clip_moves_as_its_motion_does() -> None:
    T = transform(7)
    found = moved_clip(clip_from_motion(BODY, MOTION, raw=False), T)
    expected = clip_from_motion(BODY, moved_motion(MOTION, BODY, T), raw=False)
    np.testing.assert_allclose(found.rotations, expected.rotations, atol=1e-5)
    np.testing.assert_allclose(found.root, expected.root, atol=1e-5)


def test_there_and_back_nothing_has_changed_and_the_given_motion_never_does() -> None:
    T = transform(8)
    poses = MOTION.poses.copy()
    back = moved_motion(moved_motion(MOTION, BODY, T), BODY, np.linalg.inv(T))
    np.testing.assert_array_equal(MOTION.poses, poses)
    for name in ("trans", "trans_raw", "world_from_camera"):
        np.testing.assert_allclose(getattr(back, name), getattr(MOTION, name), atol=1e-5)
    np.testing.assert_allclose(
        exp(back.poses.reshape(-1, 3)), exp(MOTION.poses.reshape(-1, 3)), atol=1e-5
    )
