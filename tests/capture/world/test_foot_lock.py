# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact, depth and foot locking on motions with known ground truth."""

import numpy as np
import pytest
from scope.scope_addon.capture.world import ground_plane
from scope.scope_addon.capture.world.foot_lock import LockedPoints, lock_feet, lock_points
from scope.scope_addon.capture.world.placement import PlacedTrack
from scope.scope_addon.kinematics import standing
from scope.scope_addon.kinematics.axes import transform_points, world_from_level_camera
from scope.scope_addon.kinematics.contact_points import contact_point_positions, with_contact_points
from scope.scope_addon.kinematics.smoothing import gaussian_smooth
from scope.solver import rotations
from scope.solver.loaders.body_file import load_body

FPS = 30.0
CAMERA = np.zeros(3)


def placed(supported, omega, root, times, center):
    """A motion of a body of mean shape, seen in every frame."""
    R, t = supported.forward_kinematics(omega, root - supported.rest_joints()[0])
    contact_points, seen = contact_point_positions(supported, R, t), np.ones((len(root), 6))
    betas, valid = np.zeros(supported.P), np.ones(len(root), bool)
    return PlacedTrack(supported, betas, times, valid, omega, root, t, contact_points, seen, center)


def locked(supported, omega, root, contact, T_world_camera, times):
    """Rotations and root of the motion with its feet locked, for a static camera."""
    found = lock_feet(placed(supported, omega, root, times, np.zeros((len(root), 3))), contact, T_world_camera)
    return found.rotations, found.root


@pytest.fixture(scope="module")
def step():
    """A person who shifts the weight and raises the left foot for a second, 4 m from a camera 1.5 m high."""
    body = load_body("scope")
    T = 90
    times = np.arange(T) / FPS
    T_world_camera = world_from_level_camera(np.array([0.0, -1.0, -0.2]), height=1.5)
    R_camera_world = T_world_camera[:3, :3].T
    lift = np.clip(np.sin((times - 1.0) * np.pi), 0, 1)  # 1 s to 2 s
    omega = np.tile(np.eye(3), (T, body.K + 1, 1, 1))
    names = body.joint_names
    x = np.array([1.0, 0, 0])
    omega[:, names.index("left_hip")] = rotations.exp(-0.9 * lift[:, None] * x)
    omega[:, names.index("left_knee")] = rotations.exp(1.2 * lift[:, None] * x)
    facing = rotations.exp(np.array([np.pi / 2, 0, 0]))  # model y up to world z up
    omega[:, 0] = R_camera_world @ facing
    supported = with_contact_points(body, np.zeros(body.P))

    def place(local, root):
        R, t = body.forward_kinematics(local, root)
        return R, t, contact_point_positions(supported, R, t)

    root_world = np.tile([0.0, 4.0, 0.0], (T, 1))
    lowest = place(omega, np.zeros((T, 3)))[2][:, 2:4] @ T_world_camera[2, :3]
    root_world[:, 2] = -lowest.min(1)
    root = transform_points(np.linalg.inv(T_world_camera), root_world)
    return supported, omega, root, place, T_world_camera, times


def test_a_raised_foot_is_told_from_one_in_contact(step):
    _, omega, root, place, T_world_camera, times = step
    p = standing.resting_probability(place(omega, root)[2], T_world_camera[2, :3], times, CAMERA)
    assert (p[:, 2:4] > 0.8).all()  # right
    assert (p[:, 4:] < 0.01).all()  # hands
    assert (p[:20, :2] > 0.8).all()
    assert (p[36:54, :2] < 0.3).all()
    assert (p[75:, :2] > 0.8).all()


def test_a_foot_at_rest_at_a_wrong_depth_is_in_contact_and_a_raised_one_is_not(step):
    """A foot estimated too near or too far along its line of sight seems to be above or below the floor."""
    _, omega, root, place, T_world_camera, times = step
    up = T_world_camera[2, :3]
    soles = place(omega[:1], root[:1])[2][:, :4].repeat(len(times), axis=0)
    sight = soles[:, :2] / np.linalg.norm(soles[:, :2], axis=-1, keepdims=True)
    far = soles.copy()
    far[:, :2] -= 0.35 * sight  # the left one: nearer to the camera, so higher
    higher = ((far[:, :2] - soles[:, :2]) @ up).mean()
    assert higher > 0.1
    assert (standing.standing_probability(far, up, times, CAMERA)[:, :2] > 0.5).all()
    assert (standing.standing_probability(far, up, times)[:, :2] < 0.1).all()  # nobody knows where the sight is

    raised = soles.copy()
    raised[:, :2] += 0.35 * up
    assert (standing.standing_probability(raised, up, times, CAMERA)[:, :2] < 0.1).all()

    moving = far.copy()
    moving[:, :2, 0] += 0.06 * np.sin(2 * np.pi * times)[:, None]  # up to 0.38 m/s, and slow where it turns round
    assert (standing.standing_probability(moving, up, times, CAMERA)[:, :2] < 0.3).all()
    at = np.array([2.0, -1.0, 3.0])
    for center in (at, np.tile(at, (len(times), 1))):
        elsewhere = standing.standing_probability(far + at, up, times, center)
        np.testing.assert_allclose(elsewhere, standing.standing_probability(far, up, times, CAMERA), atol=1e-9)


def test_a_wrong_depth_is_corrected_by_the_floor(step):
    _, omega, root, place, T_world_camera, times = step
    unit = root / np.linalg.norm(root, axis=1, keepdims=True)
    wrong = 0.15 * np.sin(2 * np.pi * 0.4 * times)
    seen = place(omega, root + wrong[:, None] * unit)[2]
    contact = standing.resting_probability(seen, T_world_camera[2, :3], times, CAMERA)
    away = ground_plane.correct_depth(root + wrong[:, None] * unit, seen, contact, T_world_camera, times)
    assert np.abs(away + wrong).mean() < 0.25 * np.abs(wrong).mean()
    left = np.diff(wrong + away)[:28]  # while both feet stand
    assert np.abs(left).max() < 0.1 * np.abs(np.diff(wrong)).max()  # and what is left hardly slides


def test_a_right_depth_is_not_changed(step):
    _, omega, root, place, T_world_camera, times = step
    soles = place(omega, root)[2]
    contact = standing.resting_probability(soles, T_world_camera[2, :3], times, CAMERA)
    assert np.abs(ground_plane.correct_depth(root, soles, contact, T_world_camera, times)).max() < 0.05


def test_the_depth_system_is_solved_as_a_dense_one():
    rng = np.random.default_rng(0)
    off = rng.normal(size=30)
    diagonal = 3 + np.abs(np.r_[off, 0]) + np.abs(np.r_[0, off])
    right = rng.normal(size=31)
    dense = np.diag(diagonal) + np.diag(off, 1) + np.diag(off, -1)
    assert np.allclose(ground_plane._solve_tridiagonal(diagonal, off, right), np.linalg.solve(dense, right))


def test_the_feet_of_a_trembling_motion_are_at_rest_in_contact(step):
    supported, omega, root, place, T_world_camera, times = step
    rng = np.random.default_rng(1)
    noise = gaussian_smooth(rng.normal(size=(len(times), supported.K + 1, 3)), times, 4.5)
    shaken = omega @ rotations.exp(0.06 * noise)
    # across the line of sight, the picture tells better than 3 mm where somebody is
    sight = standing.line_of_sight(root)
    trembling = gaussian_smooth(rng.normal(size=root.shape), times, 4.5)
    shaken_root = root + 0.003 * trembling + 0.02 * trembling[:, :1] * sight
    contact = standing.resting_probability(place(omega, root)[2], T_world_camera[2, :3], times, CAMERA)
    local, moved = locked(supported, shaken, shaken_root, contact, T_world_camera, times)
    before, after = (
        transform_points(T_world_camera, place(*m)[2][:, 2]) for m in ((shaken, shaken_root), (local, moved))
    )
    assert after.std(0).max() < 0.4 * before.std(0).max()
    assert np.abs(after[:, 2]).max() < 0.015  # on the floor
    assert np.abs(place(local, moved)[1] - place(shaken, shaken_root)[1]).max() < 0.2  # nobody was thrown about


@pytest.mark.parametrize("turned", [0.0, 0.6, 2.5])
def test_projections_stay_when_feet_are_locked_elsewhere(step, turned):
    """For any direction and position of the camera: legs and distance change, the projections do not."""
    supported, omega, root, place, T_world_camera, _ = step
    R, center = rotations.exp(np.array([0.0, turned, 0.0])), np.array([1.0, -0.2, 0.5])
    omega, root = omega[:3].copy(), root[:3] @ R.T + center
    omega[:, 0] = R @ omega[:, 0]
    up, soles = R @ T_world_camera[2, :3], place(omega, root)[2]
    for away in (-0.03, 0.03):
        held = soles + away * up
        weights = np.tile([0.9, 0.9, 0.9, 0.9, 0.0, 0.0], (len(root), 1))
        targets = LockedPoints(held, weights, up, np.full(len(root), float((held @ up).min())))
        times, centers = np.arange(len(root)) / FPS, np.tile(center, (len(root), 1))
        local, moved = lock_points(placed(supported, omega, root, times, centers), targets)
        for joint in ("head", "left_wrist", "right_hip"):
            j = supported.joint_names.index(joint)
            was, now = ((place(*m)[1][:, j] - center) @ R for m in ((omega, root), (local, moved)))
            shift = now[:, :2] / now[:, 2:] - was[:, :2] / was[:, 2:]
            assert np.abs(shift).max() < 0.006 / 4, joint
        assert np.abs((place(local, moved)[2] - held)[:, :4] @ up).max() < 0.022


@pytest.mark.parametrize("level", [-1.8, -0.5, 0.6])
def test_feet_on_another_level_are_not_moved_to_the_floor(step, level):
    """The person stands on the floor, then, for the second half, on a wall or in a pit."""
    supported, omega, root, place, T_world_camera, times = step
    up = T_world_camera[2, :3]
    other = root + np.where(times > 1.5, level, 0.0)[:, None] * up
    soles = place(omega, other)[2]
    contact = standing.resting_probability(soles, up, times, CAMERA)
    local, moved = locked(supported, omega, other, contact, T_world_camera, times)
    after = transform_points(T_world_camera, place(local, moved)[2])
    before = transform_points(T_world_camera, soles)
    assert np.abs(after[:, 2:, 2] - before[:, 2:, 2]).max() < 0.06
    assert np.abs(after[60:, 2, 2] - level).max() < 0.06
    assert np.abs(after[:30, 2, 2]).max() < 0.03


def test_a_still_and_a_single_frame_pass(step):
    supported, omega, root, place, T_world_camera, times = step
    contact = standing.resting_probability(place(omega[:1], root[:1])[2], T_world_camera[2, :3], times[:1], CAMERA)
    local, moved = locked(supported, omega[:1], root[:1], contact, T_world_camera, times[:1])
    assert np.allclose(place(local, moved)[2][0, 2:4] @ T_world_camera[2, :3] + 1.5, 0, atol=0.02)


@pytest.fixture(scope="module")
def plank():
    """A person on toes and palms for two seconds, seen from the side, 4 m from a camera 1.5 m high."""
    body = load_body("scope")
    supported, times = with_contact_points(body, np.zeros(body.P)), np.arange(60) / FPS
    T_world_camera = world_from_level_camera(np.array([0.0, -1.0, -0.2]), height=1.5)
    omega = np.tile(np.eye(3), (body.K + 1, 1, 1))
    for side, sign in (("left", 1), ("right", -1)):
        omega[body.joint_names.index(f"{side}_shoulder")] = rotations.exp([0, -sign * np.pi / 2, 0])
        omega[body.joint_names.index(f"{side}_wrist")] = rotations.exp([0, 0, sign * np.pi / 2])
        omega[body.joint_names.index(f"{side}_ankle")] = rotations.exp([0.5, 0, 0])
    down = rotations.exp(np.array([np.pi / 2, 0, 0])) @ rotations.exp(np.array([np.pi / 2, 0, 0]))  # model z down

    def place(local, root):
        R, t = body.forward_kinematics(local, root)
        return R, t, contact_point_positions(supported, R, t)

    pitch = 0.0
    for _ in range(30):  # until toes and palms are level
        omega[0] = rotations.exp(np.array([0, 0, np.pi / 2])) @ rotations.exp(np.array([pitch, 0, 0])) @ down
        points = place(omega[None], np.zeros((1, 3)))[2][0]
        toes, palms = points[[1, 3]].mean(0), points[4:].mean(0)
        pitch += 0.5 * (palms - toes)[2] / np.linalg.norm(palms - toes)
    assert abs((palms - toes)[2]) < 1e-3
    root = np.array([0.0, 4.0, -toes[2]]) - [*points.mean(0)[:2], 0.0]
    camera = np.linalg.inv(T_world_camera)
    root = transform_points(camera, root[None])[0]
    omega[0] = camera[:3, :3] @ omega[0]
    omega, root = (np.repeat(each[None], len(times), axis=0) for each in (omega, root))
    return supported, omega, root, place, T_world_camera, times


def test_palms_at_rest_on_the_floor_are_in_contact(plank):
    _, omega, root, place, T_world_camera, times = plank
    up, contact_points = T_world_camera[2, :3], place(omega, root)[2]
    p = standing.resting_probability(contact_points, up, times, CAMERA)
    assert p[:, [1, 3, 4, 5]].min() > 0.8  # toes and palms
    raised, moved = contact_points.copy(), contact_points.copy()
    raised[:, 4] += 0.4 * up
    moved[:, 4, 1] += 0.3 * np.sin(2 * np.pi * times)
    for other in (raised, moved):
        p = standing.resting_probability(other, up, times, CAMERA)
        assert np.median(p[:, 4]) < 0.1
        assert p[:, 5].min() > 0.8


def test_feet_at_rest_above_the_hands_are_not_in_contact(plank):
    _, omega, root, place, T_world_camera, times = plank
    up, contact_points = T_world_camera[2, :3], place(omega, root)[2]
    contact_points[:, :4] += 1.5 * up
    p = standing.resting_probability(contact_points, up, times, CAMERA)
    assert p[:, :4].max() < 0.05
    assert p[:, 4:].min() > 0.8


def test_trembling_palms_are_locked_on_the_floor(plank):
    supported, omega, root, place, T_world_camera, times = plank
    rng = np.random.default_rng(2)
    noise = gaussian_smooth(rng.normal(size=(len(times), supported.K + 1, 3)), times, 4.5)
    shaken = omega @ rotations.exp(0.06 * noise)
    contact = standing.resting_probability(place(omega, root)[2], T_world_camera[2, :3], times, CAMERA)
    local, moved = locked(supported, shaken, root, contact, T_world_camera, times)
    before, after = (transform_points(T_world_camera, place(*m)[2][:, 4:]) for m in ((shaken, root), (local, moved)))
    assert after.std(0).max() < 0.4 * before.std(0).max()
    assert np.abs(after[..., 2]).max() < 0.03
