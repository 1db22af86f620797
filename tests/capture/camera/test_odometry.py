# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera's travel and zoom from corners of a street at known places, as exact
cameras see them.
"""

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.camera.bundle_adjustment import Bundle, adjust, refine_pose
from scope.scope_addon.capture.camera.corner_tracks import (
    SAMPLES_HZ,
    CornerFollower,
    CornerTracks,
    corners_at_rest,
    joined_corners,
)
from scope.scope_addon.capture.camera.intrinsics import Camera, pinhole
from scope.scope_addon.capture.camera.odometry import travel_of
from scope.scope_addon.capture.camera.zoom import find_zoom, focal_by_turns
from scope.solver.rotations import exp, log

WIDTH, HEIGHT = 1280, 720
FOCAL_PX = 1100.0
T = 60
TIMES = np.arange(T) / 12.0
NOISE_PX = 0.3
SHAKE = 0.01 * np.stack([np.sin(7 * TIMES), np.cos(9 * TIMES), np.sin(5 * TIMES)], axis=1)


def street(n=55):
    """Corners of a floor 1.5 m below the camera, two walls 4 m beside it, and one far ahead."""
    rng = np.random.default_rng(0)
    z = rng.uniform(2, 45, 3 * n)
    x = np.concatenate([rng.uniform(-4, 4, n), np.full(n, -4.0), np.full(n, 4.0)])
    y = np.concatenate([np.full(n, 1.5), rng.uniform(-5, 1.5, 2 * n)])
    ahead = np.stack([rng.uniform(-4, 4, n), rng.uniform(-5, 1.5, n), np.full(n, 45.0)], axis=1)
    return np.concatenate([np.stack([x, y, z], axis=1), ahead])


STREET = street()
STILL = np.tile(np.eye(3), (T, 1, 1))
AT_ORIGIN = np.zeros((T, 3))


def turning(rad_s):
    """Return the rotations (T, 3, 3) of a camera that turns to the side, and shakes."""
    R = exp(TIMES[:, None] * [0.0, rad_s, 0.0] + SHAKE)
    return R[0].T @ R


def seen(R, center=AT_ORIGIN, focal_px=FOCAL_PX, outliers=0.0, places=STREET):
    """Return the tracks of corners (C, 3) in T frames, some of which move on their own."""
    rng = np.random.default_rng(1)
    focal = np.broadcast_to(focal_px, T)
    walks = rng.random(len(places)) < outliers
    rows, numbers, points = [], [], []
    for k in range(T):
        moved = places + walks[:, None] * [1.2 * TIMES[k], 0.0, 0.0]
        p = (moved - center[k]) @ R[k]
        px = p[:, :2] / p[:, 2:] * focal[k] + [WIDTH / 2, HEIGHT / 2]
        inside = (p[:, 2] > 0.5) & (px >= 0).all(axis=1) & (px < [WIDTH, HEIGHT]).all(axis=1)
        found = np.flatnonzero(inside)
        rows.append(np.full(len(found), k))
        numbers.append(found)
        points.append(px[found] + NOISE_PX * rng.standard_normal((len(found), 2)))
    return CornerTracks(
        np.concatenate(rows), np.concatenate(numbers), np.concatenate(points).astype(np.float32)
    )


def camera(focal_px=FOCAL_PX):
    return Camera(pinhole(WIDTH, HEIGHT, focal_px), np.zeros(5), "given")


def only(corners, chosen, first_row=0):
    """Return some of the sightings of corners, those for which ``chosen`` (n,) is True."""
    rows = corners.rows[chosen] - first_row
    return CornerTracks(rows, corners.numbers[chosen], corners.points_px[chosen])


def aligned(center, true):
    """The path, scaled to the true one; its axes are those of the first frame already."""
    return center * ((center * true).sum() / (center**2).sum())


def largest_turn_deg(R, R_true):
    return np.degrees(np.linalg.norm(log(np.swapaxes(R_true, 1, 2) @ R), axis=1)).max()


@pytest.mark.parametrize("velocity", [(0.0, 0.0, -1.3), (0.5, -0.25, 0.5)])
def test_a_camera_that_travels_through_a_street(velocity):
    """Also where one corner in ten is a passer-by, and the rotation was not known before."""
    R = turning(0.0)
    center = TIMES[:, None] * np.array(velocity) + 0.5 * SHAKE
    center -= center[0]
    corners = seen(R, center, outliers=0.1)
    found = travel_of(corners, STILL, TIMES, camera(), WIDTH)
    assert found.travels
    assert (found.part == 0).all()
    off = np.linalg.norm(aligned(found.center, center) - center, axis=1)
    length = np.linalg.norm(np.diff(center, axis=0), axis=1).sum()
    assert np.sqrt((off**2).mean()) < 0.02 * length
    assert largest_turn_deg(found.R_first_camera, R) < 0.5


def test_a_camera_that_pans_does_not_travel():
    """Also where the assumed focal length is wrong."""
    R = turning(0.12)
    found = travel_of(seen(R), R, TIMES, camera(1.25 * FOCAL_PX), WIDTH)
    assert not found.travels
    np.testing.assert_array_equal(found.R_first_camera, R)


@pytest.mark.parametrize(
    ("assumed", "turn", "largest"), [(0.8, 0.04, 2.0), (1.25, 0.04, 0.6), (1.0, 0.0, 2.0)]
)
def test_a_lens_that_zooms_while_the_camera_turns(assumed, turn, largest):
    """Also where the assumed focal length is wrong, and one corner in ten is a passer-by."""
    R = turning(turn)
    factors = largest ** (np.clip(TIMES - 1, 0, 3) / 3)
    corners = seen(R, focal_px=FOCAL_PX * factors, outliers=0.1)
    zoom = find_zoom(corners, TIMES, camera(assumed * FOCAL_PX), WIDTH)
    np.testing.assert_allclose(zoom.factors, factors, rtol=0.01)
    assert zoom.is_certain
    if assumed == 1.0:
        assert largest_turn_deg(zoom.R_first_camera, R) < 1.0


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (0.0, 0.0, 1.3), (1.2, 0.0, 0.3)])
def test_a_camera_that_travels_or_pans_does_not_zoom(velocity):
    corners = seen(turning(0.12), TIMES[:, None] * np.array(velocity), outliers=0.1)
    assert find_zoom(corners, TIMES, camera(), WIDTH) is None


def test_a_lens_that_zooms_before_the_camera_travels():
    """The zoom is known, and that the two may be confused."""
    factors = 1.5 ** np.clip(TIMES, 0, 1.5)
    center = np.clip(TIMES - 2.0, 0, None)[:, None] * [0.0, 0.0, -1.3]
    zoom = find_zoom(seen(STILL, center, FOCAL_PX * factors), TIMES, camera(), WIDTH)
    assert not zoom.is_certain
    np.testing.assert_allclose(zoom.factors, factors, rtol=0.05)


def test_a_zoom_after_a_pause_begins_when_it_does():
    """Corners are kept only where they move."""
    factors = 1.0 + np.clip(TIMES - 3.0, 0, 1)
    corners = seen(STILL, focal_px=FOCAL_PX * factors)
    kept = only(corners, (corners.rows == 0) | (TIMES[corners.rows] > 3.05))
    zoom = find_zoom(kept, TIMES, camera(), WIDTH)
    np.testing.assert_allclose(zoom.factors, factors, rtol=0.01)


def test_maps_without_common_corners_are_one_by_the_frames_that_both_place():
    """All corners are lost, and others are followed, which are farther away: the few frames that
    have both do not tell where these are.
    """
    center = TIMES[:, None] * [0.5, 0.0, -0.5]
    whole = seen(STILL, center)
    first = only(whole, whole.rows < 34)
    second = only(whole, (whole.rows >= 30) & (STREET[whole.numbers, 2] > 12.0), 30)
    corners = joined_corners([first, second.shifted(30, first.count)])
    assert corners.count == first.count + second.count
    found = travel_of(corners, STILL, TIMES, camera(), WIDTH)
    assert (found.part == 0).all()
    off = np.linalg.norm(aligned(found.center, center) - center, axis=1)
    assert off.max() < 0.04 * np.linalg.norm(center[-1])


def test_an_adjusted_bundle_is_the_true_one():
    rng = np.random.default_rng(4)
    frames, corners = 8, 60
    R = exp(0.1 * rng.standard_normal((frames, 3)))
    t = 0.5 * rng.standard_normal((frames, 3))
    places = rng.uniform([-3, -2, 5], [3, 2, 12], (corners, 3))
    frame, corner = (grid.ravel() for grid in np.mgrid[:frames, :corners])
    exact = Bundle(R, t, places, frame, corner, np.zeros((len(frame), 2)))
    rays = exact.residuals()
    moved_R = R.copy()
    moved_R[2:] = exp(0.01 * rng.standard_normal((frames - 2, 3))) @ R[2:]
    moved_t = t.copy()
    moved_t[2:] += 0.03 * rng.standard_normal((frames - 2, 3))
    near = places + 0.05 * rng.standard_normal(places.shape)
    found = adjust(Bundle(moved_R, moved_t, near, frame, corner, rays), 2, 0.01)
    assert np.abs(found.residuals()).max() < 1e-4
    np.testing.assert_allclose(found.t, t, atol=2e-3)
    found_R, found_t = refine_pose(places, rays[frame == 5], moved_R[5], moved_t[5], 0.01)
    np.testing.assert_allclose(found_R, R[5], atol=1e-6)
    np.testing.assert_allclose(found_t, t[5], atol=1e-6)


def test_corners_are_at_rest_for_a_camera_that_only_shakes():
    """Also where one in ten is a passer-by."""
    R = exp(2 * SHAKE)
    R = R[0].T @ R
    found = corners_at_rest(seen(R, outliers=0.1), R, camera(), 0.004)
    assert len(found) > 50
    directions = STREET @ R[0]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    nearest = (found @ directions.T).max(axis=1)
    assert np.degrees(np.arccos(np.clip(nearest, -1, 1))).max() < 0.1


def test_corners_are_not_at_rest_for_a_camera_that_travels():
    corners = seen(STILL, TIMES[:, None] * [0.0, 0.0, -0.5] + SHAKE)
    assert not len(corners_at_rest(corners, STILL, camera(), 0.004))
    assert not len(corners_at_rest(CornerTracks.none(), STILL, camera(), 0.004))


@pytest.mark.parametrize("black", [0, 12])
def test_corners_are_followed_again_after_a_black_frame(black):
    rng = np.random.default_rng(0)
    wall = cv2.resize(rng.integers(0, 255, (30, 70), np.uint8), (840, 360))
    follower = CornerFollower()
    for k in range(24):
        picture = wall[:270, 12 * k : 12 * k + 480] * np.uint8(k != black)
        follower.add(k, k / SAMPLES_HZ, picture, [], is_cut=False)
    seen_in = np.unique(follower.tracks(lambda points: points).rows)
    assert seen_in.tolist() == [k for k in range(24) if k != black]


def around(n=700):
    """Corners on all sides of the camera, not far above or below it, 3 to 30 m away."""
    rng = np.random.default_rng(2)
    angle = rng.uniform(-np.pi, np.pi, n)
    level = np.stack([np.sin(angle), rng.uniform(-0.4, 0.4, n), np.cos(angle)], axis=1)
    return rng.uniform(3, 30, n)[:, None] * level


AROUND = around()


def assumed(ratio):
    """The lens that is assumed where the true focal length is so many times as long."""
    return Camera(pinhole(WIDTH, HEIGHT, FOCAL_PX / ratio), np.zeros(5), "assumed")


@pytest.mark.parametrize("ratio", [0.7, 1.0, 1.5, 2.0])
def test_a_camera_that_turns_shows_its_focal_length(ratio):
    """With corners that are off by 0.3 pixels, and some that move on their own."""
    tracks = seen(turning(0.25), outliers=0.1, places=AROUND)
    found = focal_by_turns(tracks, TIMES, assumed(ratio), WIDTH)
    assert abs(np.log(found.ratio / ratio)) < 0.08
    assert found.deviation < 0.1


def test_where_all_corners_are_lost_the_rotation_of_a_turning_camera_is_unknown():
    tracks = seen(turning(0.25), places=AROUND)
    others = CornerTracks(
        tracks.rows, tracks.numbers + len(AROUND) * (tracks.rows >= 30), tracks.points_px
    )
    found = focal_by_turns(others, TIMES, assumed(1.0), WIDTH)
    assert np.flatnonzero(~found.known).tolist() == [30]
    R = turning(0.25)
    for rows in (slice(0, 30), slice(30, T)):
        kept = found.R_first_camera[rows]
        since = np.swapaxes(kept[:1], 1, 2) @ kept
        assert largest_turn_deg(since, np.swapaxes(R[rows][:1], 1, 2) @ R[rows]) < 2.0


def test_a_picture_that_slides_as_no_turn_moves_it_shows_none():
    """As of a crop that follows somebody through the picture of a camera that stands still."""
    still = seen(STILL, places=AROUND)
    slid = CornerTracks(
        still.rows,
        still.numbers,
        (still.points_px + 20.0 * still.rows[:, None] * [1.0, 0.0]).astype(np.float32),
    )
    assert focal_by_turns(slid, TIMES, assumed(1.0), WIDTH) is None


@pytest.mark.parametrize(
    ("rad_s", "speed"),
    [(0.004, [0.0, 0.0, 0.0]), (0.25, [0.0, 0.0, 1.2]), (0.25, [0.8, 0.0, 0.0])],
    ids=["small turns", "walks ahead", "walks sideways"],
)
def test_a_camera_that_travels_or_hardly_turns_shows_none(rad_s, speed):
    R = exp(TIMES[:, None] * [0.0, rad_s, 0.0])
    tracks = seen(R, TIMES[:, None] * speed, places=AROUND)
    assert focal_by_turns(tracks, TIMES, assumed(1.5), WIDTH) is None


def test_a_lens_that_zooms_while_it_turns_shows_none():
    zooming = FOCAL_PX * np.linspace(1.0, 1.5, T)
    tracks = seen(turning(0.25), focal_px=zooming, places=AROUND)
    assert focal_by_turns(tracks, TIMES, assumed(1.5), WIDTH) is None
