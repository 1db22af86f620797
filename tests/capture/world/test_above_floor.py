# SPDX-License-Identifier: GPL-3.0-or-later
"""Raising feet out of the floor, on motions with known ground truth; the skin is measured by full
skinning.
"""

import numpy as np
import pytest
from scope.scope_addon.capture.world.above_floor import raise_body
from scope.scope_addon.kinematics.axes import transform_points
from scope.scope_addon.kinematics.leg_reach import ARMS, move_ends
from scope.solver import rotations

from ...kinematics.posed_people import plank_person, stepping_person
from .placed_people import placed_track


@pytest.fixture(scope="module")
def step():
    return stepping_person()


def raised(person, omega, root):
    """The given motion as a track, and the result."""
    supported, T_world_camera = person[0], person[4]
    R, t = supported.forward_kinematics(omega, root - supported.rest_joints()[0])
    placed = placed_track(supported, R, t, omega)
    return placed, raise_body(placed, placed.contact(T_world_camera[2, :3]), T_world_camera)


def skin_heights(person, omega, root):
    """(T / 3, V) heights of every vertex above the floor, in every third frame."""
    supported, _, _, _, T_world_camera, _ = person
    pelvis_at_rest = supported.rest_joints()[0]
    up = T_world_camera[2, :3]
    poses = [
        supported.forward_kinematics(o, r - pelvis_at_rest)
        for o, r in zip(omega[::3], root[::3], strict=True)
    ]
    return np.stack([supported.skin(*pose) @ up for pose in poses]) + T_world_camera[2, 3]


def points_world(person, omega, root):
    return transform_points(person[4], person[3](omega, root - person[0].rest_joints()[0])[2])


def bump(times, first, last):
    """(T,) 0 outside ``first`` to ``last`` seconds, 1 in the middle, smooth."""
    return np.where(
        (times > first) & (times < last), np.sin(np.pi * (times - first) / (last - first)) ** 2, 0.0
    )


def on_the_floor(person):
    """The person's rotations, and a root with which the lowest vertex of the whole motion is on the
    floor.
    """
    omega = person[1]
    root = person[2] + person[0].rest_joints()[0]
    return omega, root - skin_heights(person, omega[:1], root[:1]).min() * person[4][2, :3]


def test_a_motion_above_the_floor_is_returned_as_it_is(step):
    placed, found = raised(step, *on_the_floor(step))
    assert found is placed


def test_a_sinking_body_is_brought_back_to_where_it_was(step):
    omega, root = on_the_floor(step)
    omega = np.repeat(omega[:1], len(root), axis=0)
    up = step[4][2, :3]
    times = step[5]
    sunk = root - 0.15 * bump(times, 0.7, 2.3)[:, None] * up
    placed, found = raised(step, omega, sunk)
    assert skin_heights(step, omega, sunk).min() < -0.14
    assert skin_heights(step, found.rotations, found.root).min() > -0.01
    assert np.abs((found.root - root) @ up).max() < 0.01
    # up, and nowhere else
    np.testing.assert_allclose(np.cross(found.root - sunk, up), 0, atol=1e-9)
    np.testing.assert_allclose(found.rotations, placed.rotations, atol=0.04)  # the pose was right


def test_a_foot_alone_is_raised_by_its_leg_and_the_other_stays(step):
    """The pelvis tilts about the standing foot, so that the other one, stretched, goes under the
    floor.
    """
    supported, _, _, _, T_world_camera, times = step
    omega, root = on_the_floor(step)
    omega = np.repeat(omega[:1], len(times), axis=0)
    root = np.repeat(root[:1], len(times), axis=0)
    R_camera_world = T_world_camera[:3, :3].T
    standing_foot = points_world(step, omega, root)[0, 2:4].mean(axis=0)
    sway = rotations.exp(0.5 * bump(times, 0.7, 2.3)[:, None] * np.array([0.0, 1.0, 0.0]))
    turn = R_camera_world @ sway @ R_camera_world.T
    pivot = transform_points(np.linalg.inv(T_world_camera), standing_foot[None])[0]
    tilted = omega.copy()
    tilted[:, 0] = turn @ omega[:, 0]
    moved = np.einsum("tij,tj->ti", turn, root - pivot) + pivot
    ankle = supported.joint_names.index("right_ankle")
    # the sole stays flat
    tilted[:, ankle] = np.einsum("tji,tjk,tkl->til", tilted[:, 0], omega[:, 0], omega[:, ankle])
    lowest = points_world(step, tilted, moved)[:, :2, 2].min()
    assert lowest < -0.03
    _, found = raised(step, tilted, moved)
    before = points_world(step, tilted, moved)
    after = points_world(step, found.rotations, found.root)
    assert after[:, :2, 2].min() > -0.01
    assert np.abs(after[:, 2:4] - before[:, 2:4]).max() < 0.02
    assert np.abs(after[:, 2:4, 2] - before[:, 2:4, 2]).max() < 0.015
    assert skin_heights(step, found.rotations, found.root).min() > -0.02


def test_a_fall_to_another_floor_is_left_alone(step):
    omega, root = on_the_floor(step)
    lower = root - np.where(step[5] > 2.0, 1.8, 0.0)[:, None] * step[4][2, :3]
    placed, found = raised(step, omega, lower)
    assert found is placed


def skin_of(person, names):
    """(V,) the vertices that move with these parts."""
    body = person[0]
    return np.isin(body.strongest_joints, [body.joint_names.index(name) for name in names])


def test_hands_under_the_floor_are_raised_by_their_arms_alone():
    """The arms of a plank, bent at first, stretch until the hands are 3 cm under the floor."""
    plank = plank_person()
    supported, omega, root, _, _, times = plank
    root = root + supported.rest_joints()[0]
    sunk = omega.copy()
    for side, sign in (("left", 1), ("right", -1)):
        elbow = supported.joint_names.index(f"{side}_elbow")
        shoulder = supported.joint_names.index(f"{side}_shoulder")
        sunk[:, elbow] = rotations.exp(np.radians([0, -sign * 20.0, 0]))
        sunk[:, shoulder] = sunk[:, shoulder] @ rotations.exp(np.radians([0, sign * 10.0, 0]))
    hands = skin_of(plank, ["left_wrist", "left_hand", "right_wrist", "right_hand"])
    lowest = skin_heights(plank, sunk[:1], root[:1])[:, hands].min()
    up = plank[4][2, :3]
    down = lowest + 0.12 * bump(times, 0.3, 1.7)
    shift = np.repeat(-down[:, None, None] * up, 2, axis=1)
    poses = supported.forward_kinematics(sunk, root - supported.rest_joints()[0])
    _, on_floor = raised(plank, sunk, root)
    sunk = move_ends(supported, ARMS, sunk, poses, shift)
    before = skin_heights(plank, sunk, root)[:, hands].min(axis=1)
    assert before.min() < -0.03
    _, found = raised(plank, sunk, root)
    after = skin_heights(plank, found.rotations, found.root)[:, hands].min(axis=1)
    assert after.min() > -0.011
    arms = [k for k, name in enumerate(supported.joint_names) if "shoulder" in name]
    arms += [k for k, name in enumerate(supported.joint_names) if name.endswith(("elbow", "wrist"))]
    others = np.setdiff1d(np.arange(supported.K + 1), arms)
    # The toes' skin is a little under the floor, and hands that move carry less.
    expected = on_floor.rotations[:, others]
    np.testing.assert_allclose(found.rotations[:, others], expected, atol=5e-3)
    np.testing.assert_allclose(found.root, on_floor.root, atol=1e-3)


def test_somebody_who_lies_is_not_pushed_under_the_floor(step):
    supported, omega, root, place, T_world_camera, times = step
    up = T_world_camera[2, :3]
    lying = omega.copy()
    lying[:, 1:] = np.eye(3)
    for side in ("left", "right"):  # The legs are in the air.
        hip = supported.joint_names.index(f"{side}_hip")
        lying[:, hip] = rotations.exp(np.radians([-60.0, 0, 0]))
    back = T_world_camera[:3, :3].T @ rotations.exp(np.radians([0, 0, 90.0]))
    lying[:, 0] = back @ rotations.exp(np.radians([0, 90.0, 0]))
    person = (supported, lying, root, place, T_world_camera, times)
    root = root + supported.rest_joints()[0]
    root = root - skin_heights(person, lying[:1], root[:1]).min() * up
    depth = 0.15 * bump(times, 0.5, 2.5)
    _, found = raised(person, lying, root - depth[:, None] * up)
    trunk = skin_of(person, ["pelvis", "spine1", "spine2", "spine3", "left_hip", "right_hip"])
    heights = skin_heights(person, found.rotations, found.root)[:, trunk].min(axis=1)
    assert heights.min() > -0.011
    still = depth < 0.005
    np.testing.assert_allclose(found.root[still], (root - depth[:, None] * up)[still], atol=0.01)
