# SPDX-License-Identifier: GPL-3.0-or-later
"""Somebody who walks on the spot before a static camera: exact keypoints, solved as a walk whose
strides contradict its path, as one on a treadmill, and with the speed of the belt.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scope.scope_addon.capture.solve import Solved, solve
from scope.scope_addon.capture.tracking.track import Track
from scope.solver.rotations import exp

from .standing_people import BODY, RATE, seen, track_of

pytestmark = pytest.mark.usefixtures("exact_lifting")
SECONDS = 3.0
BELT_M_S = 1.2
FACING = exp(np.array([np.pi / 2, 0.0, 0.0])) @ exp(np.array([0.0, 1.2, 0.0]))


@pytest.fixture(scope="module")
def on_the_spot() -> Track:
    """One stride per second; the lowest foot is on the floor."""
    betas = np.zeros(BODY.P)
    phase = 2 * np.pi * np.arange(round(SECONDS * RATE)) / RATE
    pose = np.zeros((len(phase), BODY.K + 1, 3))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        swing = sign * np.cos(phase)
        pose[:, BODY.joint_names.index(f"{side}_hip"), 0] = -0.4 * sign * np.sin(phase)
        pose[:, BODY.joint_names.index(f"{side}_knee"), 0] = 0.1 + 0.7 * np.maximum(swing, 0.0)
        pose[:, BODY.joint_names.index(f"{side}_shoulder"), 2] = -1.2 * sign
    rotations = exp(pose)
    trans = np.tile([0.0, 3.5, 0.0], (len(phase), 1))
    for k, frame in enumerate(rotations):
        R, t = BODY.forward_kinematics(
            np.concatenate([FACING[None], frame[1:]]), np.zeros(3), betas
        )
        trans[k, 2] = -BODY.skin(R, t, betas)[:, 2].min()
    return track_of(rotations, FACING, trans, betas)


def solved(track: Track, **options: Any) -> Solved:
    return solve(replace(seen(track), **options), [track], lambda *_: None, [BODY.stature()])


@pytest.mark.slow
def test_on_a_treadmill_people_stay_and_no_foot_is_held(on_the_spot):
    warned = solved(on_the_spot)
    assert warned.contradictions[0] is not None
    on_treadmill = solved(on_the_spot, treadmill=True)
    assert on_treadmill.contradictions == [None]
    motion = on_treadmill.motions[0]
    assert np.ptp(motion.trans[:, :2], axis=0).max() < 0.1
    assert motion.foot_contact.max() == 0.0
    assert on_treadmill.path.is_static


def test_with_the_speed_of_the_belt_people_walk_over_the_floor(on_the_spot):
    found = solved(on_the_spot, treadmill=True, belt_m_s=BELT_M_S)
    assert found.contradictions == [None]
    motion = found.motions[0]
    duration_s = motion.timestamps[-1] - motion.timestamps[0]
    way = motion.trans[-1, :2] - motion.trans[0, :2]
    assert np.linalg.norm(way) == pytest.approx(BELT_M_S * duration_s, rel=0.05)
    facing = exp(motion.poses[:, :3])[:, :2, 2].mean(axis=0)
    assert way @ facing > 0.98 * np.linalg.norm(way) * np.linalg.norm(facing)
    # The camera goes along, so the picture stays what it is.
    camera = motion.world_from_camera[-1, :2, 3] - motion.world_from_camera[0, :2, 3]
    assert np.linalg.norm(camera - way) < 0.1
    assert motion.foot_contact.max() > 0.5
    assert motion.residual_px.mean() < 12.0
