# SPDX-License-Identifier: GPL-3.0-or-later
"""Heights of the feet's skin against full skinning, and the floors that people stand on."""

import numpy as np
import pytest
from scope.scope_addon.kinematics import foot_skin
from scope.scope_addon.kinematics.foot_skin import FootSkin, lower_floors, steps, upper_floors
from scope.solver import rotations
from scope.solver.body_file import load_body

from ..made_motion import made_motion
from .posed_people import FPS

TIMES = np.arange(60) / FPS
STANDING = np.full((60, 4), 0.95)


@pytest.mark.parametrize("pitch", [-0.6, 0.2])
def test_the_lowest_skin_is_the_lowest_vertex_of_a_pitched_foot(pitch):
    body = load_body("scope")
    betas = np.linspace(-1.5, 1.5, body.P)
    omega = np.tile(np.eye(3), (body.K + 1, 1, 1))
    omega[0] = rotations.exp(np.array([np.pi / 2, 0, 0]))  # z up
    for side in ("left", "right"):
        omega[body.joint_names.index(f"{side}_ankle")] = rotations.exp(np.array([pitch, 0.1, 0.1]))
    R, t = body.forward_kinematics(omega, np.zeros(3), betas)
    found = FootSkin(body, betas).heights(R[None], t[None], np.array([0.0, 0, 1]))[0]
    assert abs(found.min() - body.skin(R, t, betas)[:, 2].min()) < 0.002


def test_heights_and_frames_under_the_floor_of_a_motion():
    body = load_body("scope")
    poses = np.zeros((20, body.K + 1, 3))
    trans = np.zeros((20, 3))
    poses[:, 0] = [np.pi / 2, 0, 0]
    R, t = body.forward_kinematics(rotations.exp(poses[0]), trans[0])
    trans[:, 2] = -body.skin(R, t)[:, 2].min()
    trans[5:8, 2] -= 0.012
    trans[8:10, 2] -= 0.008
    motion = made_motion(body, poses, trans)
    assert np.flatnonzero(foot_skin.under_floor(motion, body)).tolist() == [5, 6, 7]
    assert abs(foot_skin.foot_heights(motion, body)[0].min()) < 0.002


def test_somebody_who_lands_lower_is_on_another_floor_from_the_fall_on():
    heights = np.where(TIMES < 1.0, 0.02, -np.minimum(1.8, 6 * (TIMES - 0.95)))[:, None] * np.ones(
        4
    )
    assert lower_floors(heights, STANDING, TIMES) == [(30, 60)]
    assert upper_floors(heights, STANDING, TIMES) == []


def test_a_depth_error_is_no_floor():
    heights = np.where((TIMES > 1.0) & (TIMES < 1.5), -0.3, 0.0)[:, None] * np.ones(4)
    assert lower_floors(heights, np.zeros((60, 4)), TIMES) == []  # in the air
    assert steps(heights, np.zeros((60, 4)), TIMES) == []
    # but feet at rest need something to stand on
    assert lower_floors(heights, STANDING, TIMES) == [(31, 45)]


@pytest.mark.parametrize(("height", "found"), [(0.05, 0), (-0.18, 1), (0.4, 0)])
def test_rests_on_a_step_are_found(height, found):
    heights = np.tile([0.0, 0.0, height, 0.3], (60, 1))
    contact = np.tile([0.95, 0.95, 0.9, 0.0], (60, 1))
    assert steps(heights, contact, TIMES) == [(0, height)] * found
