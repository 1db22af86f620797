# SPDX-License-Identifier: GPL-3.0-or-later
"""Up direction and floor from bodies placed in a known world."""

from dataclasses import replace

import numpy as np
import pytest
from scope.scope_addon.capture.world.world_frame import (
    _first_contact,
    find_world,
    floor_height,
    up_from_bodies,
    up_from_floor,
    up_from_standing,
)
from scope.scope_addon.kinematics.axes import (
    R_WORLD_MODEL,
    transform_points,
    world_from_level_camera,
)
from scope.scope_addon.kinematics.contact_points import contact_point_positions, with_contact_points
from scope.solver import rotations
from scope.solver.body_file import load_body

from .placed_people import UP, bent, first_frame, placed_track


def walk(body, T=60, lean_deg=0.0):
    """A stiff walk through the world: root positions along x, legs swinging; returns part poses in
    the world.
    """
    omega = np.tile(np.eye(3), (T, body.K + 1, 1, 1))
    swing = 0.35 * np.sin(np.linspace(0, 6 * np.pi, T))
    x = np.array([1.0, 0, 0])
    for side, sign in (("left", 1), ("right", -1)):
        omega[:, body.joint_names.index(f"{side}_hip")] = rotations.exp(sign * swing[:, None] * x)
    omega[:, 0] = R_WORLD_MODEL @ rotations.exp(np.radians(lean_deg) * x)
    R, t = body.forward_kinematics(omega, np.zeros((T, 3)))
    soles = contact_point_positions(with_contact_points(body, np.zeros(body.P)), R, t)
    root = np.stack([np.linspace(-1, 1, T), np.linspace(0, 1.5, T), -soles[..., 2].min(1)], axis=1)
    return R, t + root[:, None]


def seen_by(body, R, t, up=UP, height_m=1.6, ahead_m=5.0):
    """The motion of part poses in a world, as a camera sees it from so far before its origin."""
    camera_from_world = np.linalg.inv(world_from_level_camera(up, height_m))
    joints = transform_points(camera_from_world, t + [0.0, ahead_m, 0.0])
    return placed_track(body, camera_from_world[:3, :3] @ R, joints)


def tilted_up(*degrees):
    return rotations.exp(np.radians(degrees)) @ UP


def angle_deg(a, b):
    return np.degrees(np.arccos(np.clip(a @ b, -1, 1)))


@pytest.mark.parametrize(("pitch_deg", "roll_deg"), [(-20.0, 0.0), (0.0, 8.0), (15.0, 8.0)])
def test_up_and_floor_are_recovered_from_a_walk(pitch_deg, roll_deg):
    body = load_body("scope")
    up = tilted_up(pitch_deg, 0, roll_deg)
    placed = seen_by(body, *walk(body), up)
    got = find_world([placed]).T_world_camera
    angle = angle_deg(got[2, :3], up)
    assert angle < 2.0
    # The person is up to 6.5 m away: the camera's height above the floor is as uncertain as the
    # angle makes it.
    assert abs(got[2, 3] - 1.6) < 0.01 + 6.5 * np.sin(np.radians(angle))
    assert abs(np.median(transform_points(got, placed.soles)[..., 2].min(1))) < 0.01
    assert np.allclose(transform_points(got, placed.joints[:1, 0])[0, :2], 0)


def test_a_person_who_jumps_for_most_of_a_clip_stands_on_the_floor_in_between():
    """Jumps of half a second, 0.3 m high, and a fifth of a second on the floor after each."""
    body = load_body("scope")
    R, t = (np.repeat(each[:1], 84, axis=0) for each in walk(body))
    since = np.arange(84) % 21 / 30
    t[..., 2] += np.where(since < 0.5, 4.9 * since * (0.5 - since), 0.0)[:, None]
    placed = seen_by(body, R, t)
    lowest = transform_points(find_world([placed]).T_world_camera, placed.soles)[..., 2].min(axis=1)
    assert abs(lowest.min()) < 0.01
    assert np.median(lowest) > 0.1


def test_people_share_a_world_and_each_has_a_floor():
    """One person seen from the tenth frame on, one who walks 1 m higher, one who seems to be 4 %
    farther away.
    """
    body = load_body("scope")
    R, t = walk(body)
    up = tilted_up(-12.0, 0, 5.0)
    walker, climber = (seen_by(body, R, t + [0.0, 0.0, z], up) for z in (0.0, 1.0))
    farther = replace(
        walker, joints=1.04 * walker.joints, contact_points=1.04 * walker.contact_points
    )
    valid = np.arange(len(t)) >= 10
    points = np.where(valid[:, None, None], walker.contact_points, walker.contact_points[10])
    walker = replace(walker, valid=valid, contact_points=points)
    world = find_world([walker, climber, farther])
    assert angle_deg(world.up, up) < 2.0
    assert abs(world.T_world_camera[2, 3] - 1.6) < 0.25
    np.testing.assert_allclose(
        transform_points(world.T_world_camera, walker.joints[10, :1])[0, :2], 0, atol=1e-9
    )
    assert world.floors_m[0] == world.floors_m[2] == 0.0
    assert abs(world.floors_m[1] - 1.0) < 0.1
    soles = transform_points(world.floor_from_camera(1), climber.soles)[..., 2].min(axis=1)
    assert abs(np.median(soles)) < 0.02


def test_in_a_still_image_nobody_is_moved_to_the_floor_of_others():
    """Somebody who seems to be 4 % farther away, and so stands lower: a clip's fit changes the
    distance, an image's does not.
    """
    body = load_body("scope")
    near = first_frame(seen_by(body, *walk(body)))
    far = replace(near, joints=1.04 * near.joints, contact_points=1.04 * near.contact_points)
    floors_m = find_world([near, far]).floors_m
    assert floors_m == [0.0, pytest.approx(-0.04 * 1.6, abs=0.01)]


def centroid(vertices, faces):
    """Centroid of the volume within a closed surface, by tetrahedra from the origin."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    return (volume[:, None] * (a + b + c)).sum(0) / (4 * volume.sum())


@pytest.mark.parametrize("pitch_deg", [-25.0, 20.0])
def test_up_of_a_person_who_bends_follows_from_the_centre_of_mass(pitch_deg):
    """Knees and hips bent, no axis of the body upright, and the mesh's centre of volume above the
    soles.
    """
    body = load_body("scope")
    omega = bent(body, {"hip": -80.0, "knee": 50.0})
    omega[0] = R_WORLD_MODEL
    soled = with_contact_points(body, np.zeros(body.P))
    for _ in range(30):
        R, t = body.forward_kinematics(omega, np.zeros(3))
        soles = contact_point_positions(soled, R[None], t[None])[0, :4]
        off = centroid(body.skin(R, t), body.triangles()) - soles.mean(axis=0)
        omega[0] = rotations.exp([0.5 * off[1] / off[2], -0.5 * off[0] / off[2], 0]) @ omega[0]
    assert np.hypot(off[0], off[1]) < 0.005
    R, t = (np.repeat(each[None], 60, axis=0) for each in (R, t - [0.0, 0.0, soles[:, 2].min()]))
    up = tilted_up(pitch_deg, 0, 0)
    placed = seen_by(body, R, t, up, ahead_m=4.0)
    assert angle_deg(up_from_standing([placed]), up) > 10.0
    assert angle_deg(up_from_bodies([placed]), up) < 8.0


@pytest.mark.parametrize(
    "bends", [{"hip": -85.0, "knee": 85.0}, {"knee": 90.0, "ankle": 50.0}], ids=["sits", "kneels"]
)
@pytest.mark.parametrize("turned_deg", [0.0, 90.0])
def test_people_who_sit_or_kneel_do_not_tilt_the_world(bends, turned_deg):
    """Their feet are at rest as well, but the weight is on a chair or the shins; up follows from
    the upright trunk.
    """
    body = load_body("scope")
    omega = bent(body, bends)
    omega[0] = rotations.exp(np.radians([0, 0, turned_deg])) @ R_WORLD_MODEL
    poses = body.forward_kinematics(np.tile(omega, (60, 1, 1, 1)), np.zeros((60, 3)))
    placed = seen_by(body, *poses, ahead_m=4.0)
    assert angle_deg(find_world([placed]).up, UP) < 2.0


def test_a_single_moment_does_not_use_the_centre_of_mass():
    """A runner's centre of mass is not above the feet in one frame; over a clip, inertial forces
    average out.
    """
    body = load_body("scope")
    placed = seen_by(body, *walk(body, lean_deg=12.0))
    one = first_frame(placed)
    np.testing.assert_allclose(up_from_bodies([one]), up_from_standing([one]), atol=1e-9)
    assert np.abs(up_from_bodies([placed]) - up_from_standing([placed])).max() > 1e-3


@pytest.mark.parametrize("standing", [0, 20])
def test_people_lying_on_the_floor_do_not_tilt_the_world(standing):
    """A person lies straight for 60 frames and then stands, or not; the camera is 10 degrees from
    level.
    """
    body = load_body("scope")
    R, t = walk(body, T=60 + standing)
    up = tilted_up(10.0, 0, 0)
    fallen = rotations.exp(np.radians([0, -85.0, 0]))
    R[:60] = fallen @ R[:60]
    t[:60] = t[:60] @ fallen.T
    # with nothing else to go by, cameras are taken for level
    assert angle_deg(up_from_standing([seen_by(body, R, t, up)]), up) < (5 if standing else 12)


@pytest.mark.parametrize("turned_deg", [180.0, 100.0])
def test_the_floor_is_under_the_hands_of_somebody_whose_feet_are_above_them(turned_deg):
    """In a handstand, and in push-ups with the feet on a box, with straight arms."""
    body = load_body("scope")
    omega = np.tile(np.eye(3), (60, body.K + 1, 1, 1))
    for side, sign in (("left", 1), ("right", -1)):
        shoulder = body.joint_names.index(f"{side}_shoulder")
        # Along the trunk in a handstand, and across it in push-ups.
        to_head = np.radians([0, 0, sign * 85.0])
        omega[:, shoulder] = rotations.exp(
            to_head if turned_deg > 150 else np.radians([0, -sign * 90.0, 0])
        )
    omega[:, 0] = rotations.exp(np.radians([0, turned_deg, 0])) @ R_WORLD_MODEL
    if turned_deg < 150:  # The chest looks down.
        omega[:, 0] = omega[:, 0] @ rotations.exp(np.radians([0, 90.0, 0]))
    R, t = body.forward_kinematics(omega, np.zeros((60, 3)))
    skin = body.skin(R[0], t[0])
    t = t - [0.0, 0.0, skin[:, 2].min()]
    feet = [body.joint_names.index(f"{side}_ankle") for side in ("left", "right")]
    hands = [body.joint_names.index(f"{side}_hand") for side in ("left", "right")]
    assert (t[0, feet, 2] > t[0, hands, 2] + 0.2).all()
    found = find_world([seen_by(body, R, t, height_m=1.2, ahead_m=4.0)])
    # The distance from the hands' joints to their skin depends on which way they point.
    assert found.T_world_camera[2, 3] == pytest.approx(1.2, abs=0.07)


def test_up_is_normal_to_a_floor_on_which_feet_are_spread_wherever_it_lies():
    """Soles all over 3 m by 3 m, four metres away: of an error of up, σ² / (σ² + 0.75 m²) = 0.3 is
    left.

    σ = 0.05 m / 5° = 0.57 m is how far the floor's scatter has to lie for the error of up to be as
    large.
    """
    rng = np.random.default_rng(0)
    up = rotations.exp([0.02, 0.0, -0.015]) @ UP
    across = np.stack([np.cross(up, [0.0, 0.0, 1.0]), np.cross(up, [1.0, 0.0, 0.0])])
    lower = (
        np.array([0.5, 1.4, 4.0])
        + rng.uniform(-1.5, 1.5, (200, 2)) @ across
        + rng.normal(size=(200, 3)) * 0.005
    )
    feet_cam = np.stack([lower, lower + 0.1 * up], axis=1)  # the other foot is in the air
    found = up_from_floor(feet_cam, UP)
    assert np.arccos(found @ up) == pytest.approx(0.3 * np.arccos(-up[1]), rel=0.15)


@pytest.mark.parametrize(("rate", "minutes"), [(30.0, 30.0), (1.0, 1.0)])
def test_the_floor_of_uneven_ground_is_where_somebody_stands_at_first(rate, minutes):
    """A slow descent, in a long clip and at one frame a second; the height of the whole clip would
    be far below.
    """
    times = np.arange(round(60 * minutes * rate)) / rate
    contact = np.full((len(times), 4), 0.9)
    contact[:2] = 0.0
    soles = np.zeros((len(times), 4, 3))
    soles[..., 1] = 1.5 + 0.01 * times[:, None]
    rows = _first_contact(contact, times)
    assert rows.any()
    assert floor_height(soles[rows], contact[rows], UP) == pytest.approx(-1.5, abs=0.04)


def test_without_contact_every_frame_counts():
    times = np.arange(60) / 30
    assert _first_contact(np.zeros((60, 4)), times).all()
    assert _first_contact(np.ones((1, 4)), times[:1]).all()
