# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera's rotation, on pictures of a wall and a room seen by a camera of known rotation."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.camera.camera_rotation import BackgroundTracker
from scope.scope_addon.capture.camera.intrinsics import Camera, assumed_camera, pinhole
from scope.scope_addon.capture.fitting.focal_length import BackgroundEstimators
from scope.solver.rotations import exp, log

WIDTH = 720
HEIGHT = 405
FOCAL = 675.0
K = pinhole(WIDTH, HEIGHT, FOCAL)
WIDE = 2700  # pixels, of the panorama
CAMERA = Camera(K, np.zeros(5), "given")
FPS = 24.0


@pytest.fixture(scope="module")
def panorama():
    """A texture with corners everywhere: blocks of noise at three sizes, seen by a static wide
    camera.
    """
    rng = np.random.default_rng(0)
    layers = [
        cv2.resize(
            rng.integers(0, 255, (n, 2 * n, 3), np.uint8),
            (WIDE, WIDE // 2),
            interpolation=cv2.INTER_CUBIC,
        )
        for n in (20, 60, 180)
    ]
    return np.mean(layers, axis=0).astype(np.uint8)


def view(panorama, R_first_camera, K=K):
    """The image of a rotated camera: the panorama is a plane at infinity in front of the first
    camera.
    """
    wide = pinhole(WIDE, WIDE // 2, FOCAL)
    H = wide @ R_first_camera @ np.linalg.inv(K)
    return cv2.warpPerspective(panorama, np.linalg.inv(H), (WIDTH, HEIGHT), flags=cv2.INTER_LINEAR)


def angle_deg(a, b):
    return np.degrees(np.linalg.norm(log(np.swapaxes(a, -1, -2) @ b), axis=-1))


def follow(pictures, people=lambda k: [], assumed=CAMERA):
    tracker = BackgroundTracker(assumed, WIDTH, HEIGHT)
    for k, picture in enumerate(pictures):
        tracker.add(picture, k / FPS, people(k))
    return tracker.record().motion(assumed, CAMERA, (WIDTH, HEIGHT))


def test_a_pan_with_tilt_and_roll_is_found(panorama):
    T = 50
    s = np.linspace(0, 1, T)[:, None]
    truth = exp(np.concatenate([0.08 * np.sin(3 * s), 0.6 * s, 0.05 * s], axis=1))
    found = follow(view(panorama, R) for R in truth)
    assert not found.is_static
    assert angle_deg(found.R_first_camera, truth).max() < 0.3
    assert found.known.sum() >= T / 3


@pytest.mark.slow
def test_a_camera_on_a_tripod_is_static_despite_noise_and_a_passer_by(panorama):
    rng = np.random.default_rng(1)
    still = view(panorama, np.eye(3))
    walker = rng.integers(0, 255, (300, 120, 3), np.uint8)

    def picture(k):
        image = np.clip(still + rng.normal(0, 4, still.shape), 0, 255).astype(np.uint8)
        image[100:400, 8 * k : 8 * k + 120] = walker
        return image

    def people(k):
        return [np.array([[8.0 * k, 100.0], [8.0 * k + 120, 400.0]])]

    found = follow((picture(k) for k in range(60)), people)
    assert found.is_static, found.largest_turn_deg


def test_a_large_moving_object_does_not_disturb_the_estimate(panorama):
    """A third of the picture moves against the pan, and is not marked as a person."""
    T = 36
    truth = exp(np.linspace(0, 0.25, T)[:, None] * [0.0, 1.0, 0.0])
    rng = np.random.default_rng(2)
    lorry = cv2.resize(
        rng.integers(0, 255, (20, 20, 3), np.uint8), (300, 300), interpolation=cv2.INTER_CUBIC
    )

    def picture(k):
        image = view(panorama, truth[k])
        image[80:380, 80 + 6 * k : 380 + 6 * k] = lorry
        return image

    found = follow(picture(k) for k in range(T))
    assert angle_deg(found.R_first_camera, truth).max() < 0.4


def plain_wall(bright, faint):
    """A wide picture of a plain wall with dots, that many bright and that many faint ones."""
    rng = np.random.default_rng(5)
    image = np.full((WIDE // 2, WIDE), 100.0, np.float32)
    grid = np.stack(np.meshgrid(np.arange(60, WIDE, 45), np.arange(480, 880, 45)), -1)
    places = rng.permutation(grid.reshape(-1, 2))[: bright + faint]
    for k, (x, y) in enumerate(places.tolist()):
        cv2.circle(image, (x, y), 6, 230.0 if k < bright else 107.0, -1, cv2.LINE_AA)
    image = cv2.GaussianBlur(image, (0, 0), 3.0)
    return np.repeat(image[:, :, None], 3, axis=2).astype(np.uint8)


@pytest.mark.parametrize(("bright", "faint"), [(70, 0), (20, 350)])
def test_a_pan_over_a_plain_wall_is_found(bright, faint):
    """Some 17 dots are in view at a time, or five bright and 85 faint ones; from any frame to the
    next one that is followed, most stay.
    """
    truth = exp(np.linspace(-0.35, 0.35, 60)[:, None] * [0.0, 1.0, 0.0])
    wall = plain_wall(bright, faint)
    found = follow(view(wall, R) for R in truth)
    assert angle_deg(found.R_first_camera, truth[0].T @ truth).max() < 0.4


def test_a_shadow_that_moves_over_a_plain_wall_is_no_pan():
    """Of somebody who walks by, on a wall with one spot."""
    pictures = []
    for k in range(60):
        shadow = np.zeros((HEIGHT, WIDTH), np.float32)
        x = 100 + 5 * k
        cv2.circle(shadow, (x, 120), 22, 1.0, -1)
        cv2.ellipse(shadow, (x, 200), (32, 60), 0.0, 0.0, 360.0, 1.0, -1)
        for side in (-1, 1):
            cv2.line(shadow, (x + 10 * side, 240), (x + 25 * side, 340), 1.0, 16)
            cv2.line(shadow, (x + 20 * side, 160), (x + 50 * side, 240), 1.0, 12)
        picture = 150.0 - 40.0 * cv2.GaussianBlur(shadow, (0, 0), 1.5)
        picture[30:50, 600:620] = 60.0
        pictures.append(np.repeat(picture[:, :, None], 3, axis=2).astype(np.uint8))
    assert follow(pictures).is_static


def test_a_pan_shows_a_lens_twice_as_long_as_assumed(panorama):
    """With the assumed lens, it would be 45 degrees; a lens that is given stays."""
    size = (WIDTH, HEIGHT)
    assumed = assumed_camera(*size, size)
    long = pinhole(*size, 2.0 * assumed.intrinsics[0, 0])
    truth = exp(np.linspace(-0.2, 0.2, 50)[:, None] * [0.0, 1.0, 0.0])
    tracker = BackgroundTracker(assumed, *size)
    for k, R in enumerate(truth):
        tracker.add(view(panorama, R, long), k / FPS, [])
    for k in range(50, 60):  # nothing is seen any more
        tracker.add(np.full((HEIGHT, WIDTH, 3), 90, np.uint8), k / FPS, [])
    record = tracker.record()
    nothing = SimpleNamespace(load=lambda: None)
    with BackgroundEstimators(assumed, *size, nothing) as background:
        turned, camera = background.by_turns(record, assumed)
        assert background.by_turns(record, CAMERA) == (record, CAMERA)
    assert camera.intrinsics[0, 0] == pytest.approx(long[0, 0], rel=0.06)
    assert not turned.known[50:].any()
    found = turned.motion(assumed, camera, size)
    assert found.largest_turn_deg == pytest.approx(np.degrees(0.4), rel=0.06)


def test_a_short_blackout_is_bridged(panorama):
    truth = exp(np.linspace(0, 0.3, 48)[:, None] * [0.0, 1.0, 0.0])
    pictures = [view(panorama, R) for R in truth]
    pictures[24:27] = np.zeros((3, HEIGHT, WIDTH, 3), np.uint8)
    found = follow(pictures)
    assert not found.is_static
    # only the rotation during the blackout is lost
    lost = angle_deg(truth[22], truth[29])
    assert angle_deg(found.R_first_camera, truth).max() < lost + 0.4
