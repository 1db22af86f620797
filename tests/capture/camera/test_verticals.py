# SPDX-License-Identifier: GPL-3.0-or-later
"""Up from vertical and horizontal edges: drawn rooms with a known camera, and real pictures with
known up.
"""

import cv2
import numpy as np
import pytest
from scope.scope_addon.capture.camera.intrinsics import Camera, pinhole
from scope.scope_addon.capture.camera.line_segments import Lines, Segments, find_segments
from scope.scope_addon.capture.camera.verticals import estimate_up_from_lines
from scope.scope_addon.capture.fitting.focal_length import camera_by_edges
from scope.scope_addon.capture.world.world_frame import BODIES, up_from_scene
from scope.solver.rotations import exp

WIDTH = 1280
HEIGHT = 720
K = pinhole(WIDTH, HEIGHT, 1100.0)
CAMERA = Camera(K, np.zeros(5), "given")
LEVEL_UP = np.array([0.0, -1.0, 0.0])


def room(R_camera_level, posts=14, clutter=0):
    """A picture of posts, horizontal edges and clutter, seen by a rotated camera."""
    rng = np.random.default_rng(0)
    picture = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)

    def line(a, b, colour):
        ends = np.array([a, b]) @ R_camera_level.T
        if (ends[:, 2] > 0.5).all():
            pixels = ends @ K.T
            pixels = np.round(pixels[:, :2] / pixels[:, 2:]).astype(int)
            cv2.line(picture, *pixels.tolist(), colour, 3, cv2.LINE_AA)

    for _ in range(posts):
        x = rng.uniform(-4, 4)
        z = rng.uniform(4, 9)
        line([x, -1.5, z], [x, 1.2, z], (30, 30, 30))
    for _ in range(10):
        y = rng.uniform(-1.5, 1.2)
        z = rng.uniform(4, 9)
        line([-4, y, z], [4, y, z], (220, 220, 220))
    for _ in range(clutter):
        a = rng.uniform([-4, -1.5, 4], [4, 1.2, 9])
        line(a, a + rng.uniform(-0.7, 0.7, 3), (60, 60, 200))
    return picture


def angle_deg(a, b):
    return float(np.degrees(np.arccos(np.clip(a @ b, -1, 1))))


@pytest.mark.parametrize("turn", [[0, 0, 0], [0.25, 0, 0.0], [-0.15, 0.3, 0.2], [0.3, -0.5, -0.25]])
def test_posts_correct_a_leaning_body(turn):
    R = exp(turn)
    truth = R @ LEVEL_UP
    lines = find_segments(room(R, clutter=25), []).lines(CAMERA)
    leaning = exp([0.12, 0.0, 0.15]) @ truth
    found = estimate_up_from_lines(lines, leaning).up
    assert angle_deg(leaning, truth) > 9
    assert angle_deg(found, truth) < 1.0


@pytest.mark.parametrize("seed", range(2))
def test_a_ramp_next_to_a_floor_is_ambiguous(seed):
    """Edges across both, and as many along either: one of them determines up, both together do
    not.
    """
    rng = np.random.default_rng(seed)
    up_of = {"floor": LEVEL_UP, "ramp": exp([np.radians(16), 0, 0]) @ LEVEL_UP}
    R = exp([0.0, 0.5, 0.0])
    between = exp([np.radians(8), 0, 0]) @ LEVEL_UP

    def edges(direction, count):
        through = np.stack(
            [rng.uniform(-0.5, 0.5, count), rng.uniform(-0.3, 0.3, count), np.ones(count)], axis=1
        )
        normals = np.cross(through, direction)
        return normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def up_from(*parts):
        normals = np.concatenate(parts)
        lines = Lines(normals, np.full(len(normals), 0.1))
        return estimate_up_from_lines(lines, R @ between).up

    across = edges(R @ [1.0, 0, 0], 16)
    along = {name: edges(R @ np.cross(up, [1.0, 0, 0]), 16) for name, up in up_of.items()}
    for name, up in up_of.items():
        assert angle_deg(up_from(across, along[name]), R @ up) < 1.0
    assert up_from(across, *along.values()) is None


@pytest.mark.parametrize("turn", [[0, 0, 0.12], [-0.1, 0.1, -0.1]])
def test_a_fence_determines_a_horizontal_direction_but_not_up(turn):
    R = exp(turn)
    lines = find_segments(room(R, posts=0, clutter=10), []).lines(CAMERA)
    leaning = exp([0.1, 0.0, 0.15]) @ R @ LEVEL_UP
    found = estimate_up_from_lines(lines, leaning)
    assert found.up is None
    assert abs(90 - angle_deg(found.level, R @ LEVEL_UP)) < 0.5
    feet = np.zeros((5, 4, 3))
    up, source = up_from_scene(leaning, feet, lines)
    assert source == BODIES
    off_deg = angle_deg(up, R @ LEVEL_UP)
    assert off_deg < 0.8 * angle_deg(leaning, R @ LEVEL_UP)
    # the pitch, which no edge determines, remains
    assert off_deg == pytest.approx(np.degrees(0.1), abs=1.2)


@pytest.mark.parametrize("count", [12, 60, 200])
@pytest.mark.parametrize("seed", range(2))
def test_random_lines_determine_nothing(count, seed):
    rng = np.random.default_rng(seed)
    middle = rng.uniform([0, 0], [WIDTH, HEIGHT], (count, 2))
    angle = rng.uniform(0, np.pi, count)
    lengths = np.sort(0.03 + rng.exponential(0.08, count))[::-1]
    half = 0.5 * WIDTH * lengths[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    lines = Segments(np.stack([middle - half, middle + half], axis=1), lengths).lines(CAMERA)
    found = estimate_up_from_lines(lines, LEVEL_UP)
    assert found.up is None
    assert found.level is None


def test_a_picture_without_vertical_edges_determines_nothing():
    blank = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
    horizontal_edges_only = room(np.eye(3), posts=0)
    for picture in (blank, horizontal_edges_only):
        lines = find_segments(picture, []).lines(CAMERA)
        assert estimate_up_from_lines(lines, LEVEL_UP).up is None


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_real_cameras_with_roll_and_pitch(shared, number):
    """Four pictures of a laboratory with known up directions."""
    folder = shared / "data" / "pose2sim"
    ok, picture = cv2.VideoCapture(str(folder / f"cam{number}.mp4")).read()
    assert ok
    truth = np.load(folder / f"truth_cam{number}.npz")["up"]
    size = (picture.shape[1], picture.shape[0])
    segments = find_segments(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), [])
    lines = segments.lines(camera_by_edges(segments, *size, size))  # the focal length is unknown
    leaning = exp(np.radians(7) * np.random.default_rng(number).standard_normal(3)) @ truth
    assert angle_deg(estimate_up_from_lines(lines, leaning).up, truth) < 2.0
